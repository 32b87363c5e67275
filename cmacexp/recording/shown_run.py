"""What a recording shows of a run: the run as it is drawn, under its own name and root."""

from dataclasses import dataclass
from typing import Any

import rerun as rr

from cmacexp.data.tables import Traces
from cmacexp.recording.run_view import RunView, view_of
from cmacexp.recording.window import Part


@dataclass(frozen=True)
class ShownRun(RunView):
    """A run in a recording."""

    part: Part
    """Which of its steps these are."""
    label: str
    """The name of the run, or what sets it apart from those beside it."""
    root: str
    """What the paths of its entities begin with."""

    @property
    def indexes(self) -> list[rr.TimeColumn]:
        """The timelines of every column that changes."""
        return [rr.TimeColumn("time", duration=self.time), rr.TimeColumn("step", sequence=self.step)]


def show(traces: Traces, config: dict[str, Any], label: str, part: Part, root: str = "") -> ShownRun:
    """What a recording shows of a run.

    Args:
        traces: the steps that are shown.
        config: as it stands in the manifest.
        label: what the run is called.
        part: which steps these are.
        root: what the paths of its entities begin with.
    """
    return ShownRun(**vars(view_of(traces, config)), part=part, label=label, root=root)
