"""What the study of hashing measured: errors and collisions by memory, over several seeds of the hash."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.cmac.addressing import address_batch
from cmacexp.cmac.network import Cmac
from cmacexp.cmac.quantiser import spanning
from cmacexp.config.compose import compose_config
from cmacexp.data.stored_run import StoredRun
from cmacexp.loop.scenario import make_scenario
from pipelines.analysis.cmac_size_verdicts import Size, measure
from pipelines.shared.stats import spread

if TYPE_CHECKING:
    import pyarrow as pa

AS_GOOD = 1.25
"""Errors up to this multiple of those without collisions count as no worse."""
TENTH = 0.1
"""Part of the error of the first cycle at which a run counts as having learnt."""
AT_THE_END = 10
"""Last cycles over which errors are averaged."""


class Interval(NamedTuple):
    """Geometric mean over seeds, and its confidence interval."""

    low: float
    middle: float
    high: float

    def __str__(self) -> str:
        if not np.isfinite(self.middle):
            return "-"
        return (
            f"{self.middle:.2g}"
            if self.low == self.high
            else f"{self.middle:.2g} ({self.low:.2g} to {self.high:.2g})"
        )


def interval(values: Sequence[float]) -> Interval:
    """Of positive numbers: that of their logarithms, by Student; of one number that number.

    >>> str(interval([1.0, 2.0, 4.0]))
    '2 (0.36 to 11)'
    """
    if not len(values):
        return Interval(np.nan, np.nan, np.nan)
    mean, half = spread(np.log(values).tolist())
    half = half if np.isfinite(half) else 0.0
    return Interval(*(float(np.exp(mean + sign * half)) for sign in (-1, 0, 1)))


@dataclass(frozen=True)
class Memory:
    """A CMAC of some memory under one rule, over all its seeds."""

    sizes: Sequence[Size]
    """Of the runs, one for each seed."""
    cycles: int
    """That were asked for."""
    visited: bool
    """Every visited cell has a row of its own."""

    @property
    def memory(self) -> int:
        """Bytes of one leg; without collisions those that its visited cells need."""
        return round(self.sizes[0].bytes_needed) if self.visited else self.sizes[0].memory

    @property
    def words(self) -> int:
        """64-bit words of one leg."""
        return self.memory // 8

    @property
    def room(self) -> float:
        """Rows for each visited cell."""
        return 1.0 if self.visited else self.sizes[0].room

    @property
    def rate(self) -> float:
        """Mean share of the visited cells that share a row."""
        return float(np.mean([size.rate for size in self.sizes]))

    @property
    def ended(self) -> int:
        """Runs that diverged or fell."""
        return sum(max(size.x) < self.cycles for size in self.sizes)

    def errors(self, side: str) -> Interval:
        """At the end in ``x`` or ``y``, mm, of the runs that completed."""
        return interval([_last(getattr(s, side)) for s in self.sizes if max(s.x) == self.cycles])

    def learnt(self) -> Interval:
        """Cycles after the first until the error in y is a tenth of that of the first; NaN unless all reach it."""
        reached = [cycles for size in self.sizes if (cycles := _cycles_to_tenth(size)) is not None]
        return interval(reached if len(reached) == len(self.sizes) else [])


def _last(by_cycle: Mapping[int, float]) -> float:
    return float(np.mean([by_cycle[cycle] for cycle in sorted(by_cycle)[-AT_THE_END:]]))


def _cycles_to_tenth(size: Size) -> int | None:
    first = min(size.y)
    reached = [cycle - first for cycle, error in size.y.items() if error <= TENTH * size.y[first]]
    return min(reached, default=None)


def found(runs: Iterable[StoredRun], base: StoredRun) -> list[Memory]:
    """The memories of some runs, smallest first and that without collisions last; ``base`` has the paper's."""
    groups: dict[tuple[bool, int], list[Size]] = {}
    for run in runs:
        size = measure(run.folder.name, run, base)
        visited = run.config["cmac"]["addressing"] == "visited"
        groups.setdefault((visited, size.memory), []).append(size)
    cycles = base.config["cycles"]
    return [Memory(sizes, cycles, visited) for (visited, _), sizes in sorted(groups.items(), key=lambda g: g[0])]


def free(memories: Sequence[Memory]) -> Memory:
    """The one without collisions."""
    return next(memory for memory in memories if memory.visited)


def hashed(memories: Sequence[Memory]) -> list[Memory]:
    """Those whose cells may share rows, smallest first."""
    return [memory for memory in memories if not memory.visited]


def worse(memory: Memory, memories: Sequence[Memory]) -> float:
    """Its errors at the end over those without collisions, in x or y, the larger one; inf if a run ended."""
    if memory.ended:
        return float("inf")
    best = free(memories)
    return max(memory.errors(side).middle / best.errors(side).middle for side in ("x", "y"))


def enough(memories: Sequence[Memory], good: Callable[[Memory], bool]) -> Memory | None:
    """The smallest hashed memory from which on all are ``good``."""
    least = None
    for memory in reversed(hashed(memories)):
        if not good(memory):
            break
        least = memory
    return least


def _least_time(work: Callable[[], object], repeats: int = 15) -> float:
    """Seconds of the fastest of some ``repeats``."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def addressing_cost() -> "pa.Table":
    """What addressing one sample of one leg takes: ``way`` (hashed, visited, neither) and ``time``, ns."""
    import pyarrow as pa

    from cmacexp.feedforward.network import planned_inputs

    setup = make_scenario(compose_config(["scenario=one_leg"])).setup
    inputs = np.ascontiguousarray(planned_inputs(setup, 0, setup.config.cmac.inputs))
    ranges = spanning(inputs, setup.config.cmac.range_factor)
    hashing, visiting = (Cmac(replace(setup.config.cmac, addressing=name), ranges) for name in ("hashed", "visited"))
    positions = np.empty((len(inputs), visiting.layers), dtype=np.uint64)
    visiting.cells(inputs)
    took = {
        "hashed": _least_time(lambda: hashing.cells(inputs)),
        "visited": _least_time(lambda: visiting.cells(inputs)),
        "neither": _least_time(lambda: address_batch(visiting.address, inputs, positions)),
    }
    return pa.table({"way": list(took), "time": [1e9 * seconds / len(inputs) for seconds in took.values()]})
