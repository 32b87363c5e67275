"""The entities of a run in a recording."""

from typing import Any

import rerun as rr

from cmacexp.recording.run_view import RunView


class Entities:
    """The entities of one run: at the root of a recording, or below the run's own name where several share it."""

    def __init__(self, recording: rr.RecordingStream, view: RunView):
        self._recording = recording
        self._root = view.root
        self._time, self._step = view.time, view.step

    def log(self, path: str, entity: rr.AsComponents) -> None:
        """Log a constant entity."""
        self._recording.log(self._root + path, entity, static=True)

    def send_columns(self, path: str, columns: Any, rows: Any = slice(None)) -> None:
        """Log columns for all steps at once, or for those at ``rows`` of the view."""
        timelines = [
            rr.TimeColumn("time", duration=self._time[rows]),
            rr.TimeColumn("step", sequence=self._step[rows]),
        ]
        self._recording.send_columns(self._root + path, timelines, columns)
