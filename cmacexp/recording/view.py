"""What a recording shows of a run: its trace leg by leg, and the geometry to draw it with."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from cmacexp.arrays import Array, Mask
from cmacexp.keep import Traces
from cmacexp.table import as_array, is_support


@dataclass(frozen=True)
class LegView:
    """Columns of one leg, (steps,) each, and where its hip is."""

    number: int
    columns: dict[str, Array]
    support: Mask
    lengths: tuple[float, float] | None
    """Of thigh and shank, m; None without joints."""

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]


@dataclass(frozen=True)
class RunView:
    """A run as the recording sees it."""

    legs: list[LegView]
    time: Array
    """(steps,), s."""
    step: Array
    cycle: Array
    hip_height: float
    """m above the undepressed ground."""
    config: dict[str, Any]

    @property
    def indexes(self) -> list[rr.TimeColumn]:
        """The timelines of every column that changes."""
        return [rr.TimeColumn("time", duration=self.time), rr.TimeColumn("step", sequence=self.step)]


def _lengths(config: dict[str, Any]) -> tuple[float, float] | None:
    leg = config["machine"].get("leg")
    return (leg["length_1"], leg["length_2"]) if leg else None


def view_of(traces: Traces, config: dict[str, Any]) -> RunView:
    """Cut a trace into legs.

    Args:
        traces: as the run left them.
        config: as it stands in the manifest.
    """
    trace = traces.legs
    number = as_array(trace, "leg")
    skipped = {"step", "time", "cycle", "leg", "phase"}
    columns = {name: as_array(trace, name) for name in trace.column_names if name not in skipped}
    support = is_support(trace)
    legs = []
    for leg in np.unique(number):
        rows = number == leg
        own = {name: values[rows] for name, values in columns.items()}
        legs.append(LegView(int(leg), own, support[rows], _lengths(config)))
    first = number == number[0]
    time, step, cycle = (as_array(trace, name)[first] for name in ("time", "step", "cycle"))
    return RunView(legs, time, step, cycle, float(config["machine"]["hip_height"]), config)
