"""Metrics of the weights at the end of each cycle, from ``memory.parquet``."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from cmacexp.data.signals import CLOCK, GUARD_STATES, MEMORY_SIGNALS
from cmacexp.data.trace import Trace
from cmacexp.metrics.metric import LARGEST, MEAN, NEITHER, RMS, Metric
from cmacexp.typing import Array

COLUMNS = [signal.name for signal in MEMORY_SIGNALS if signal.owner != CLOCK]
"""Columns of ``memory.parquet`` that the metrics are computed from."""


def join_memory(parts: Sequence[Trace], cycles: int, legs: int) -> dict[str, Array]:
    """The signals of the memory in all parts of a run, (cycles, legs) by name; NaN throughout without memory."""
    if not parts:
        return {name: np.full((cycles, legs), np.nan) for name in COLUMNS}
    return {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}


_NO_WEIGHTS = "no weights that a built-in feedforward keeps"
_of_weights = partial(Metric, undefined=_NO_WEIGHTS, better=NEITHER)

MEMORY_METRICS: dict[str, Metric[Mapping[str, Array]]] = {
    "weight_norm": _of_weights(
        "N m",
        "Euclidean norm of all weights at the end of the cycle",
        compute=lambda m: m["weight_norm"],
        pooling=RMS,
    ),
    "memory_used": _of_weights(
        "",
        "rows of memory with a weight other than 0 at the end of the cycle, over all rows",
        compute=lambda m: m["rows_used"] / m["rows"],
        pooling=MEAN,
    ),
    "cells_colliding": Metric(
        "",
        "visited cells that share their row with another one by hashing",
        f"{_NO_WEIGHTS}, not a CMAC, or more cells than 64 bits count",
        lambda m: m["cells_colliding"],
        MEAN,
        NEITHER,
        source="Albus 1975",
    ),
    "guard_state": _of_weights(
        "",
        f"guard of learning at the end of the cycle: {GUARD_STATES}",
        compute=lambda m: m["guard"],
        pooling=LARGEST,
    ),
}
