"""Time series of a run: gait, forces, tracking errors, torques, posture, stability."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from cmacexp import palette
from cmacexp.arrays import Array
from cmacexp.recording.view import LegView, RunView

Line = tuple[str, Array, tuple[int, ...]]


def _log_lines(recording: rr.RecordingStream, view: RunView, path: str, lines: Sequence[Line]) -> None:
    """Several lines in one entity: (name, values, colour) each."""
    names, values, colours = zip(*lines, strict=True)
    style = rr.SeriesLines(names=list(names), colors=list(colours), widths=[1.5] * len(lines))
    recording.log(path, style, static=True)
    recording.send_columns(path, view.indexes, rr.Scalars.columns(scalars=np.stack(values, axis=1)))


def _force_lines(leg: LegView) -> list[Line]:
    lines: list[Line] = [
        ("desired", leg["force_desired"], palette.DESIRED),
        ("actual", leg["force"], palette.ACTUAL),
    ]
    if not np.array_equal(leg["force"], leg["force_measured"]):
        lines.insert(1, ("measured", leg["force_measured"], palette.MEASURED))
    return lines


def _log_gait(recording: rr.RecordingStream, view: RunView, leg: LegView) -> None:
    """Support and transfer phases as a lane of the gait diagram (Fig. 14); only changes are written."""
    path = f"gait/{leg.number}_{leg.name.replace(' ', '_')}"
    style = rr.StateConfiguration(
        values=["support", "transfer"], labels=["support", "transfer"], colors=[palette.SUPPORT, palette.TRANSFER]
    )
    recording.log(path, style, static=True)
    changes = np.flatnonzero(np.diff(leg.support, prepend=~leg.support[:1]))
    indexes = [rr.TimeColumn("time", duration=view.time[changes]), rr.TimeColumn("step", sequence=view.step[changes])]
    states = np.where(leg.support[changes], "support", "transfer").tolist()
    recording.send_columns(path, indexes, rr.StateChange.columns(state=states))


def _log_leg(recording: rr.RecordingStream, view: RunView, leg: LegView) -> None:
    path = f"series/leg_{leg.number}"
    _log_lines(recording, view, f"{path}/force", _force_lines(leg))
    error = {name: 1e3 * (leg[name] - leg[f"{name}_desired"]) for name in ("x", "y")}
    lines: list[Line] = [("x forward", error["x"], palette.ACTUAL), ("y down", error["y"], palette.FIRST_CYCLE)]
    _log_lines(recording, view, f"{path}/error", lines)
    for joint in (1, 2):
        lines = [
            ("feedback", leg[f"tau_feedback_{joint}"], palette.FEEDBACK),
            ("feedforward", leg[f"tau_feedforward_{joint}"], palette.FEEDFORWARD),
        ]
        _log_lines(recording, view, f"{path}/torque_{joint}", lines)


def _log_body(recording: rr.RecordingStream, view: RunView) -> None:
    body = view.body
    lines: list[Line] = [
        ("pitch, nose down", 1e3 * body["pitch"], palette.ACTUAL),
        ("roll, right side down", 1e3 * body["roll"], palette.FIRST_CYCLE),
    ]
    _log_lines(recording, view, "series/body/tilt", lines)
    _log_lines(recording, view, "series/body/height", [("height", 1e3 * body["height"], palette.LAST_CYCLE)])
    margins: list[Line] = [
        ("nearest edge", 1e3 * body["stability_margin"], palette.DESIRED),
        ("front", 1e3 * body["margin_front"], palette.ACTUAL),
        ("rear", 1e3 * body["margin_rear"], palette.FIRST_CYCLE),
    ]
    _log_lines(recording, view, "series/body/margins", margins)


def log_series(recording: rr.RecordingStream, view: RunView) -> None:
    """All time series, leg by leg, then those of the body."""
    for leg in view.legs:
        _log_leg(recording, view, leg)
        _log_gait(recording, view, leg)
    if view.walks:
        _log_body(recording, view)
