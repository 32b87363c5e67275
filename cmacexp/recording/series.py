"""Time series of a run: force, tracking error, torques."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from cmacexp.arrays import Array
from cmacexp.recording import palette
from cmacexp.recording.view import LegView, RunView

Line = tuple[str, Array, tuple[int, ...]]


def _log_lines(recording: rr.RecordingStream, view: RunView, path: str, lines: Sequence[Line]) -> None:
    """Several lines in one entity: (name, values, colour) each."""
    names, values, colours = zip(*lines, strict=True)
    recording.log(
        path, rr.SeriesLines(names=list(names), colors=list(colours), widths=[1.5] * len(lines)), static=True
    )
    recording.send_columns(path, view.indexes, rr.Scalars.columns(scalars=np.stack(values, axis=1)))


def _force_lines(leg: LegView) -> list[Line]:
    lines: list[Line] = [
        ("desired", leg["force_desired"], palette.DESIRED),
        ("actual", leg["force"], palette.ACTUAL),
    ]
    if not np.array_equal(leg["force"], leg["force_measured"]):
        lines.insert(1, ("measured", leg["force_measured"], palette.MEASURED))
    return lines


def log_series(recording: rr.RecordingStream, view: RunView) -> None:
    """All time series, leg by leg."""
    for leg in view.legs:
        path = f"series/leg_{leg.number}"
        _log_lines(recording, view, f"{path}/force", _force_lines(leg))
        x_error = 1e3 * (leg["x"] - leg["x_desired"])
        y_error = 1e3 * (leg["y"] - leg["y_desired"])
        _log_lines(
            recording,
            view,
            f"{path}/error",
            [("x forward", x_error, palette.ACTUAL), ("y down", y_error, palette.FIRST_CYCLE)],
        )
        for joint in (1, 2):
            _log_lines(
                recording,
                view,
                f"{path}/torque_{joint}",
                [
                    ("feedback", leg[f"tau_feedback_{joint}"], palette.FEEDBACK),
                    ("feedforward", leg[f"tau_feedforward_{joint}"], palette.FEEDFORWARD),
                ],
            )
