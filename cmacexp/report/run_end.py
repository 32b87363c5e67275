"""Figures of the last steps of a run that fell or diverged."""

from typing import TYPE_CHECKING

from cmacexp.report.figure_data import DESIRED_LINE, FigureData, legend_above, mark
from cmacexp.report.page import Drawing
from cmacexp.report.style import SERIES, label, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAST_STEPS = 100
"""Steps shown before a run stopped."""


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
    axes[3].plot(rows["time"], 1e3 * rows["stability_margin"], label="planned", **DESIRED_LINE)
    axes[3].plot(rows["time"], 1e3 * rows["true_stability_margin"], label="true", color=SERIES[1])
    label(axes[0], "tilt of the body", "", "angle, mrad")
    label(axes[1], "height of the body", "", "height, mm")
    label(axes[2], "contact forces", "time, s", "force, N")
    label(axes[3], "stability margin, nearest edge", "time, s", "margin, mm")
    legend_above(axes[0])
    legend_above(axes[2])
    legend_above(axes[3])
    return figure


def _draw_end_of_legs(data: FigureData) -> "Figure":
    figure, axes = new_figure(1, 2, 2.6)
    count = len(data.axes)
    joints, unit = [f"dq{n}" for n in range(1, count + 1)], "joint speed, rad/s"
    speeds, unit = (joints, unit) if data.has_joints else (["vx", "vy"], "speed, m/s")
    for leg in range(1, data.legs + 1):
        own = data.trace[data.trace["leg"] == leg].tail(LAST_STEPS)
        whose = f"leg {leg} " if data.legs > 1 else ""
        for index, name in enumerate(speeds):
            part = f"joint {index + 1}" if data.has_joints else "along " + "xy"[index]
            axes[0].plot(own["time"], own[name], label=whose + part, **mark(count * (leg - 1) + index))
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
