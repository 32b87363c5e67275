"""The Rerun entities of a run in a recording, and the resolution at which their geometry is stored."""

from collections.abc import Iterable

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

FINENESS = 5e-4
"""Resolution of drawn lengths, m: less than a pixel; a standing foot then takes no space in the compressed file."""
FINE_ANGLE = 2e-3
"""Resolution of drawn link angles, rad: their ends move less than a pixel, and a recording is smaller."""


def round_points(exact: Array) -> NDArray[np.float32]:
    """Round points (..., 3), m, to :data:`FINENESS`."""
    return (np.round(exact / FINENESS) * FINENESS).astype(np.float32)


def round_angles(exact: Array) -> NDArray[np.float32]:
    """Round angles (...), rad, or components of unit vectors to :data:`FINE_ANGLE`."""
    return (np.round(exact / FINE_ANGLE) * FINE_ANGLE).astype(np.float32)


def flatten_points(*groups: Array) -> NDArray[np.float32]:
    """Join groups of points (steps, n, 3) step by step and round them, into (steps * sum(n), 3)."""
    return round_points(np.concatenate(groups, axis=1).reshape(-1, 3))


class Entities:
    """Writer of the entities of one run: at the root of a recording, or below the name of the run among several.

    Every entity stores the time of each step, so few entities with many instances make a small recording.
    """

    def __init__(self, recording: rr.RecordingStream, view: RunView):
        self._recording = recording
        self._view = view

    def log(self, path: str, entity: rr.AsComponents) -> None:
        """Log a constant entity."""
        self._recording.log(self._view.root + path, entity, static=True)

    def send_columns(
        self,
        path: str,
        columns: Iterable[rr.ComponentColumn],
        rows: NDArray[np.intp] | None = None,
        constant: rr.AsComponents | None = None,
    ) -> None:
        """Log columns for all steps of the view, or for the steps at ``rows``, with equally many instances per step.

        ``constant`` holds the components of the entity that do not change.
        """
        if constant is not None:
            self.log(path, constant)
        time, step = (signal if rows is None else signal[rows] for signal in (self._view.time, self._view.step))
        timelines = [rr.TimeColumn("time", duration=time), rr.TimeColumn("step", sequence=step)]
        columns_by_step = []
        for column in columns:
            count = len(column.component_batch.as_arrow_array()) // len(step)
            columns_by_step.append(column.partition([count] * len(step)))
        self._recording.send_columns(self._view.root + path, timelines, columns_by_step)
