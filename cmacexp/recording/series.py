"""The plots of a run over time: forces, tracking errors, torques, posture, stability and gait; and its events."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cmacexp.metrics.drift import format_event
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

SERIES = "series"
"""Entity of all plots; a single one stores the times of the steps only once."""
EVENTS = "events"
"""Entity of the log of events."""
GAIT = "gait/support"
"""Path of the gait diagram, which shows the planned support of each foot (Lin & Song 1997, Fig. 14)."""
Event = tuple[int, str]
"""An event: index of its step in the view, and a text."""
AXES = {
    "x": ("x forward", palette.ACTUAL),
    "y": ("y down", palette.FIRST_CYCLE),
    "z": ("z left", palette.LAST_CYCLE),
}
"""Name and colour of each axis of foot positions."""
JOINTS = {2: ("hip", "knee"), 3: ("hip", "thigh", "knee")}
"""Names of the joints of a leg, by their count."""
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
"""Plots of the body: title, unit, and name and colour of each signal."""
TORQUES = {
    "for the desired force": palette.DESIRED,
    "feedback": palette.FEEDBACK,
    "feedforward": palette.FEEDFORWARD,
}
"""Colours of the components of a torque."""


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
    """Unit, after the name of the quantity if the title lacks it."""
    leg: int
    """Number of the leg, from 1; 0: the body."""
    lines: list[Line]

    def find_range(self) -> tuple[float, float] | None:
        """Find the smallest and largest finite value; None if there is none."""
        values = np.concatenate([line.values for line in self.lines])
        finite = values[np.isfinite(values)]
        return (float(finite.min()), float(finite.max())) if finite.size else None


def _list_leg_plots(view: RunView, leg: int) -> dict[str, Plot]:
    """List the plots of leg number ``leg``, from 1, by name; titles contain the leg if there are several."""

    def signal(name: str) -> Array:
        return view.trace[name][:, leg - 1]

    axes = view.trace.axes
    prefix = f"{leg} {view.names[leg - 1]}: " if view.walks else ""
    force = [
        Line("desired", signal("force_desired"), palette.DESIRED),
        Line("actual", signal("force"), palette.ACTUAL),
    ]
    if not np.array_equal(signal("force"), signal("force_measured")):
        force.insert(1, Line("measured", signal("force_measured"), palette.MEASURED))
    error = [Line(AXES[axis][0], 1e3 * (signal(axis) - signal(f"{axis}_desired")), AXES[axis][1]) for axis in axes]
    plots = {
        "force": Plot(f"{prefix}contact force", "N", leg, force),
        "error": Plot(f"{prefix}actual minus desired", "mm", leg, error),
    }
    for joint, name in enumerate(JOINTS[len(axes)] if view.has_joints else ("along x", "along y"), 1):
        lines = [Line(label, values[:, leg - 1], TORQUES[label]) for label, values in view.torques(joint).items()]
        plots[f"torque_{joint}"] = Plot(
            f"{prefix}{name}", "torque, N m" if view.has_joints else "force, N", leg, lines
        )
    return plots


def list_plots(view: RunView) -> dict[str, Plot]:
    """List all plots of a run by path, such as ``leg_1/force`` or ``body/tilt``; in N, mm, N m and mrad.

    Signals of the body that a run of an earlier version lacks have no line; a plot without lines is omitted.
    """
    plots = {
        f"leg_{leg}/{name}": plot
        for leg in range(1, view.trace.legs + 1)
        for name, plot in _list_leg_plots(view, leg).items()
    }
    if not view.walks:
        return plots
    support = [
        Line(f"{number} {name}", np.where(down, float(number), np.nan), palette.SUPPORT)
        for number, (name, down) in enumerate(zip(view.names, view.trace.support.T, strict=True), 1)
    ]
    plots[GAIT] = Plot(f"support of {', '.join(line.name for line in support)}", "number of the leg", 0, support)
    for name, (title, unit, signals) in BODY_PLOTS.items():
        lines = [
            Line(label, 1e3 * view.body[signal], colour)
            for signal, (label, colour) in signals.items()
            if signal in view.body
        ]
        if lines:
            plots[f"body/{name}"] = Plot(title, unit, 0, lines)
    return plots


def name_component(path: str) -> str:
    """Return the component of :data:`SERIES` with the lines of a plot such as ``leg_1/force``."""
    return path.replace("/", ":")


def _find_contacts(view: RunView) -> Iterator[Event]:
    """Yield the start and end of each contact, leg by leg.

    A contact ends in the first step without force after a planned lift-off, and begins in the first step with force
    after a planned touch-down.
    """
    for leg, (support, force) in enumerate(zip(view.trace.support.T, view.trace["force"].T, strict=True), start=1):
        foot = f"foot {leg}" if view.walks else "the foot"
        for start in np.flatnonzero(np.diff(support)) + 1:
            action, reached = ("touches down", force > 0.0) if support[start] else ("lifts", force == 0.0)
            row = int(start + np.argmax(reached[start:]))  # ``start`` if it is never reached
            yield row, f"{foot} {action}"


def find_events(view: RunView) -> list[Event]:
    """List the events of a run in order: starts of cycles, lift-offs and touch-downs, and events of the guard."""
    starts = np.flatnonzero(np.diff(view.cycle, prepend=view.cycle[0] - 1))
    cycles = [(int(row), f"cycle {view.cycle[row]} begins") for row in starts]
    guard = [
        (int(np.searchsorted(view.step, event["step"])), f"guard of learning: {format_event(event)}")
        for event in view.run.manifest["guard"]
        if view.step[0] <= event["step"] <= view.step[-1]
    ]
    return sorted([*cycles, *_find_contacts(view), *guard])
