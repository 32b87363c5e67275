"""A log of the weights of networks at the end of each cycle, filled by the loop."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.cmac.memory import find_distinct
from cmacexp.data.signals import FEEDFORWARD, MEMORY_SIGNALS
from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import CLOCK, Array, Cells, Clock, Counts

LOGGED = tuple(signal.name for signal in MEMORY_SIGNALS if signal.owner == FEEDFORWARD)
NORM, LARGEST, ROWS_USED = (LOGGED.index(name) for name in ("weight_norm", "weight_largest", "rows_used"))


class WeightLog(NamedTuple):
    """Log of L networks over the cycles begun since it was last taken."""

    rows: Cells
    """(L, M): the rows that the plan uses, each once; padded."""
    used: Counts
    """(L,): number of these rows."""
    values: Clock
    """(cycles that it holds, L, 3): as LOGGED, at the start of each of these cycles."""
    begun: Annotated[Counts, CLOCK]
    """(1,): number of these cycles."""


def new_log(cells: Cells, cycles: int = 0) -> WeightLog:
    """A log of networks whose active rows are ``cells`` (N, L, C), with room for so many cycles.

    All of a run have room: a machine on a wire cannot wait for the log to be taken.
    """
    legs = [find_distinct(own) for own in np.moveaxis(cells, 1, 0)]
    rows = np.zeros((len(legs), max(map(len, legs))), dtype=np.uint32)
    for own, found in zip(rows, legs, strict=True):
        own[: len(found)] = found
    counts = np.array([len(found) for found in legs], dtype=np.int64)
    return WeightLog(rows, counts, np.zeros((cycles, len(legs), len(LOGGED))), np.zeros(1, dtype=np.int64))


@kernel
def log_weights(log: WeightLog, weights: Array, entry: Array) -> None:
    """Fill ``entry`` (L, 3) with the columns LOGGED of ``weights`` (L, rows, J), N m, now."""
    for i in range(weights.shape[0]):
        power = largest = 0.0
        count = 0
        for k in range(log.used[i]):
            row = weights[i, log.rows[i, k]]
            square = peak = 0.0
            for o in range(row.shape[0]):
                square += row[o] * row[o]
                peak = max(peak, abs(row[o]))
            power += square
            largest = max(largest, peak)
            count += 1 if peak > 0.0 else 0
        entry[i, NORM] = math.sqrt(power)
        entry[i, LARGEST] = largest
        entry[i, ROWS_USED] = count


@kernel
def log_cycle(log: WeightLog, weights: Array) -> None:
    """Log the weights (L, rows, J), N m, at the start of a cycle."""
    if log.begun[0] < log.values.shape[0]:
        log_weights(log, weights, log.values[log.begun[0]])
    log.begun[0] += 1


log_weights_now = program(log_weights)


def collect_log(log: WeightLog, weights: Array, cycles: int) -> Array:
    """Take and empty the log of the last ``cycles`` cycles, the last of which may be short.

    Returns (cycles, L, 3), as LOGGED, at the end of each, whether networks acted in it or not; 0 before they learn.
    ``weights`` (L, rows, J) are as the last of these cycles left them.
    """
    entries = np.zeros((cycles, *log.values.shape[1:]))
    begun = int(log.begun[0])
    if begun and cycles:  # a run may end before the first step of a cycle is kept
        entries[cycles - begun : cycles - 1] = log.values[1:begun]
        log_weights_now(log, weights, entries[-1])
    log.begun[0] = 0
    return entries
