"""The quadruped as the paper draws it: oblique (Fig. 15), and from the front, the side and above (Fig. 16 to 20)."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.planning.stability import FRONT, REAR, polygon
from cmacexp.recording import palette
from cmacexp.report.style import DESIRED, GROUND, SERIES, colour, label, new_figure
from cmacexp.typing import Array, Mask
from pipelines.quadruped_walking_events import Walk

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

X, Y, Z = range(3)
MM = 1e3
DEPRESSION_SCALE = 20.0
"""Factor by which drawn depressions exceed the true ones."""
PLATE = 0.03
"""Drawn thickness of the body, m."""
OBLIQUE = 0.5 * np.array([np.cos(np.radians(38.0)), np.sin(np.radians(38.0))])
"""A metre to the left as drawn in the oblique view."""
MOST_FORCE = 25.0
"""Upper end of the force display, N."""
NEAR, FAR, ALOFT = colour(palette.THIGH), "#AEB9C6", SERIES[0]
COG, POLYGON = colour(palette.COG), colour(palette.POLYGON)
NEAR_SIDE = (2, 4)
"""Legs on the viewer's side in the side view, which is taken from the right."""


class Pose(NamedTuple):
    """The machine in one step; points in the world, forward and left of its centre of gravity, and up, m."""

    links: Array
    """(4, 3, 3): hip, knee and foot of each leg."""
    plate: Array
    """(8, 3): corners of the body."""
    height: float
    force: Array
    desired: Array
    aloft: Mask
    """Whether a foot is planned to be in transfer."""
    stiffness: float
    carried: Array
    """Margins of the feet that carry."""


def pose_of(walk: Walk, k: int) -> Pose:
    """The machine in step ``k``."""
    view = walk.view

    def at(points: Array) -> Array:
        world = view.in_world(np.broadcast_to(points, (len(view.time), 3)))[k]
        placed: Array = world - view.way()[k] * [1.0, 1.0, 0.0]
        return placed

    links = []
    for leg in view.legs:
        upper = leg.lengths[0] if leg.lengths else 0.0
        x, y = np.zeros((2, len(view.time)))
        q = leg["q1"]
        joints = ((x, y), (upper * np.cos(q), upper * np.sin(q)), (leg["x"], leg["y"]))
        links.append([at(leg.in_body(*joint)) for joint in joints])
    hips = np.array([leg.hip for leg in view.legs])
    low, high = hips.min(axis=0), hips.max(axis=0)
    plate = [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, PLATE)]
    return Pose(
        np.array(links),
        np.array([at(np.array(corner)) for corner in plate]),
        float(view.body["height"][k]),
        walk.force[k],
        walk.desired[k],
        ~walk.support[k],
        float(view.config["terrain"]["stiffness"]),
        walk.carried(k),
    )


def _draw_leg(axes: "Axes", points: Array, near: bool, aloft: bool) -> None:
    ink = ALOFT if aloft else NEAR if near else FAR
    order = 4 if near else 2
    axes.plot(*points.T, color=ink, lw=3.0 if near else 2.4, solid_capstyle="round", zorder=order)
    axes.plot(*points[:2].T, "o", ms=4.5, color="white", mec=ink, mew=1.3, zorder=order + 0.5)
    axes.plot(*points[2], "o", ms=5.5, color=ink, zorder=order + 0.5)


def _draw_cog(axes: "Axes", x: float, y: float) -> None:
    """The sign of a centre of gravity."""
    axes.plot(x, y, "o", ms=8.5, color="white", mec=COG, mew=1.6, zorder=8)
    axes.plot(x, y, "+", ms=8.5, color=COG, mew=1.4, zorder=9)


def _draw_elevation(axes: "Axes", pose: Pose, across: int, near: tuple[int, ...]) -> None:
    """A view along the ground; far legs are pale, their numbers stand in the upper row below the ground."""
    flat = [across, Z]
    for i in sorted(range(4), key=lambda i: i + 1 in near):
        leg, is_near = MM * pose.links[i][:, flat], i + 1 in near
        _draw_leg(axes, leg, is_near, bool(pose.aloft[i]))
        foot = leg[2, 0]
        deep = -MM * DEPRESSION_SCALE * pose.force[i] / pose.stiffness
        axes.fill([foot - 26.0, foot, foot + 26.0], [0.0, deep, 0.0], color=GROUND, lw=0.0, zorder=3)
        ink = ALOFT if pose.aloft[i] else "black" if is_near else "#5F6B78"
        axes.text(foot, -118.0 if is_near else -76.0, str(i + 1), ha="center", va="center", color=ink, weight="bold")
    ends = MM * pose.plate[:, flat]
    corners = polygon(ends)
    axes.fill(*corners.T, color=colour(palette.BODY), ec=NEAR, lw=0.8, zorder=3.5)
    axes.axhline(0.0, color=GROUND, lw=1.2, zorder=1)
    axes.plot([0.0, 0.0], [0.0, MM * pose.height], color=COG, lw=1.0, ls="--", zorder=7)
    _draw_cog(axes, 0.0, MM * pose.height)


def _draw_plan(axes: "Axes", pose: Pose) -> None:
    """The view from above: what the feet that carry span, what is planned, and the margins along the body."""
    feet = MM * pose.links[:, 2, :2]
    plate = polygon(MM * pose.plate[:, :2])
    axes.fill(*plate.T, color=colour(palette.BODY), alpha=0.55, lw=0.0, zorder=1)
    carries = pose.force > 0.0
    if carries.sum() >= 3:
        axes.fill(*polygon(feet[carries]).T, fc=POLYGON, alpha=0.25, lw=0.0, zorder=2)
        axes.fill(*polygon(feet[carries]).T, fill=False, ec=POLYGON, lw=1.2, zorder=2.5)
    planned = polygon(feet[~pose.aloft])
    axes.fill(*planned.T, fill=False, ec="black", lw=0.9, ls=(0, (4, 3)), zorder=2.6)
    for i in range(4):
        _draw_leg(axes, MM * pose.links[i][:, :2], True, bool(pose.aloft[i]))
        side = 1.0 if feet[i, 1] > 0.0 else -1.0
        ink = ALOFT if pose.aloft[i] else "black"
        axes.text(
            feet[i, 0], feet[i, 1] + 62.0 * side, str(i + 1), ha="center", va="center", color=ink, weight="bold"
        )
    for margin, sign, name in ((pose.carried[FRONT], 1.0, "front"), (pose.carried[REAR], -1.0, "rear")):
        if np.isfinite(margin):
            axes.plot([0.0, sign * MM * margin], [0.0, 0.0], color=COG, lw=2.4, solid_capstyle="butt", zorder=6)
        axes.text(
            0.5 + 0.48 * sign,
            0.03,
            f"{name} margin {MM * margin:.0f} mm" if np.isfinite(margin) else f"no {name} margin",
            transform=axes.transAxes,
            ha="right" if sign > 0 else "left",
            color=COG,
            zorder=9,
        )
    axes.plot(0.0, 0.0, "o", ms=4.0, color=COG, mec="black", mew=0.6, zorder=8)


def _draw_forces(axes: "Axes", pose: Pose) -> None:
    """The paper's foot force display: actual beside desired, leg by leg."""
    number = np.arange(1, 5)
    wide = 0.36
    axes.bar(number - wide / 2, pose.force, wide, color=SERIES[1], label="actual", zorder=3)
    axes.bar(
        number + wide / 2, pose.desired, wide, fc="white", ec=DESIRED, hatch="////", lw=1.0, label="desired", zorder=3
    )
    for shift, side, values in ((-0.03, "right", pose.force), (0.03, "left", pose.desired)):
        for x, value in zip(number + shift, values, strict=True):
            axes.text(x, value + 0.4, f"{value:.1f}", ha=side, va="bottom", fontsize=7.0)
    axes.set(ylim=(0.0, MOST_FORCE + 4.0), xticks=number, yticks=np.arange(0.0, MOST_FORCE + 1.0, 5.0))
    axes.grid(visible=False, axis="x")
    axes.legend(loc="upper center", ncols=2, borderaxespad=0.1)
    label(axes, "foot forces", "leg", "contact force, N")


def views(walk: Walk, k: int) -> "Figure":
    """The machine in step ``k`` from above, from the right side and from the front, and its foot forces."""
    pose = pose_of(walk, k)
    long, broad = (-560.0, 560.0), (-340.0, 340.0)
    figure, (plan, forces, side, front) = new_figure(2, 2, 2.75, width_ratios=[1.65, 1.0], height_ratios=[1.0, 1.05])
    _draw_plan(plan, pose)
    plan.set(xlim=long, ylim=(-370.0, 340.0))
    label(plan, "from above", "x forward of the centre of gravity, mm", "y left, mm")
    _draw_forces(forces, pose)
    _draw_elevation(side, pose, X, NEAR_SIDE)
    side.set(xlim=long)
    label(side, "side, from the right", "x forward of the centre of gravity, mm", "z up, mm")
    _draw_elevation(front, pose, Y, (1, 2))
    front.set(xlim=broad)
    label(front, "front", "y left, mm", "z up, mm")
    for axes in (side, front):
        axes.set_ylim(-150.0, 620.0)
    for axes in (plan, side, front):
        axes.set_aspect("equal")
    return figure


def _flat(points: Array) -> Array:
    """Points (n, 3) on paper, (n, 2), mm: x to the right, z up, y aslant away from the viewer."""
    return MM * np.stack([points[:, X] + OBLIQUE[0] * points[:, Y], points[:, Z] + OBLIQUE[1] * points[:, Y]], axis=1)


def _dimension(axes: "Axes", ends: Array, text: str, shift: tuple[float, float]) -> None:
    """A length between two points (2, 3), and its name beside the middle of it."""
    arrow = {"arrowstyle": "<->", "color": "black", "lw": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
    (x0, y0), (x1, y1) = _flat(ends).tolist()
    axes.annotate("", (x1, y1), (x0, y0), arrowprops=arrow, zorder=9)
    middle = (x0 + x1) / 2.0 + shift[0], (y0 + y1) / 2.0 + shift[1]
    axes.text(*middle, text, ha="center", va="center", fontsize=8.0, zorder=10)


def _draw_dimensions(axes: "Axes", walk: Walk, pose: Pose) -> None:
    hips, legs = pose.links[:, 0], walk.view.legs
    over, beside, inward = np.array([[0.0, 0.0, 0.075], [0.06, 0.0, 0.0], [0.1, 0.0, 0.0]])
    width = abs(legs[0].hip[1] - legs[1].hip[1])
    _dimension(axes, hips[[2, 0]] + over, f"{MM * walk.length:.0f} mm", (0.0, 24.0))
    _dimension(axes, hips[[1, 0]] + beside, f"{MM * width:.0f} mm", (68.0, -14.0))
    drop = np.stack([hips[3], hips[3] * [1.0, 1.0, 0.0]]) + inward
    _dimension(axes, drop, f"{MM * pose.height:.0f} mm", (-64.0, -90.0))
    for joint, size in enumerate(legs[1].lengths or ()):
        x, y = _flat(pose.links[1, joint : joint + 2].mean(axis=0, keepdims=True))[0].tolist()
        axes.annotate(f"{MM * size:.0f} mm", (x, y), xytext=(10, 0), textcoords="offset points", va="center")


def diagram(walk: Walk) -> "Figure":
    """The quadruped in its initial posture, aslant from the right: numbered legs and what it measures."""
    pose = pose_of(walk, 0)
    figure, (axes,) = new_figure(height=4.0)
    ground = np.array([[x, y, 0.0] for x, y in ((-0.6, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.6, 0.3))])
    axes.fill(*_flat(ground).T, color=GROUND, alpha=0.13, lw=0.0, zorder=0)
    for i in (0, 2, 1, 3):
        leg = _flat(pose.links[i])
        _draw_leg(axes, leg, i + 1 in NEAR_SIDE, False)
        axes.text(leg[2, 0], leg[2, 1] - 34.0, f"foot {i + 1}", ha="center", va="center", weight="bold")
    x, y, z = pose.plate.T
    for seen in (x > 0.0, y < 0.0, z > z.mean()):
        axes.fill(*polygon(_flat(pose.plate[seen])).T, fc=colour(palette.BODY), ec=NEAR, lw=0.9, zorder=3)
    _draw_cog(axes, 0.0, MM * pose.height)
    axes.annotate("centre of gravity", (0.0, MM * pose.height), xytext=(9, 9), textcoords="offset points")
    _draw_dimensions(axes, walk, pose)
    arrow = {"arrowstyle": "->", "lw": 1.2}
    axes.annotate("forward", (440.0, -160.0), xytext=(300.0, -160.0), va="center", ha="right", arrowprops=arrow)
    axes.set(xlim=(-740.0, 740.0), ylim=(-190.0, 735.0), aspect="equal")
    axes.axis("off")
    return figure
