"""What a run shows over time: forces, tracking errors, torques, posture, stability, gait, and the moments of it."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cmacexp.metrics.drift import format_event
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

SERIES, EVENTS = "series", "events"
"""The entity of all plots, which as one has the times of the steps once; that of the moments."""
GAIT = "gait/support"
"""The plot of which foot is planned to support when (Lin & Song 1997, Fig. 14)."""
Event = tuple[int, str]
"""A moment that is worth a look: its step of the view, and what happens."""
AXES = {
    "x": ("x forward", palette.ACTUAL),
    "y": ("y down", palette.FIRST_CYCLE),
    "z": ("z left", palette.LAST_CYCLE),
}
"""Names and colours of the axes in which a foot moves."""
JOINTS = {2: ("hip", "knee"), 3: ("hip", "thigh", "knee")}
"""Names of the joints of a leg, by their number."""
BODY_PLOTS = {
    "tilt": (
        "tilt of the body",
        "mrad",
        {
            "pitch": ("pitch, nose down", palette.ACTUAL),
            "roll": ("roll, right side down", palette.FIRST_CYCLE),
        },
    ),
    "height": ("height of the body", "mm", {"height": ("height", palette.LAST_CYCLE)}),
    "margins": (
        "stability margins, planned and true",
        "mm",
        {
            "stability_margin": ("planned, nearest edge", palette.DESIRED),
            "true_stability_margin": ("true, nearest edge", palette.LAST_CYCLE),
            "true_margin_front": ("true, front", palette.ACTUAL),
            "true_margin_rear": ("true, rear", palette.FIRST_CYCLE),
        },
    ),
}
"""Plots of the body: title, unit, and the name and the colour of each signal."""
TORQUES = {
    "for the desired force": palette.DESIRED,
    "feedback": palette.FEEDBACK,
    "feedforward": palette.FEEDFORWARD,
}
"""Colours of the parts of a torque."""


class Line(NamedTuple):
    """A signal over time."""

    name: str
    values: Array
    """(steps,), in the unit of its plot."""
    colour: tuple[int, ...]


class Plot(NamedTuple):
    """Lines that share an axis."""

    title: str
    unit: str
    """Unit that follows the name of the quantity, where the title lacks it."""
    leg: int
    """Number of the leg, from 1; 0: the body."""
    lines: list[Line]

    def find_range(self) -> tuple[float, float] | None:
        """Least and largest value; None if none is finite."""
        values = np.concatenate([line.values for line in self.lines])
        finite = values[np.isfinite(values)]
        return (float(finite.min()), float(finite.max())) if finite.size else None


def _list_leg_plots(view: RunView, leg: int) -> dict[str, Plot]:
    """The plots of a leg, by its number; those of several begin with it."""

    def signal(name: str) -> Array:
        return view.trace[name][:, leg - 1]

    axes, who = view.trace.axes, f"{leg} {view.names[leg - 1]}: " if view.walks else ""
    force = [
        Line("desired", signal("force_desired"), palette.DESIRED),
        Line("actual", signal("force"), palette.ACTUAL),
    ]
    if not np.array_equal(signal("force"), signal("force_measured")):
        force.insert(1, Line("measured", signal("force_measured"), palette.MEASURED))
    error = [Line(AXES[axis][0], 1e3 * (signal(axis) - signal(f"{axis}_desired")), AXES[axis][1]) for axis in axes]
    plots = {
        "force": Plot(f"{who}contact force", "N", leg, force),
        "error": Plot(f"{who}actual minus desired", "mm", leg, error),
    }
    for joint, name in enumerate(JOINTS[len(axes)] if view.has_joints else ("along x", "along y"), 1):
        lines = [Line(part, values[:, leg - 1], TORQUES[part]) for part, values in view.torques(joint).items()]
        plots[f"torque_{joint}"] = Plot(f"{who}{name}", "torque, N m" if view.has_joints else "force, N", leg, lines)
    return plots


def list_plots(view: RunView) -> dict[str, Plot]:
    """All that a run shows over time, by ``leg_1/force`` or ``body/tilt``; N, mm, N m, mrad.

    A signal of the body that an earlier version did not write has no line, and a plot of such signals is left out.
    """
    found = {
        f"leg_{leg}/{name}": plot
        for leg in range(1, view.trace.legs + 1)
        for name, plot in _list_leg_plots(view, leg).items()
    }
    if not view.walks:
        return found
    support = [
        Line(f"{number} {name}", np.where(down, float(number), np.nan), palette.SUPPORT)
        for number, (name, down) in enumerate(zip(view.names, view.trace.support.T, strict=True), 1)
    ]
    found[GAIT] = Plot(f"support of {', '.join(line.name for line in support)}", "number of the leg", 0, support)
    for name, (title, unit, signals) in BODY_PLOTS.items():
        lines = [
            Line(shown, 1e3 * view.body[signal], colour)
            for signal, (shown, colour) in signals.items()
            if signal in view.body
        ]
        if lines:
            found[f"body/{name}"] = Plot(title, unit, 0, lines)
    return found


def name_component(path: str) -> str:
    """The component of :data:`SERIES` that holds the lines of the plot ``leg_1/force``."""
    return path.replace("/", ":")


def _find_contacts(view: RunView) -> Iterator[Event]:
    """Contacts end on the first step without force from a planned lift-off on, and begin on the first with it."""
    for leg, (support, force) in enumerate(zip(view.trace.support.T, view.trace["force"].T, strict=True), start=1):
        who = f"foot {leg}" if view.walks else "the foot"
        for start in np.flatnonzero(np.diff(support)) + 1:
            does, reached = ("touches down", force > 0.0) if support[start] else ("lifts", force == 0.0)
            row = int(start + np.argmax(reached[start:]))  # ``start`` if none is
            yield row, f"{who} {does}"


def find_events(view: RunView) -> list[Event]:
    """The moments of a run in their order; of a machine that never lifts a foot, none but its cycles."""
    starts = np.flatnonzero(np.diff(view.cycle, prepend=view.cycle[0] - 1))
    cycles = [(int(row), f"cycle {view.cycle[row]} begins") for row in starts]
    guard = [
        (int(np.searchsorted(view.step, event["step"])), f"guard of learning: {format_event(event)}")
        for event in view.run.manifest["guard"]
        if view.step[0] <= event["step"] <= view.step[-1]
    ]
    return sorted([*cycles, *_find_contacts(view), *guard])
