"""The quadruped as the paper draws it: gait diagram (Fig. 14), in three views (Fig. 16 to 20)."""

from dataclasses import replace

import numpy as np

from cmacexp.planning.stability import FRONT, REAR
from cmacexp.recording import palette
from cmacexp.report.figures import draw_panel
from cmacexp.report.style import (
    ALOFT,
    DENT,
    DESIRED,
    GROUND,
    MM,
    NEAR,
    NEAR_SIDE,
    SERIES,
    colour,
    draw_leg,
    joints,
    label,
    new_figure,
)
from cmacexp.study import Array, Figure, Panel, Series, draw
from cmacexp.typing import Axes
from pipelines.quadruped_walking_events import Walk, instants

X, Y, Z = range(3)
DEPRESSION_SCALE = 20.0
"""Factor by which drawn depressions exceed the true ones."""
BODY, COG, POLYGON = colour(palette.BODY_COLOR), colour(palette.COG), colour(palette.POLYGON)


def gait_diagram(walk: Walk, cycles: int = 2) -> Figure:
    """Fig. 14: which foot is planned to be down, and which carries, over the last cycles."""
    rows = walk.view.cycle > walk.view.cycle[-1] - cycles
    time, series = walk.view.time[rows] - walk.view.time[rows][0], []
    shown = {"planned support": (walk.support, -0.15, "black"), "foot carries": (walk.force > 0.0, 0.15, SERIES[1])}
    for leg in range(1, 5):
        for name, (down, shift, ink) in shown.items():
            style = {"color": ink, "lw": 7.0, "linestyle": "-", "solid_capstyle": "butt"}
            series.append(Series(name, time, np.where(down[rows, leg - 1], leg + shift, np.nan), style=style))
    starts = np.flatnonzero(np.diff(walk.view.cycle[rows])) + 1
    panel = Panel("support and transfer", "time, s", "leg", series, x_limits=time[starts], y_range=(0.5, 4.5))
    return draw([replace(panel, y_down=True)])


def _draw_cog(axes: Axes, height: float) -> None:
    axes.plot(0.0, height, "o", ms=8.5, color="white", mec=COG, mew=1.6, zorder=8)
    axes.plot(0.0, height, "+", ms=8.5, color=COG, mew=1.4, zorder=9)


def _number(axes: Axes, x: float, y: float, text: str, ink: str = "black") -> None:
    axes.text(x, y, text, ha="center", va="center", color=ink, weight="bold")


def _hull(points: Array) -> Array:
    """Corners of the convex hull of points (n, 2), counterclockwise."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def _draw_elevation(axes: Axes, walk: Walk, k: int, across: int, near: tuple[int, ...]) -> None:
    """A view along the ground; far legs are pale, their numbers stand in the upper row below the ground."""
    links, flat = joints(walk.view)[k], [across, Z]
    dents = MM * DEPRESSION_SCALE * walk.force[k] / walk.view.run.config["terrain"]["stiffness"]
    for i in range(4):
        is_near, aloft, foot = i + 1 in near, not walk.support[k, i], float(links[i, 2, across])
        draw_leg(axes, links[i][:, flat], is_near, aloft)
        axes.fill([foot - DENT, foot, foot + DENT], [0.0, -dents[i], 0.0], color=GROUND, lw=0.0, zorder=3)
        _number(
            axes, foot, -118.0 if is_near else -76.0, str(i + 1), ALOFT if aloft else NEAR if is_near else "#5F6B78"
        )
    axes.plot(*links[:, 0][:, flat].T, color=BODY, lw=7.0, solid_capstyle="round", zorder=3.5)
    axes.axhline(0.0, color=GROUND, lw=1.2, zorder=1)
    height = MM * float(walk.view.body["height"][k])
    axes.plot([0.0, 0.0], [0.0, height], color=COG, lw=1.0, ls="--", zorder=7)
    _draw_cog(axes, height)


def _draw_plan(axes: Axes, walk: Walk, k: int) -> None:
    """The view from above: what the feet that carry span, what is planned, and the margins along the body."""
    links, carries, aloft = joints(walk.view)[k], walk.force[k] > 0.0, ~walk.support[k]
    feet = links[:, 2, :2]
    axes.fill(*_hull(links[:, 0, :2]).T, color=BODY, alpha=0.55, lw=0.0, zorder=1)
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


def _draw_forces(axes: Axes, walk: Walk, k: int) -> None:
    """The paper's foot force display: actual beside desired, leg by leg."""
    forces = [
        Series("actual", range(4), walk.force[k]),
        Series("desired", range(4), walk.desired[k], style={"fc": "white", "ec": DESIRED, "hatch": "////"}),
    ]
    panel = Panel("", "", "", forces, "bars", ticks=["1", "2", "3", "4"], y_range=(0.0, 29.0))
    draw_panel(axes, panel, ["actual", "desired"])
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
