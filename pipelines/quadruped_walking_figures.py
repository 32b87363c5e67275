"""The quadruped as the paper draws it: gait diagram (Fig. 14), oblique (Fig. 15), in three views (Fig. 16 to 20)."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.planning.stability import FRONT, REAR
from cmacexp.recording import palette
from cmacexp.report.machine_drawing import ALOFT, DENT, MM, NEAR, NEAR_SIDE, draw_leg, joints
from cmacexp.report.style import DESIRED, GROUND, SERIES, add_legend, colour, label, new_figure
from cmacexp.study import Figure
from cmacexp.typing import Array
from pipelines.quadruped_walking_events import Walk, instants

if TYPE_CHECKING:
    from matplotlib.axes import Axes

X, Y, Z = range(3)
NAMES = ("1 left front", "2 right front", "3 left rear", "4 right rear")
DEPRESSION_SCALE = 20.0
"""Factor by which drawn depressions exceed the true ones."""
PLATE = 0.03
"""Drawn thickness of the body, m."""
OBLIQUE = 0.5 * np.array([np.cos(np.radians(38.0)), np.sin(np.radians(38.0))])
"""A metre to the left as drawn in the oblique view."""
BODY, COG, POLYGON = colour(palette.BODY_COLOR), colour(palette.COG), colour(palette.POLYGON)


def gait_diagram(walk: Walk, cycles: int = 2) -> Figure:
    """Fig. 14: which foot is planned to be down, and which carries, over the last cycles."""
    rows = walk.view.cycle > walk.view.cycle[-1] - cycles
    time = walk.view.time[rows] - walk.view.time[rows][0]
    figure, (axes,) = new_figure(height=2.4)
    bars = {
        "planned support": (walk.support, 0.98, 1.28, "black"),
        "foot carries": (walk.force > 0.0, 0.72, 0.94, SERIES[1]),
    }
    for i in range(4):
        for name, (down, low, high, ink) in bars.items():
            where = {"where": down[rows, i], "step": "post", "label": name}
            axes.fill_between(time, low + 2 - i, high + 2 - i, color=ink, lw=0.0, **where)
    for cycle in range(1, cycles):
        axes.axvline(cycle * (time[-1] + walk.period) / cycles, color=DESIRED, lw=0.9, ls="--")
    axes.set(xlim=(0.0, time[-1] + walk.period), ylim=(-0.6, 3.6))
    axes.set_yticks(range(4), NAMES[::-1])
    axes.grid(visible=False, axis="y")
    label(axes, "support and transfer", "time, s", "leg")
    add_legend(figure, [axes])
    return figure


def _place(walk: Walk, k: int, points: Array) -> Array:
    """Points (n, 3) of the body frame in step ``k``: forward and left of its centre of gravity, and up, m."""
    now = replace(walk.view, trace=walk.view.trace.select(slice(k, k + 1)))
    return now.in_world(points[None])[0] - now.way() * [1.0, 1.0, 0.0]


def _links(walk: Walk, k: int) -> Array:
    """(4, 3, 3): hip, knee and foot of each leg in step ``k``, m."""
    links: Array = joints(walk.view)[k] / MM
    return links


def _plate(walk: Walk, k: int) -> Array:
    """(8, 3): corners of the body in step ``k``, m."""
    low, high = walk.view.hips.min(axis=0), walk.view.hips.max(axis=0)
    corners = [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, PLATE)]
    return _place(walk, k, np.array(corners))


def _draw_cog(axes: "Axes", height: float) -> None:
    axes.plot(0.0, height, "o", ms=8.5, color="white", mec=COG, mew=1.6, zorder=8)
    axes.plot(0.0, height, "+", ms=8.5, color=COG, mew=1.4, zorder=9)


def _number(axes: "Axes", x: float, y: float, text: str, ink: str = "black") -> None:
    axes.text(x, y, text, ha="center", va="center", color=ink, weight="bold")


def _hull(points: Array) -> Array:
    """Corners of the convex hull of points (n, 2), counterclockwise."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def _draw_elevation(axes: "Axes", walk: Walk, k: int, across: int, near: tuple[int, ...]) -> None:
    """A view along the ground; far legs are pale, their numbers stand in the upper row below the ground."""
    links, flat = MM * _links(walk, k), [across, Z]
    dents = MM * DEPRESSION_SCALE * walk.force[k] / walk.view.run.config["terrain"]["stiffness"]
    for i in range(4):
        is_near, aloft, foot = i + 1 in near, not walk.support[k, i], float(links[i, 2, across])
        draw_leg(axes, links[i][:, flat], is_near, aloft)
        axes.fill([foot - DENT, foot, foot + DENT], [0.0, -dents[i], 0.0], color=GROUND, lw=0.0, zorder=3)
        _number(
            axes, foot, -118.0 if is_near else -76.0, str(i + 1), ALOFT if aloft else NEAR if is_near else "#5F6B78"
        )
    axes.fill(*_hull(MM * _plate(walk, k)[:, flat]).T, color=BODY, ec=NEAR, lw=0.8, zorder=3.5)
    axes.axhline(0.0, color=GROUND, lw=1.2, zorder=1)
    height = MM * float(walk.view.body["height"][k])
    axes.plot([0.0, 0.0], [0.0, height], color=COG, lw=1.0, ls="--", zorder=7)
    _draw_cog(axes, height)


def _draw_plan(axes: "Axes", walk: Walk, k: int) -> None:
    """The view from above: what the feet that carry span, what is planned, and the margins along the body."""
    links, carries, aloft = MM * _links(walk, k), walk.force[k] > 0.0, ~walk.support[k]
    feet = links[:, 2, :2]
    axes.fill(*_hull(MM * _plate(walk, k)[:, :2]).T, color=BODY, alpha=0.55, lw=0.0, zorder=1)
    if carries.sum() >= 3:
        axes.fill(*_hull(feet[carries]).T, fc=POLYGON, alpha=0.25, lw=0.0, zorder=2)
        axes.fill(*_hull(feet[carries]).T, fill=False, ec=POLYGON, lw=1.2, zorder=2.5)
    axes.fill(*_hull(feet[~aloft]).T, fill=False, ec="black", lw=0.9, ls=(0, (4, 3)), zorder=2.6)
    for i, (x, y) in enumerate(feet):
        draw_leg(axes, links[i][:, :2], True, bool(aloft[i]))
        _number(axes, x, y + (62.0 if y > 0.0 else -62.0), str(i + 1), ALOFT if aloft[i] else "black")
    margins = walk.carried[k]
    for margin, sign, name, side in ((margins[FRONT], 1.0, "front", "right"), (margins[REAR], -1.0, "rear", "left")):
        known = bool(np.isfinite(margin))
        if known:
            axes.plot([0.0, sign * MM * margin], [0.0, 0.0], color=COG, lw=2.4, solid_capstyle="butt", zorder=6)
        text = f"{name} margin {MM * margin:.0f} mm" if known else f"no {name} margin"
        axes.text(0.5 + 0.48 * sign, 0.03, text, transform=axes.transAxes, ha=side, color=COG, zorder=9)
    axes.plot(0.0, 0.0, "o", ms=4.0, color=COG, mec="black", mew=0.6, zorder=8)


def _draw_forces(axes: "Axes", walk: Walk, k: int) -> None:
    """The paper's foot force display: actual beside desired, leg by leg."""
    number, wide = np.arange(1, 5), 0.36
    for shift, name, forces, ink in (
        (-0.5, "actual", walk.force, SERIES[1]),
        (0.5, "desired", walk.desired, "white"),
    ):
        look: dict[str, Any] = {"hatch": "////", "ec": DESIRED} if name == "desired" else {}
        bars = axes.bar(number + shift * wide, forces[k], wide, color=ink, label=name, zorder=3, **look)
        axes.bar_label(bars, fmt="%.1f", fontsize=6.5)
    axes.set(ylim=(0.0, 29.0), xticks=number)
    axes.grid(visible=False, axis="x")
    axes.legend(loc="upper center", ncols=2, borderaxespad=0.1)
    label(axes, "foot forces", "leg", "contact force, N")


def views(walk: Walk, cycle: int, number: int) -> Figure:
    """Fig. 16 to 20: the machine from above, from the right side and the front, and its foot forces."""
    k = ({16: 0} | instants(walk, cycle))[number]
    figure, (plan, forces, side, front) = new_figure(2, 2, 2.75, width_ratios=[1.65, 1.0], height_ratios=[1.0, 1.05])
    _draw_plan(plan, walk, k)
    _draw_forces(forces, walk, k)
    _draw_elevation(side, walk, k, X, NEAR_SIDE)
    _draw_elevation(front, walk, k, Y, (1, 2))
    label(plan, "from above", "x forward of the centre of gravity, mm", "y left, mm")
    label(side, "side, from the right", "x forward of the centre of gravity, mm", "z up, mm")
    label(front, "front", "y left, mm", "z up, mm")
    plan.set(xlim=(-560.0, 560.0), ylim=(-370.0, 340.0), aspect="equal")
    side.set(xlim=(-560.0, 560.0), ylim=(-150.0, 620.0), aspect="equal")
    front.set(xlim=(-340.0, 340.0), ylim=(-150.0, 620.0), aspect="equal")
    return figure


def _flat(points: Array) -> Array:
    """Points (n, 3) on paper, (n, 2), mm: x to the right, z up, y aslant away from the viewer."""
    return MM * (points[:, [X, Z]] + points[:, [Y]] * OBLIQUE)


def diagram(walk: Walk) -> Figure:
    """Fig. 15: the quadruped in its initial posture, aslant from the right."""
    links, plate = _links(walk, 0), _plate(walk, 0)
    figure, (axes,) = new_figure(height=4.0)
    ground = np.array([[x, y, 0.0] for x, y in ((-0.6, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.6, 0.3))])
    axes.fill(*_flat(ground).T, color=GROUND, alpha=0.13, lw=0.0, zorder=0)
    for i in (0, 2, 1, 3):
        leg = _flat(links[i])
        draw_leg(axes, leg, i + 1 in NEAR_SIDE, False)
        _number(axes, leg[2, 0], leg[2, 1] - 34.0, f"foot {i + 1}")
    x, y, z = plate.T
    for seen in (x > 0.0, y < 0.0, z > z.mean()):
        axes.fill(*_hull(_flat(plate[seen])).T, fc=BODY, ec=NEAR, lw=0.9, zorder=3)
    height = MM * float(walk.view.body["height"][0])
    _draw_cog(axes, height)
    axes.annotate("centre of gravity", (0.0, height), xytext=(9, 9), textcoords="offset points")
    arrow = {"arrowstyle": "->", "lw": 1.2}
    axes.annotate("forward", (440.0, -160.0), xytext=(300.0, -160.0), va="center", ha="right", arrowprops=arrow)
    axes.set(xlim=(-740.0, 740.0), ylim=(-190.0, 735.0), aspect="equal")
    axes.axis("off")
    return figure
