"""Which steps of a run a recording shows: a window of its cycles, thinned if it is long."""

import re
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.errors import BadInput
from cmacexp.table import as_array

MOST_STEPS = 20_000
"""Steps that a recording shows at the most unless told; of a longer run it shows one step in so many."""
CYCLES = re.compile(r"(?P<first>\d+)(?:-(?P<last>\d+))?|last(?P<number>\d*)")


class Part(NamedTuple):
    """Steps of a run."""

    first: int
    """First cycle shown, from 1."""
    last: int
    """Last cycle shown."""
    every: int
    """One step in so many is shown."""
    steps: int
    """All steps of those cycles."""

    def __str__(self) -> str:
        cycles = f"cycles {self.first} to {self.last}" if self.last > self.first else f"cycle {self.first}"
        return f"{cycles}, " + ("every step" if self.every == 1 else f"one step in {self.every} of {self.steps}")

    @property
    def hint(self) -> str:
        """How to see all, where not all is shown."""
        return "; --every 1 shows all" if self.every > 1 else ""


def every_of(steps: int, sharing: int = 1) -> int:
    """One step in how many is shown of a run of so many steps, of which so many share a recording."""
    return -(-steps * sharing // MOST_STEPS)


def last_cycle(trace: pa.Table) -> int:
    """The cycle that a run came to."""
    return int(as_array(trace, "cycle")[-1])


def read_cycles(text: str, cycles: int, who: str = "the run") -> tuple[int, int]:
    """First and last cycle that ``3-5``, ``7``, ``last`` or ``last5`` mean.

    Args:
        text: as typed.
        cycles: that there are.
        who: took them.

    Raises:
        BadInput: the text means none, or cycles that the run has not.
    """
    found = CYCLES.fullmatch(text)
    if not found:
        raise BadInput("--cycles", text, "write 3-5, 7, last or last5")
    if found["first"] is None:
        first, last = cycles + 1 - int(found["number"] or 1), cycles
    else:
        first, last = int(found["first"]), int(found["last"] or found["first"])
    if not 1 <= first <= last <= cycles:
        raise BadInput("--cycles", text, f"must lie within the {cycles} cycles that {who} took, lower number first")
    return first, last


def part_of(
    trace: pa.Table, cycles: tuple[int, int] | None = None, every: int | None = None, sharing: int = 1
) -> Part:
    """The part of a run that is shown.

    Args:
        trace: one row per step and leg, at least one step.
        cycles: first and last cycle; None: all.
        every: one step in so many; None: so many that a recording is not too large for the viewer.
        sharing: runs that stand in one recording.

    Raises:
        BadInput: fewer steps than ``every``.
    """
    first, last = cycles or (1, last_cycle(trace))
    cycle = as_array(trace, "cycle")[np.asarray(as_array(trace, "leg") == 1)]
    steps = int(((cycle >= first) & (cycle <= last)).sum())
    if every is not None and every > steps:
        raise BadInput("--every", every, f"must be at most the {steps} steps that are to be shown")
    return Part(first, last, every or every_of(steps, sharing), steps)
