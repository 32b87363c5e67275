"""The moments of a run that are worth a look: where a foot lifts or touches down, where the guard acts."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import rerun as rr

from cmacexp.metrics.drift import format_event
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import LegView, RunView

EVENTS = "events"


class Event(NamedTuple):
    """A moment."""

    row: int
    """Step of the view."""
    text: str


def _contacts(view: RunView, leg: LegView) -> Iterator[Event]:
    """From each planned lift-off on the first step without force; from each planned touch-down on the first with."""
    for start in np.flatnonzero(np.diff(leg.support)) + 1:
        does, reached = ("touches down", leg["force"] > 0.0) if leg.support[start] else ("lifts", leg["force"] == 0.0)
        who = f"foot {leg.number}" if view.walks else "the foot"
        row = int(start + np.argmax(reached[start:]))  # ``start`` if none is
        yield Event(row, f"{who} {does}")


def find_events(view: RunView) -> list[Event]:
    """The moments of a run in their order; of a machine that never lifts a foot, none but its cycles."""
    starts = np.flatnonzero(np.diff(view.cycle, prepend=view.cycle[0] - 1))
    found = [Event(int(row), f"cycle {view.cycle[row]} begins") for row in starts]
    for leg in view.legs:
        found += _contacts(view, leg)
    found += [
        Event(int(np.searchsorted(view.step, event["step"])), f"guard of learning: {format_event(event)}")
        for event in view.manifest.get("guard", ())
        if view.step[0] <= event["step"] <= view.step[-1]
    ]
    return sorted(found)


def log_events(entities: Entities, view: RunView) -> None:
    """The moments as a log, each with its time, which the viewer goes to when it is clicked."""
    found = find_events(view)
    rows = np.array([event.row for event in found])
    texts = [f"{view.time[event.row]:.3f} s  {event.text}" for event in found]
    entities.send_columns(EVENTS, rr.TextLog.columns(text=texts), rows=rows)
