"""Figures of one run over the time of a cycle: foot path, errors, force, torques and body."""

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.report.figure_data import DESIRED_LINE, SUPPORT, FigureData, legend_below, widen
from cmacexp.report.page import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

JOINTS = {2: ("joint 1, hip", "joint 2, knee"), 3: ("hip", "thigh", "knee")}
"""Names of joints, by their number."""
CLOCK = "time in the cycle, s"
SHADED = "The planned support is shaded."


def _shade_support(axes: "Axes", data: FigureData, leg: int) -> None:
    rows = data.select(data.cycles[0], leg)
    support = np.asarray(rows["phase"] == "support")
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    clock = np.append(data.time_in_cycle(rows), data.cycle_time)
    if not support.all():
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            axes.axvspan(clock[start], clock[end], color=SUPPORT, zorder=0, linewidth=0)


def _describe_shade(data: FigureData) -> str:
    return "" if bool((data.trace["phase"] == "support").all()) else f" {SHADED}"


def _plot(axes: "Axes", data: FigureData, leg: int, value: Callable[["pd.DataFrame"], "pd.Series[float]"]) -> None:
    for index, cycle in enumerate(data.cycles):
        rows = data.select(cycle, leg)
        axes.plot(data.time_in_cycle(rows), value(rows), **data.line(index))
    axes.set_xlim(0, data.duration)


def _foot(axes: "Axes", data: FigureData, leg: int) -> None:
    first = data.select(data.cycles[0], leg)
    axes.plot(1e3 * first["x_desired"], 1e3 * first["y_desired"], label="desired", **DESIRED_LINE)
    for index, cycle in enumerate(data.cycles):
        rows = data.select(cycle, leg)
        axes.plot(1e3 * rows["x"], 1e3 * rows["y"], **data.line(index))
    label(axes, data.leg_name(leg) or "foot path", "x forward, mm", "y down, mm")
    axes.set_aspect("equal", adjustable="datalim" if data.legs == 1 else "box")


def _force(axes: "Axes", data: FigureData, leg: int) -> None:
    _shade_support(axes, data, leg)
    first = data.select(data.cycles[0], leg)
    axes.plot(data.time_in_cycle(first), first["force_desired"], label="desired", **DESIRED_LINE)
    _plot(axes, data, leg, lambda rows: rows["force"])
    label(axes, data.leg_name(leg) or "contact force", CLOCK, "force, N")


def _error(axes: "Axes", data: FigureData, leg: int, axis: str) -> None:
    _shade_support(axes, data, leg)
    _plot(axes, data, leg, lambda rows: 1e3 * (rows[axis] - rows[f"{axis}_desired"]))
    label(axes, data.leg_name(leg) or f"error along {axis}", CLOCK, f"{axis} - desired, mm")


PANELS: dict[str, tuple[Callable[["Axes", FigureData, int], None], str]] = {
    "foot": (_foot, "Paths of the feet in the frames of their hips, y down"),
    "force": (_force, "Contact force"),
    "error_x": (partial(_error, axis="x"), "Error of the foot along x, forward"),
    "error_y": (
        partial(_error, axis="y"),
        "Error of the foot along y, down; in support relative to the depression at the desired force",
    ),
    "error_z": (partial(_error, axis="z"), "Error of the foot along z, to the left"),
}


def moves_along_x(data: FigureData) -> bool:
    """Whether the feet move along x; a foot that only presses has neither path nor error there."""
    return any(float(np.ptp(data.trace[name])) > 1e-6 for name in ("x", "x_desired"))


def _flip_foot(axes: "Axes") -> None:
    if not axes.yaxis_inverted():
        axes.invert_yaxis()


def draw_tracking(data: FigureData) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    names = (
        ["foot", "force", *(f"error_{axis}" for axis in data.axes)] if moves_along_x(data) else ["force", "error_y"]
    )
    if data.legs == 1:
        figure, axes = new_figure(-(-len(names) // 2), 2, 2.7)
        for ax, name in zip(axes, names, strict=True):
            PANELS[name][0](ax, data, 1)
        if "foot" in names:
            _flip_foot(axes[0])
        legend_below(figure, axes[names.index("force")])
        return [Drawing("tracking", figure, f"Force and errors over the chosen cycles.{_describe_shade(data)}")]
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
    """Feedback and feedforward of all joints in the last chosen cycle; of a robot J^T F_d apart, as in metrics."""
    cycle = data.cycles[-1]
    joints = range(1, len(data.axes) + 1)
    names = JOINTS[len(data.axes)] if data.has_joints else ("along x", "along y")
    unit = "torque, N m" if data.has_joints else "force, N"
    figure, axes = new_figure(data.legs, len(joints), 2.6 if data.legs == 1 else 1.7, sharex=True)
    learns = bool(data.trace[[f"tau_feedforward_{joint}" for joint in joints]].to_numpy().any())
    for ax, (leg, joint) in zip(axes, product(range(1, data.legs + 1), joints), strict=True):
        rows = data.select(cycle, leg)
        _shade_support(ax, data, leg)
        time, feedback = data.time_in_cycle(rows), rows[f"tau_feedback_{joint}"]
        if data.in_space:
            ax.plot(time, rows[f"tau_force_{joint}"], label="for the desired force", **DESIRED_LINE)
            feedback = feedback - rows[f"tau_force_{joint}"]
        ax.plot(time, feedback, color=FEEDBACK, label="feedback")
        if learns:
            ax.plot(time, rows[f"tau_feedforward_{joint}"], "--", color=FEEDFORWARD, label="feedforward")
        name = f"{data.leg_name(leg)}: " if data.legs > 1 else ""
        if data.in_space:  # three beside each other are narrow
            name = f"{leg} {LEG_NAMES[leg - 1]}: "
        label(ax, name + names[joint - 1], CLOCK if leg == data.legs else "", unit)
        ax.set_xlim(0, data.duration)
    legend_below(figure, axes[0])
    torques = "Feedback and feedforward" if learns else "Feedback"
    known = " and the torque of the desired force, which the plan knows," if data.in_space else ""
    caption = f"{torques}{known} in cycle {cycle}; the plant receives their sum.{_describe_shade(data)}"
    return Drawing("torques", figure, caption)


def draw_body(data: FigureData) -> Drawing:
    """Height, pitch, roll and true stability margin of the body over the chosen cycles."""
    assert data.body is not None
    # A run of an earlier version has the planned margin alone.
    true = "true_" if "true_stability_margin" in data.body.columns else ""
    panels = (
        ("height", 1e3, "height of the body", "height, mm"),
        (f"{true}stability_margin", 1e3, "stability margin, nearest edge", "margin, mm"),
        ("pitch", 1e3, "pitch, nose down", "pitch, mrad"),
        ("roll", 1e3, "roll, right side down", "roll, mrad"),
    )
    figure, axes = new_figure(2, 2, 2.3, sharex=True)
    for ax, (name, factor, title, unit) in zip(axes, panels, strict=True):
        for index, cycle in enumerate(data.cycles):
            rows = data.select_body(cycle)
            ax.plot(data.time_in_cycle(rows), factor * rows[name], **data.line(index))
        label(ax, title, CLOCK if ax in axes[2:] else "", unit)
        ax.set_xlim(0, data.duration)
        widen(ax, factor * data.body[name], name.endswith("stability_margin"))
    rows = data.select_body(data.cycles[0])
    axes[1].plot(data.time_in_cycle(rows), 1e3 * rows["stability_margin"], label="planned", **DESIRED_LINE)
    legend_below(figure, axes[1])
    caption = "The body over the chosen cycles; its margin is among the feet that carry load, tilt included."
    return Drawing("body", figure, caption)
