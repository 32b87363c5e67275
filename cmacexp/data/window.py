"""Windows of a recording: the cycles of a run that it shows, thinned if they have many steps."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from cmacexp.errors import BadInput, require

MOST_STEPS = 20_000
"""Largest number of steps in a recording by default; longer runs are thinned."""
CYCLES = re.compile(r"(?P<first>\d+)(?:-(?P<last>\d+))?|last(?P<number>\d*)")


class Window(NamedTuple):
    """The steps of a run that a recording shows."""

    first: int
    """First cycle shown, from 1."""
    last: int
    """Last cycle shown."""
    every: int
    """Thinning factor: one step in ``every`` is shown."""
    steps: int
    """Number of steps of these cycles in the trace, shown or not."""

    def __str__(self) -> str:
        cycles = f"cycles {self.first} to {self.last}" if self.last > self.first else f"cycle {self.first}"
        return f"{cycles}, " + (
            f"all {self.steps} steps of the trace" if self.every == 1 else f"one step in {self.every} of {self.steps}"
        )

    @property
    def cycles(self) -> range:
        """The cycles shown."""
        return range(self.first, self.last + 1)


def choose_every(steps: int, sharing: int = 1) -> int:
    """Compute the thinning factor for a recording of ``sharing`` runs with ``steps`` steps each."""
    return -(-steps * sharing // MOST_STEPS)


def read_cycles(text: str, cycles: int) -> tuple[int, int]:
    """Parse a range of cycles, ``3-5``, ``7``, ``last`` or ``last5``, and return its first and last cycle.

    ``cycles`` is the number of cycles that the run, or each of several runs, took. Raises BadInput if the text cannot
    be parsed or the range exceeds these cycles.
    """
    match = CYCLES.fullmatch(text)
    if not match:
        raise BadInput("--cycles", text, "write 3-5, 7, last or last5")
    if match["first"] is None:
        first, last = cycles + 1 - int(match["number"] or 1), cycles
    else:
        first, last = int(match["first"]), int(match["last"] or match["first"])
    require(
        1 <= first <= last <= cycles,
        "--cycles",
        text,
        f"must lie within the {cycles} cycles that the run, or each of the runs, took, lower number first",
    )
    return first, last


def make_window(
    kept: Mapping[int, int], cycles: tuple[int, int] | None = None, every: int | None = None, sharing: int = 1
) -> Window:
    """Choose the window that a recording shows of a run.

    Args:
        kept: Number of steps in the trace, by cycle.
        cycles: First and last cycle; None: all cycles in the trace.
        every: Thinning factor; None: chosen so that ``sharing`` such runs fit into one recording.
        sharing: Number of runs in the recording.

    Raises:
        BadInput: The trace has no step of these cycles, or ``every`` is not from 1 to their number of steps.
    """
    first, last = cycles or (min(kept), max(kept))
    steps = sum(count for cycle, count in kept.items() if first <= cycle <= last)
    require(steps, "--cycles", f"{first}-{last}", "not in the trace, of which record.cycles kept others")
    every = choose_every(steps, sharing) if every is None else every
    require(
        1 <= every <= steps, "--every", every, f"must be from 1, every step, to {steps}, the steps of these cycles"
    )
    return Window(first, last, every, steps)
