"""Where the entities of a run go in a recording."""

from typing import Any

import rerun as rr


class Entities:
    """The entities of one run: at the root of a recording, or below the run's own name where several share it."""

    def __init__(self, recording: rr.RecordingStream, root: str):
        self._recording = recording
        self._root = root

    def log(self, path: str, what: rr.AsComponents) -> None:
        """Log what does not change."""
        self._recording.log(self._root + path, what, static=True)

    def send_columns(self, path: str, indexes: list[rr.TimeColumn], columns: Any) -> None:
        """Log what changes, all steps at once."""
        self._recording.send_columns(self._root + path, indexes, columns)
