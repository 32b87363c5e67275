"""The trace of some cycles of a run, as figures show it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.parquet import as_array, is_support, read_cycles
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY_FILE, TRACE_FILE
from cmacexp.metrics.block import THIRD_AXIS
from cmacexp.typing import Array, Mask

Rows = dict[str, NDArray[Any]]
"""Columns of a trace by name, ``phase`` as whether it is support; pandas takes longer to import than a figure."""


def keep_rows(rows: Rows, kept: Mask | slice) -> Rows:
    """Some rows of a trace."""
    return {name: column[kept] for name, column in rows.items()}


def _read_rows(path: Path, cycles: Sequence[int]) -> Rows:
    table = read_cycles(path, cycles)
    return {name: is_support(table) if name == "phase" else as_array(table, name) for name in table.column_names}


@dataclass(frozen=True)
class CycleData:
    """Some cycles of a run, for figures."""

    cycles: Sequence[int]
    trace: Rows
    body: Rows | None
    cycle_time: float
    period: float
    """Between two samples, s."""
    legs: Sequence[int]
    has_joints: bool
    axes: str
    """Those in which a foot moves: x and y and, of a robot, z; there are as many joints."""

    @property
    def is_robot(self) -> bool:
        """Whether the legs move in space."""
        return THIRD_AXIS in self.axes

    @property
    def moves_along_x(self) -> bool:
        """Whether the feet move along x; a foot that only presses has neither path nor error there."""
        return any(float(np.ptp(self.trace[name])) > 1e-6 for name in ("x", "x_desired"))

    @property
    def duration(self) -> float:
        """Duration of the longest of the cycles, s; less than a cycle if the run stopped in its first."""
        return float(self.time_in_cycle(self.trace).max()) + self.period

    def select(self, cycle: int, leg: int) -> Rows:
        """The trace of one leg in one cycle; of the body if ``leg`` is 0."""
        if not leg:
            assert self.body is not None
            return keep_rows(self.body, self.body["cycle"] == cycle)
        return keep_rows(self.trace, (self.trace["cycle"] == cycle) & (self.trace["leg"] == leg))

    def time_in_cycle(self, rows: Rows) -> Array:
        """Time since the cycle began, s."""
        return rows["time"] - (rows["cycle"] - 1) * self.cycle_time

    def support(self, leg: int) -> list[tuple[float, float]]:
        """Begin and end of each planned support in the first cycle, s; none if all is support, or of the body."""
        if not leg:
            return []
        rows = self.select(self.cycles[0], leg)
        support = rows["phase"]
        edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
        clock = np.append(self.time_in_cycle(rows), self.cycle_time)
        return [] if support.all() else list(zip(clock[edges[::2]], clock[edges[1::2]], strict=True))

    def leg_name(self, leg: int) -> str:
        """E.g. ``leg 1, left front``; empty of the only leg, and of the body."""
        return f"leg {leg}, {LEG_NAMES[leg - 1]}" if leg and len(self.legs) > 1 else ""


def read_cycle_data(run: StoredRun, cycles: Sequence[int]) -> CycleData:
    """Read some cycles of a run."""
    trace = _read_rows(run.folder / TRACE_FILE, cycles)
    body = _read_rows(run.folder / BODY_FILE, cycles) if run.walks else None
    has_joints = not np.isnan(trace["q1"]).all()
    times = run.config["gait"]["cycle_time"], run.config["sampling_period"]
    axes = "xyz" if THIRD_AXIS in trace else "xy"
    return CycleData(cycles, trace, body, *times, range(1, int(trace["leg"].max()) + 1), has_joints, axes)
