"""Drawings of one run over the time of a cycle: foot path, errors, force, torques, body, and how it ended."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figure_data import DESIRED_LINE, SUPPORT, Look, legend_above, legend_below, mark
from cmacexp.report.page import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, SERIES, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOCK = "time in the cycle, s"
LAST_STEPS = 100
"""Steps that are shown of the end of a run that stopped."""
SHADED = "The planned support is shaded."


def _shade_support(axes: "Axes", look: Look, leg: int) -> None:
    rows = look.of(look.numbers[0], leg)
    support = np.asarray(rows["phase"] == "support")
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    clock = np.append(look.clock(rows), look.cycle_time)
    if not support.all():
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            axes.axvspan(clock[start], clock[end], color=SUPPORT, zorder=0, linewidth=0)


def _cycles(axes: "Axes", look: Look, leg: int, value: Callable[["pd.DataFrame"], "pd.Series[float]"]) -> None:
    for index, number in enumerate(look.numbers):
        rows = look.of(number, leg)
        axes.plot(look.clock(rows), value(rows), label=f"cycle {number}", **mark(index))
    axes.set_xlim(0, look.span)


def _foot(axes: "Axes", look: Look, leg: int) -> None:
    first = look.of(look.numbers[0], leg)
    axes.plot(1e3 * first["x_desired"], 1e3 * first["y_desired"], label="desired", **DESIRED_LINE)
    for index, number in enumerate(look.numbers):
        rows = look.of(number, leg)
        axes.plot(1e3 * rows["x"], 1e3 * rows["y"], label=f"cycle {number}", **mark(index))
    label(axes, look.name(leg) or "foot path", "x forward, mm", "y down, mm")
    axes.set_aspect("equal", adjustable="datalim" if look.legs == 1 else "box")


def _force(axes: "Axes", look: Look, leg: int) -> None:
    _shade_support(axes, look, leg)
    first = look.of(look.numbers[0], leg)
    axes.plot(look.clock(first), first["force_desired"], label="desired", **DESIRED_LINE)
    _cycles(axes, look, leg, lambda rows: rows["force"])
    label(axes, look.name(leg) or "contact force", CLOCK, "force, N")


def _error_x(axes: "Axes", look: Look, leg: int) -> None:
    _shade_support(axes, look, leg)
    _cycles(axes, look, leg, lambda rows: 1e3 * (rows["x"] - rows["x_desired"]))
    label(axes, look.name(leg) or "error along x", CLOCK, "x - desired, mm")


def _error_y(axes: "Axes", look: Look, leg: int) -> None:
    _shade_support(axes, look, leg)
    _cycles(axes, look, leg, lambda rows: 1e3 * (rows["y"] - rows["y_desired"]))
    label(axes, look.name(leg) or "error along y", CLOCK, "y - desired, mm")


PANELS: dict[str, tuple[Callable[["Axes", Look, int], None], str]] = {
    "foot": (_foot, "Paths of the feet in the frames of their hips, y down"),
    "force": (_force, "Contact force"),
    "error_x": (_error_x, "Error of the foot along x, forward"),
    "error_y": (_error_y, "Error of the foot along y, down; in support against the depression for the desired force"),
}


def moves(look: Look) -> bool:
    """Whether the feet move along x; one that only presses has neither path nor error there."""
    return any(float(np.ptp(look.trace[name])) > 1e-6 for name in ("x", "x_desired"))


def _flip_foot(axes: "Axes") -> None:
    if not axes.yaxis_inverted():
        axes.invert_yaxis()


def tracking(look: Look) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    names = list(PANELS) if moves(look) else ["force", "error_y"]
    if look.legs == 1:
        figure, axes = new_figure(-(-len(names) // 2), 2, 2.7)
        for ax, name in zip(axes, names, strict=True):
            PANELS[name][0](ax, look, 1)
        if "foot" in names:
            _flip_foot(axes[0])
        legend_below(figure, axes[names.index("force")])
        shaded = "" if bool((look.trace["phase"] == "support").all()) else f" {SHADED}"
        return [Drawing("tracking", figure, f"Force and errors over the chosen cycles.{shaded}")]
    return [_of_all_legs(look, name) for name in names]


def _of_all_legs(look: Look, name: str) -> Drawing:
    draw, caption = PANELS[name]
    figure, axes = new_figure(2, 2, 1.8 if name == "foot" else 2.3, sharex=True, sharey=True)
    for leg, ax in enumerate(axes, 1):
        draw(ax, look, leg)
        ax.label_outer()
    if name == "foot":
        _flip_foot(axes[0])
    legend_below(figure, axes[0])
    return Drawing(name, figure, f"{caption}." if name == "foot" else f"{caption}. {SHADED}")


def torques(look: Look) -> Drawing:
    """Feedback and feedforward of both joints in the last of the chosen cycles."""
    number = look.numbers[-1]
    names = ("joint 1, hip", "joint 2, knee") if look.has_joints else ("along x", "along y")
    unit = "torque, N m" if look.has_joints else "force, N"
    figure, axes = new_figure(look.legs, 2, 2.6 if look.legs == 1 else 1.7, sharex=True)
    learns = bool(look.trace[["tau_feedforward_1", "tau_feedforward_2"]].to_numpy().any())
    for index, ax in enumerate(axes):
        leg, joint = index // 2 + 1, index % 2 + 1
        rows = look.of(number, leg)
        _shade_support(ax, look, leg)
        ax.plot(look.clock(rows), rows[f"tau_feedback_{joint}"], color=FEEDBACK, label="feedback")
        if learns:
            ax.plot(look.clock(rows), rows[f"tau_feedforward_{joint}"], "--", color=FEEDFORWARD, label="feedforward")
        name = look.name(leg)
        title = f"{name}: {names[joint - 1]}" if name else names[joint - 1]
        label(ax, title, CLOCK if leg == look.legs else "", unit)
        ax.set_xlim(0, look.span)
    legend_below(figure, axes[0])
    shaded = "" if bool((look.trace["phase"] == "support").all()) else f" {SHADED}"
    what = "Feedback and feedforward" if learns else "Feedback"
    return Drawing("torques", figure, f"{what} in cycle {number}; the plant gets their sum.{shaded}")


def body(look: Look) -> Drawing:
    """Height, pitch, roll and stability margin of the body over the chosen cycles."""
    panels = (
        ("height", 1e3, "height of the body", "height, mm"),
        ("stability_margin", 1e3, "stability margin, nearest edge", "margin, mm"),
        ("pitch", 1e3, "pitch, nose down", "pitch, mrad"),
        ("roll", 1e3, "roll, right side down", "roll, mrad"),
    )
    figure, axes = new_figure(2, 2, 2.3, sharex=True)
    for ax, (name, factor, title, unit) in zip(axes, panels, strict=True):
        for index, number in enumerate(look.numbers):
            rows = look.of_body(number)
            ax.plot(look.clock(rows), factor * rows[name], label=f"cycle {number}", **mark(index))
        label(ax, title, CLOCK if ax in axes[2:] else "", unit)
        ax.set_xlim(0, look.span)
    legend_below(figure, axes[0])
    caption = "The body over the chosen cycles; the margin is that over the planned support polygon."
    return Drawing("body", figure, caption)


def _end_of_body(look: Look) -> "Figure":
    assert look.body is not None
    rows = look.body.tail(LAST_STEPS)
    figure, axes = new_figure(2, 2, 2.4, sharex=True)
    for index, name in enumerate(("pitch", "roll")):
        axes[0].plot(rows["time"], 1e3 * rows[name], label=name, **mark(index))
    axes[1].plot(rows["time"], 1e3 * rows["height"], color=SERIES[1])
    for leg in range(1, look.legs + 1):
        own = look.trace[look.trace["leg"] == leg].tail(LAST_STEPS)
        axes[2].plot(own["time"], own["force"], label=f"leg {leg}", **mark(leg - 1))
    axes[3].plot(rows["time"], 1e3 * rows["stability_margin"], color=SERIES[1])
    label(axes[0], "tilt of the body", "", "angle, mrad")
    label(axes[1], "height of the body", "", "height, mm")
    label(axes[2], "contact forces", "time, s", "force, N")
    label(axes[3], "stability margin, nearest edge", "time, s", "margin, mm")
    legend_above(axes[0])
    legend_above(axes[2])
    return figure


def _end_of_legs(look: Look) -> "Figure":
    figure, axes = new_figure(1, 2, 2.6)
    speeds, unit = (("dq1", "dq2"), "joint speed, rad/s") if look.has_joints else (("vx", "vy"), "speed, m/s")
    for leg in range(1, look.legs + 1):
        own = look.trace[look.trace["leg"] == leg].tail(LAST_STEPS)
        whose = f"leg {leg} " if look.legs > 1 else ""
        for index, name in enumerate(speeds):
            part = f"joint {index + 1}" if look.has_joints else "along " + "xy"[index]
            axes[0].plot(own["time"], own[name], label=whose + part, **mark(2 * (leg - 1) + index))
        axes[1].plot(own["time"], own["force"], label=whose + "force", **mark(leg - 1))
    label(axes[0], "speed", "time, s", unit)
    label(axes[1], "contact force", "time, s", "force, N")
    for ax in axes:
        if look.legs == 1:
            legend_above(ax)
        else:
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2)
    return figure


def end(look: Look, status: str) -> Drawing:
    """The last steps of a run that fell or diverged."""
    figure = _end_of_body(look) if look.body is not None and status == "fell" else _end_of_legs(look)
    steps = min(LAST_STEPS, len(look.trace) // look.legs)
    return Drawing("end", figure, f"The last {steps} recorded steps before the run stopped.")
