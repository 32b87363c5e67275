"""What a run shows over time: forces, tracking errors, torques, posture, stability, gait, and the moments of it."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import rerun as rr

from cmacexp.metrics.drift import format_event
from cmacexp.recording import palette
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

Line = tuple[str, Array, tuple[int, ...]]
"""Name, values (steps,), colour."""
SERIES, EVENTS = "series", "events"
"""The entity of all plots, which as one has the times of the steps once; that of the moments."""
Event = tuple[int, str]
"""A moment that is worth a look: its step of the view, and what happens."""
AXES = {
    "x": ("x forward", palette.ACTUAL),
    "y": ("y down", palette.FIRST_CYCLE),
    "z": ("z left", palette.LAST_CYCLE),
}
"""Names and colours of the axes in which a foot moves."""
BODY_PLOTS = {
    "tilt": {
        "pitch": ("pitch, nose down", palette.ACTUAL),
        "roll": ("roll, right side down", palette.FIRST_CYCLE),
    },
    "height": {"height": ("height", palette.LAST_CYCLE)},
    "margins": {
        "stability_margin": ("planned, nearest edge", palette.DESIRED),
        "true_stability_margin": ("true, nearest edge", palette.LAST_CYCLE),
        "true_margin_front": ("true, front", palette.ACTUAL),
        "true_margin_rear": ("true, rear", palette.FIRST_CYCLE),
    },
}
"""Plots of the body: the name and the colour of each signal; in mm or mrad."""
TORQUES = {
    "for the desired force": palette.DESIRED,
    "feedback": palette.FEEDBACK,
    "feedforward": palette.FEEDFORWARD,
}
"""Colours of the parts of a torque."""


def _list_leg_lines(view: RunView, leg: int) -> dict[str, list[Line]]:
    """The plots of a leg, by its index."""

    def signal(name: str) -> Array:
        return view.trace[name][:, leg]

    axes = view.trace.axes
    force: list[Line] = [
        ("desired", signal("force_desired"), palette.DESIRED),
        ("actual", signal("force"), palette.ACTUAL),
    ]
    if not np.array_equal(signal("force"), signal("force_measured")):
        force.insert(1, ("measured", signal("force_measured"), palette.MEASURED))
    error: list[Line] = [
        (AXES[axis][0], 1e3 * (signal(axis) - signal(f"{axis}_desired")), AXES[axis][1]) for axis in axes
    ]
    lines = {"force": force, "error": error}
    for joint in range(1, len(axes) + 1):
        torques = view.torques(joint)
        lines[f"torque_{joint}"] = [(name, torques[name][:, leg], TORQUES[name]) for name in torques]
    return lines


def collect_series(view: RunView) -> dict[str, list[Line]]:
    """All time series by the name of their plot, ``leg_1/force`` or ``body/tilt``; N, mm, N m, mrad.

    A signal of the body that an earlier version did not write has no line.
    """
    found = {
        f"leg_{leg + 1}/{name}": lines
        for leg in range(view.trace.legs)
        for name, lines in _list_leg_lines(view, leg).items()
    }
    for plot, signals in BODY_PLOTS.items() if view.walks else ():
        shown = {name: style for name, style in signals.items() if name in view.body}
        found[f"body/{plot}"] = [(title, 1e3 * view.body[name], colour) for name, (title, colour) in shown.items()]
    return found


def name_component(path: str) -> str:
    """The component of :data:`SERIES` that holds the lines of the plot ``leg_1/force``."""
    return path.replace("/", ":")


def _log_gait(entities: Entities, view: RunView) -> None:
    """Bars at the height of each leg's number while it is planned to support (Fig. 14); only changes are written."""
    for number, (name, support) in enumerate(zip(view.names, view.trace.support.T, strict=True), start=1):
        path, bar = f"gait/{number}_{name.replace(' ', '_')}", np.where(support, float(number), np.nan)
        rows = np.union1d(np.flatnonzero(np.diff(support, prepend=~support[:1])), [len(bar) - 1])
        style = rr.SeriesLines(
            names=f"{number} {name}", colors=palette.SUPPORT, widths=9.0, interpolation_mode="StepAfter"
        )
        entities.send_columns(path, rr.Scalars.columns(scalars=bar[rows]), rows, style)


def log_series(entities: Entities, view: RunView) -> None:
    """All time series, in single precision, and the gait diagram."""
    columns = []
    for path, lines in collect_series(view).items():
        values = pa.array(np.stack([line[1] for line in lines], axis=1).astype(np.float32).ravel())
        name, owner = name_component(path), path.partition("/")[0]
        # rr.AnyValues.columns makes the same, but looks at each number.
        columns.append(
            rr.ComponentColumn(rr.ComponentDescriptor(name, archetype=owner), rr.AnyBatchValue(name, values))
        )
    entities.send_columns(SERIES, columns)
    _log_gait(entities, view)


def _find_contacts(view: RunView) -> Iterator[Event]:
    """From each planned lift-off on the first step without force; from each planned touch-down on the first with."""
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
        for event in view.run.manifest.get("guard", ())
        if view.step[0] <= event["step"] <= view.step[-1]
    ]
    return sorted([*cycles, *_find_contacts(view), *guard])


def log_events(entities: Entities, view: RunView) -> None:
    """The moments as a log, each with its time, which the viewer goes to when it is clicked."""
    found = find_events(view)
    texts = [f"{view.time[row]:.3f} s  {text}" for row, text in found]
    entities.send_columns(EVENTS, rr.TextLog.columns(text=texts), rows=np.array([row for row, _ in found]))
