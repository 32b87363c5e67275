"""The trace of some cycles of a run, as figures show it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.run import Run
from cmacexp.data.trace import THIRD_AXIS, Trace
from cmacexp.typing import Array, Mask

Rows = dict[str, Array]
"""Signals of one leg or of the body by name, (steps,) each."""


def keep_rows(rows: Rows, kept: Mask | slice) -> Rows:
    """Some rows of a trace."""
    return {name: column[kept] for name, column in rows.items()}


@dataclass(frozen=True)
class CycleData:
    """Some cycles of a run, for figures."""

    cycles: Sequence[int]
    trace: Trace
    cycle_time: float
    period: float
    """Between two samples, s."""

    @property
    def legs(self) -> Sequence[int]:
        """Numbers of the legs."""
        return range(1, self.trace.legs + 1)

    @property
    def has_joints(self) -> bool:
        """Whether the legs have joints; a point mass has none."""
        return not np.isnan(self.trace["q1"]).all()

    @property
    def is_robot(self) -> bool:
        """Whether the legs move in space."""
        return THIRD_AXIS in self.trace.axes

    @property
    def moves_along_x(self) -> bool:
        """Whether the feet move along x; a foot that only presses has neither path nor error there."""
        return any(float(np.ptp(self.trace[name])) > 1e-6 for name in ("x", "x_desired"))

    @property
    def duration(self) -> float:
        """Duration of the longest of the cycles, s; less than a cycle if the run stopped in its first."""
        return float(self.time_in_cycle(self.rows(1)).max()) + self.period

    def rows(self, leg: int) -> Rows:
        """All signals of one leg; of the body if ``leg`` is 0."""
        if not leg:
            assert self.trace.body is not None
            return {name: self.trace.body[name] for name in self.trace.body.names}
        return {name: self.trace[name][:, leg - 1] for name in self.trace.names if name != "phase"}

    def select(self, cycle: int, leg: int) -> Rows:
        """The trace of one leg in one cycle; of the body if ``leg`` is 0."""
        return keep_rows(self.rows(leg), self.trace.shared("cycle") == cycle)

    def time_in_cycle(self, rows: Rows) -> Array:
        """Time since the cycle began, s."""
        return rows["time"] - (rows["cycle"] - 1) * self.cycle_time

    def support(self, leg: int) -> list[tuple[float, float]]:
        """Begin and end of each planned support in the first cycle, s; none if all is support, or of the body."""
        if not leg:
            return []
        support = self.trace.support[self.trace.shared("cycle") == self.cycles[0], leg - 1]
        edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
        clock = np.append(self.time_in_cycle(self.select(self.cycles[0], leg)), self.cycle_time)
        return [] if support.all() else list(zip(clock[edges[::2]], clock[edges[1::2]], strict=True))

    def leg_name(self, leg: int) -> str:
        """E.g. ``leg 1, left front``; empty of the only leg, and of the body."""
        return f"leg {leg}, {LEG_NAMES[leg - 1]}" if leg and len(self.legs) > 1 else ""


def read_cycle_data(run: Run, cycles: Sequence[int]) -> CycleData:
    """Read some cycles of a run."""
    return CycleData(cycles, run.read_trace(cycles), run.config["gait"]["cycle_time"], run.config["sampling_period"])
