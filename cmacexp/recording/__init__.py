"""A Rerun view of a run, rebuilt from its trace at any time."""

from cmacexp.recording.write import write_recording

__all__ = ["write_recording"]
