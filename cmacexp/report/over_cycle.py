"""Figures of one run over the time of a cycle: foot path, errors, force, torques, body, and how it ended."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figure_data import DESIRED_LINE, SUPPORT, FigureData, legend_above, legend_below, mark
from cmacexp.report.page import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, SERIES, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOCK = "time in the cycle, s"
LAST_STEPS = 100
"""Steps shown before a run stopped."""
SHADED = "The planned support is shaded."


def _shade_support(axes: "Axes", data: FigureData, leg: int) -> None:
    rows = data.select(data.cycles[0], leg)
    support = np.asarray(rows["phase"] == "support")
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    clock = np.append(data.time_in_cycle(rows), data.cycle_time)
    if not support.all():
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            axes.axvspan(clock[start], clock[end], color=SUPPORT, zorder=0, linewidth=0)


def _cycles(axes: "Axes", data: FigureData, leg: int, value: Callable[["pd.DataFrame"], "pd.Series[float]"]) -> None:
    for index, cycle in enumerate(data.cycles):
        rows = data.select(cycle, leg)
        axes.plot(data.time_in_cycle(rows), value(rows), label=f"cycle {cycle}", **mark(index))
    axes.set_xlim(0, data.duration)


def _foot(axes: "Axes", data: FigureData, leg: int) -> None:
    first = data.select(data.cycles[0], leg)
    axes.plot(1e3 * first["x_desired"], 1e3 * first["y_desired"], label="desired", **DESIRED_LINE)
    for index, cycle in enumerate(data.cycles):
        rows = data.select(cycle, leg)
        axes.plot(1e3 * rows["x"], 1e3 * rows["y"], label=f"cycle {cycle}", **mark(index))
    label(axes, data.leg_name(leg) or "foot path", "x forward, mm", "y down, mm")
    axes.set_aspect("equal", adjustable="datalim" if data.legs == 1 else "box")


def _force(axes: "Axes", data: FigureData, leg: int) -> None:
    _shade_support(axes, data, leg)
    first = data.select(data.cycles[0], leg)
    axes.plot(data.time_in_cycle(first), first["force_desired"], label="desired", **DESIRED_LINE)
    _cycles(axes, data, leg, lambda rows: rows["force"])
    label(axes, data.leg_name(leg) or "contact force", CLOCK, "force, N")


def _error_x(axes: "Axes", data: FigureData, leg: int) -> None:
    _shade_support(axes, data, leg)
    _cycles(axes, data, leg, lambda rows: 1e3 * (rows["x"] - rows["x_desired"]))
    label(axes, data.leg_name(leg) or "error along x", CLOCK, "x - desired, mm")


def _error_y(axes: "Axes", data: FigureData, leg: int) -> None:
    _shade_support(axes, data, leg)
    _cycles(axes, data, leg, lambda rows: 1e3 * (rows["y"] - rows["y_desired"]))
    label(axes, data.leg_name(leg) or "error along y", CLOCK, "y - desired, mm")


PANELS: dict[str, tuple[Callable[["Axes", FigureData, int], None], str]] = {
    "foot": (_foot, "Paths of the feet in the frames of their hips, y down"),
    "force": (_force, "Contact force"),
    "error_x": (_error_x, "Error of the foot along x, forward"),
    "error_y": (
        _error_y,
        "Error of the foot along y, down; in support relative to the depression at the desired force",
    ),
}


def moves_along_x(data: FigureData) -> bool:
    """Whether the feet move along x; a foot that only presses has neither path nor error there."""
    return any(float(np.ptp(data.trace[name])) > 1e-6 for name in ("x", "x_desired"))


def _flip_foot(axes: "Axes") -> None:
    if not axes.yaxis_inverted():
        axes.invert_yaxis()


def draw_tracking(data: FigureData) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    names = list(PANELS) if moves_along_x(data) else ["force", "error_y"]
    if data.legs == 1:
        figure, axes = new_figure(-(-len(names) // 2), 2, 2.7)
        for ax, name in zip(axes, names, strict=True):
            PANELS[name][0](ax, data, 1)
        if "foot" in names:
            _flip_foot(axes[0])
        legend_below(figure, axes[names.index("force")])
        shaded = "" if bool((data.trace["phase"] == "support").all()) else f" {SHADED}"
        return [Drawing("tracking", figure, f"Force and errors over the chosen cycles.{shaded}")]
    return [_draw_legs(data, name) for name in names]


def _draw_legs(data: FigureData, name: str) -> Drawing:
    draw, caption = PANELS[name]
    figure, axes = new_figure(2, 2, 1.8 if name == "foot" else 2.3, sharex=True, sharey=True)
    for leg, ax in enumerate(axes, 1):
        draw(ax, data, leg)
        ax.label_outer()
    if name == "foot":
        _flip_foot(axes[0])
    legend_below(figure, axes[0])
    return Drawing(name, figure, f"{caption}." if name == "foot" else f"{caption}. {SHADED}")


def draw_torques(data: FigureData) -> Drawing:
    """Feedback and feedforward of both joints in the last chosen cycle."""
    cycle = data.cycles[-1]
    names = ("joint 1, hip", "joint 2, knee") if data.has_joints else ("along x", "along y")
    unit = "torque, N m" if data.has_joints else "force, N"
    figure, axes = new_figure(data.legs, 2, 2.6 if data.legs == 1 else 1.7, sharex=True)
    learns = bool(data.trace[["tau_feedforward_1", "tau_feedforward_2"]].to_numpy().any())
    for index, ax in enumerate(axes):
        leg, joint = index // 2 + 1, index % 2 + 1
        rows = data.select(cycle, leg)
        _shade_support(ax, data, leg)
        time = data.time_in_cycle(rows)
        ax.plot(time, rows[f"tau_feedback_{joint}"], color=FEEDBACK, label="feedback")
        if learns:
            ax.plot(
                data.time_in_cycle(rows),
                rows[f"tau_feedforward_{joint}"],
                "--",
                color=FEEDFORWARD,
                label="feedforward",
            )
        name = data.leg_name(leg)
        title = f"{name}: {names[joint - 1]}" if name else names[joint - 1]
        label(ax, title, CLOCK if leg == data.legs else "", unit)
        ax.set_xlim(0, data.duration)
    legend_below(figure, axes[0])
    shaded = "" if bool((data.trace["phase"] == "support").all()) else f" {SHADED}"
    what = "Feedback and feedforward" if learns else "Feedback"
    return Drawing("torques", figure, f"{what} in cycle {cycle}; the plant receives their sum.{shaded}")


def draw_body(data: FigureData) -> Drawing:
    """Height, pitch, roll and stability margin of the body over the chosen cycles."""
    panels = (
        ("height", 1e3, "height of the body", "height, mm"),
        ("stability_margin", 1e3, "stability margin, nearest edge", "margin, mm"),
        ("pitch", 1e3, "pitch, nose down", "pitch, mrad"),
        ("roll", 1e3, "roll, right side down", "roll, mrad"),
    )
    figure, axes = new_figure(2, 2, 2.3, sharex=True)
    for ax, (name, factor, title, unit) in zip(axes, panels, strict=True):
        for index, cycle in enumerate(data.cycles):
            rows = data.select_body(cycle)
            ax.plot(data.time_in_cycle(rows), factor * rows[name], label=f"cycle {cycle}", **mark(index))
        label(ax, title, CLOCK if ax in axes[2:] else "", unit)
        ax.set_xlim(0, data.duration)
    legend_below(figure, axes[0])
    caption = "The body over the chosen cycles; the margin is to the planned support polygon."
    return Drawing("body", figure, caption)


def _draw_end_of_body(data: FigureData) -> "Figure":
    assert data.body is not None
    rows = data.body.tail(LAST_STEPS)
    figure, axes = new_figure(2, 2, 2.4, sharex=True)
    for index, name in enumerate(("pitch", "roll")):
        axes[0].plot(rows["time"], 1e3 * rows[name], label=name, **mark(index))
    axes[1].plot(rows["time"], 1e3 * rows["height"], color=SERIES[1])
    for leg in range(1, data.legs + 1):
        own = data.trace[data.trace["leg"] == leg].tail(LAST_STEPS)
        axes[2].plot(own["time"], own["force"], label=f"leg {leg}", **mark(leg - 1))
    axes[3].plot(rows["time"], 1e3 * rows["stability_margin"], color=SERIES[1])
    label(axes[0], "tilt of the body", "", "angle, mrad")
    label(axes[1], "height of the body", "", "height, mm")
    label(axes[2], "contact forces", "time, s", "force, N")
    label(axes[3], "stability margin, nearest edge", "time, s", "margin, mm")
    legend_above(axes[0])
    legend_above(axes[2])
    return figure


def _draw_end_of_legs(data: FigureData) -> "Figure":
    figure, axes = new_figure(1, 2, 2.6)
    speeds, unit = (("dq1", "dq2"), "joint speed, rad/s") if data.has_joints else (("vx", "vy"), "speed, m/s")
    for leg in range(1, data.legs + 1):
        own = data.trace[data.trace["leg"] == leg].tail(LAST_STEPS)
        whose = f"leg {leg} " if data.legs > 1 else ""
        for index, name in enumerate(speeds):
            part = f"joint {index + 1}" if data.has_joints else "along " + "xy"[index]
            axes[0].plot(own["time"], own[name], label=whose + part, **mark(2 * (leg - 1) + index))
        axes[1].plot(own["time"], own["force"], label=whose + "force", **mark(leg - 1))
    label(axes[0], "speed", "time, s", unit)
    label(axes[1], "contact force", "time, s", "force, N")
    for ax in axes:
        if data.legs == 1:
            legend_above(ax)
        else:
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2)
    return figure


def draw_end(data: FigureData, status: str) -> Drawing:
    """The last steps of a run that fell or diverged."""
    figure = _draw_end_of_body(data) if data.body is not None and status == "fell" else _draw_end_of_legs(data)
    steps = min(LAST_STEPS, len(data.trace) // data.legs)
    return Drawing("end", figure, f"The last {steps} recorded steps before the run stopped.")
