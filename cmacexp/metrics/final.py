"""The error at the end of a run: the median of a metric over its last whole cycles."""

from collections.abc import Mapping

import numpy as np

from cmacexp.typing import Array

FINAL_CYCLES = 10
"""Cycles at the end of a run whose median is its final value, unless a study declares another number."""
TRANSFER = "transfer_rmse"
"""Distance of the feet from their path in transfer, over all axes: a column of robots, computed of other machines."""


def compute_final(values: Array, cycles: int = FINAL_CYCLES) -> float:
    """The final value of a metric: its median over the last ``cycles``, or over all if there are fewer.

    Args:
        values: (whole cycles,), in the metric's unit; of a run that completed, since a run that ended early has none.
        cycles: number of cycles at the end.
    """
    return float(np.median(values[-cycles:]))


def find_history(pooled: Mapping[str, Array], name: str) -> Array:
    """A metric in every whole cycle, (cycles,), legs pooled; empty if the run does not have it.

    Args:
        pooled: the metrics of a run, (cycles,) each, in SI units.
        name: of the metric; ``TRANSFER`` is the root of the sum of squares of the axes where it is no column.
    """
    if name == TRANSFER and name not in pooled:
        axes = [pooled[f"{name}_{axis}"] for axis in "xy" if f"{name}_{axis}" in pooled]
        return np.hypot(*axes) if axes else np.empty(0)
    return pooled.get(name, np.empty(0))
