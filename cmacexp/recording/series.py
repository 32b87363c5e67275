"""Time series of a run: gait, forces, tracking errors, torques, posture, stability."""

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.typing import Array

Line = tuple[str, Array, tuple[int, ...]]
"""Name, values (steps,), colour."""
SERIES = "series"
"""The entity of all plots: as one it has the times of the steps once."""
AXES = {
    "x": ("x forward", palette.ACTUAL),
    "y": ("y down", palette.FIRST_CYCLE),
    "z": ("z left", palette.LAST_CYCLE),
}


def _force_lines(leg: LegView) -> list[Line]:
    lines: list[Line] = [
        ("desired", leg["force_desired"], palette.DESIRED),
        ("actual", leg["force"], palette.ACTUAL),
    ]
    if not np.array_equal(leg["force"], leg["force_measured"]):
        lines.insert(1, ("measured", leg["force_measured"], palette.MEASURED))
    return lines


def _leg_lines(leg: LegView) -> dict[str, list[Line]]:
    error = {name: 1e3 * (leg[name] - leg[f"{name}_desired"]) for name in leg.axes}
    lines: dict[str, list[Line]] = {
        "force": _force_lines(leg),
        "error": [(AXES[axis][0], values, AXES[axis][1]) for axis, values in error.items()],
    }
    for joint in range(1, len(leg.axes) + 1):
        lines[f"torque_{joint}"] = _torque_lines(leg, joint)
    return lines


def _torque_lines(leg: LegView, joint: int) -> list[Line]:
    """Feedback and feedforward; of a robot J^T F_d, which the plan knows, apart from the feedback."""
    feedback, feedforward = leg[f"tau_feedback_{joint}"], leg[f"tau_feedforward_{joint}"]
    lines: list[Line] = []
    if leg.chain is not None:
        known = leg[f"tau_force_{joint}"]
        lines, feedback = [("for desired force", known, palette.DESIRED)], feedback - known
    return [
        *lines,
        ("feedback", feedback, palette.FEEDBACK),
        ("feedforward", feedforward, palette.FEEDFORWARD),
    ]


def _margin_lines(body: dict[str, Array]) -> list[Line]:
    planned = ("planned, nearest edge", 1e3 * body["stability_margin"], palette.DESIRED)
    if "true_stability_margin" not in body:  # of an earlier version
        return [planned]
    return [
        planned,
        ("true, nearest edge", 1e3 * body["true_stability_margin"], palette.LAST_CYCLE),
        ("true, front", 1e3 * body["true_margin_front"], palette.ACTUAL),
        ("true, rear", 1e3 * body["true_margin_rear"], palette.FIRST_CYCLE),
    ]


def _body_lines(body: dict[str, Array]) -> dict[str, list[Line]]:
    return {
        "tilt": [
            ("pitch, nose down", 1e3 * body["pitch"], palette.ACTUAL),
            ("roll, right side down", 1e3 * body["roll"], palette.FIRST_CYCLE),
        ],
        "height": [("height", 1e3 * body["height"], palette.LAST_CYCLE)],
        "margins": _margin_lines(body),
    }


def collect_series(view: RunView) -> dict[str, list[Line]]:
    """All time series by the name of their plot, ``leg_1/force`` or ``body/tilt``; N, mm, N m, mrad."""
    found = {f"leg_{leg.number}/{name}": lines for leg in view.legs for name, lines in _leg_lines(leg).items()}
    if view.walks:
        found |= {f"body/{name}": lines for name, lines in _body_lines(view.body).items()}
    return found


def component(path: str) -> str:
    """The component of :data:`SERIES` that holds the lines of the plot ``leg_1/force``."""
    return path.replace("/", ":")


def _column(name: str, values: NDArray[np.float32]) -> rr.ComponentColumn:
    """A column of plain numbers; ``rr.AnyValues.columns`` makes the same, but looks at each number."""
    owner = name.partition(":")[0]
    numbers = pa.array(values)
    return rr.ComponentColumn(rr.ComponentDescriptor(name, archetype=owner), rr.AnyBatchValue(name, numbers))


def gait_path(leg: LegView) -> str:
    """The entity of a leg in the gait diagram."""
    return f"gait/{leg.number}_{leg.name.replace(' ', '_')}"


def _log_gait(entities: Entities, view: RunView, leg: LegView) -> None:
    """A bar at the height of the leg's number while it is planned to support (Fig. 14); only changes are written."""
    bar = np.where(leg.support, float(leg.number), np.nan)
    rows = np.union1d(np.flatnonzero(np.diff(leg.support, prepend=~leg.support[:1])), [len(bar) - 1])
    style = rr.SeriesLines(
        names=f"{leg.number} {leg.name}", colors=palette.SUPPORT, widths=9.0, interpolation_mode="StepAfter"
    )
    entities.log(gait_path(leg), style)
    entities.send_columns(gait_path(leg), rr.Scalars.columns(scalars=bar[rows]), rows=rows)


def log_series(entities: Entities, view: RunView) -> None:
    """All time series, in single precision, and the gait diagram."""
    columns = []
    for path, lines in collect_series(view).items():
        values = np.stack([line[1] for line in lines], axis=1).astype(np.float32)
        columns.append(_column(component(path), values.ravel()))
    entities.send_columns(SERIES, columns)
    for leg in view.legs:
        _log_gait(entities, view, leg)
