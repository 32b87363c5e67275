"""A Rerun view of a run, or of several side by side, rebuilt from their traces at any time."""

from cmacexp.recording.compare import MOST_RUNS, root_of, write_comparison
from cmacexp.recording.panels import panel_names
from cmacexp.recording.shown_run import ShownRun, show
from cmacexp.recording.window import Part, every_of, part_of, read_cycles
from cmacexp.recording.write import name_of, write_recording

__all__ = [
    "MOST_RUNS",
    "Part",
    "ShownRun",
    "every_of",
    "name_of",
    "panel_names",
    "part_of",
    "read_cycles",
    "root_of",
    "show",
    "write_comparison",
    "write_recording",
]
