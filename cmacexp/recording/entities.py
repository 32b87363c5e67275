"""The entities of a run in a recording, and how finely what they show is stored."""

from collections.abc import Iterable

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

FINENESS = 5e-4
"""Drawn lengths are multiples of this, m: less than a pixel, and a foot that stands takes no room in the file."""
FINE_ANGLE = 2e-3
"""Drawn angles of links are multiples of this, rad: their ends move less than a pixel, and a recording is smaller."""


def round_points(exact: Array) -> NDArray[np.float32]:
    """Points (..., 3) to :data:`FINENESS`."""
    return (np.round(exact / FINENESS) * FINENESS).astype(np.float32)


def round_angles(exact: Array) -> NDArray[np.float32]:
    """Angles (...), rad, or parts of unit vectors to :data:`FINE_ANGLE`."""
    return (np.round(exact / FINE_ANGLE) * FINE_ANGLE).astype(np.float32)


def flatten_points(*groups: Array) -> NDArray[np.float32]:
    """Groups of points (steps, n, 3) side by side, flat (steps sum(n), 3), as they are drawn."""
    return round_points(np.concatenate(groups, axis=1).reshape(-1, 3))


class Entities:
    """The entities of one run: at the root of a recording, or below the run's own name where several share it.

    Each entity repeats the time of every step, so that few entities of many instances make a small recording.
    """

    def __init__(self, recording: rr.RecordingStream, view: RunView):
        self._recording = recording
        self._root, self._time, self._step = view.root, view.time, view.step

    def log(self, path: str, entity: rr.AsComponents) -> None:
        """Log a constant entity."""
        self._recording.log(self._root + path, entity, static=True)

    def send_columns(
        self,
        path: str,
        columns: Iterable[rr.ComponentColumn],
        rows: NDArray[np.intp] | None = None,
        constant: rr.AsComponents | None = None,
    ) -> None:
        """Log columns for all steps of the view, or for those at ``rows``; each step has as many instances.

        ``constant`` is what stays the same of the entity.
        """
        if constant is not None:
            self.log(path, constant)
        time, step = (self._time, self._step) if rows is None else (self._time[rows], self._step[rows])
        timelines = [rr.TimeColumn("time", duration=time), rr.TimeColumn("step", sequence=step)]
        each_step = []
        for column in columns:
            count = len(column.component_batch.as_arrow_array()) // len(step)
            each_step.append(column.partition([count] * len(step)))
        self._recording.send_columns(self._root + path, timelines, each_step)
