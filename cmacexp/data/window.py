"""Which steps of a run its recording shows: a window of its cycles, thinned if it is long."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from cmacexp.errors import BadInput, require

MOST_STEPS = 20_000
"""Steps that a recording shows at most by default; of a longer run it shows one step in so many."""
CYCLES = re.compile(r"(?P<first>\d+)(?:-(?P<last>\d+))?|last(?P<number>\d*)")


class Window(NamedTuple):
    """The steps of a run that a recording shows."""

    first: int
    """First cycle shown, from 1."""
    last: int
    every: int
    """One step in so many is shown."""
    steps: int
    """All steps of those cycles."""

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
    """One step in how many is shown of a run of so many steps, of which so many share a recording."""
    return -(-steps * sharing // MOST_STEPS)


def read_cycles(text: str, cycles: int) -> tuple[int, int]:
    """First and last cycle that ``3-5``, ``7``, ``last`` or ``last5`` mean, of so many that a run, or all, completed.

    Raises BadInput if the text cannot be read, or the run does not have these cycles.
    """
    found = CYCLES.fullmatch(text)
    if not found:
        raise BadInput("--cycles", text, "write 3-5, 7, last or last5")
    if found["first"] is None:
        first, last = cycles + 1 - int(found["number"] or 1), cycles
    else:
        first, last = int(found["first"]), int(found["last"] or found["first"])
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
    """The window of a run of which the trace has ``kept`` so many steps of each cycle.

    By default it shows all cycles, and so many steps that ``sharing`` runs fit into one recording. Raises BadInput.
    """
    first, last = cycles or (min(kept), max(kept))
    steps = sum(count for cycle, count in kept.items() if first <= cycle <= last)
    require(steps, "--cycles", f"{first}-{last}", "not in the trace, of which record.cycles kept others")
    every = choose_every(steps, sharing) if every is None else every
    require(
        1 <= every <= steps, "--every", every, f"must be from 1, every step, to {steps}, the steps of these cycles"
    )
    return Window(first, last, every, steps)
