"""Metrics of a run with one value per cycle: several legs pooled, as the registry says; as a table of text."""

from collections.abc import Container, Mapping, Sequence
from typing import TypeVar

import numpy as np

from cmacexp.data.tables import Scores
from cmacexp.data.trace import Trace
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, MAIN, SHOWN
from cmacexp.metrics.text import format_cell
from cmacexp.typing import Array

MOST_ROWS = 24
"""A longer table shows its first and last ENDS rows, and BETWEEN of the others."""
ENDS, BETWEEN = 6, 8
Row = TypeVar("Row")


def count_legs(scores: Scores) -> int:
    """Number of legs that were scored."""
    return Trace(scores.legs).legs


def pool_legs(scores: Scores) -> dict[str, Array]:
    """Every metric of legs and body by name, one value per cycle, in SI units; NaN where no leg defines it."""
    pooled = dict[str, Array]()
    for values in [Trace(table) for table in scores if table is not None]:
        names = [name for name in values.names if name in ALL_METRICS]
        pooled |= dict.fromkeys(names, np.empty(0))  # so that they keep their order
        for pooling in {ALL_METRICS[name].pooling for name in names}:  # at once: else most of it is numpy's calls
            alike = [name for name in names if ALL_METRICS[name].pooling is pooling]
            legs = np.stack([values[name].reshape(values.steps, -1) for name in alike])
            pooled |= zip(alike, pooling.pool(legs), strict=True)
    return pooled


def is_shown(name: str, values: Container[str], legs: int) -> bool:
    """Whether tables and figures show a metric for a run that has these metrics, and so many legs."""
    return (legs == 1 or SHOWN[name].over_legs) and SHOWN[name].instead not in values


def select_main(values: Mapping[str, Array], legs: int) -> dict[str, MetricDisplay]:
    """The main metrics that at least one cycle defines, for a run of so many legs."""
    return {
        name: shown
        for name, shown in MAIN.items()
        if is_shown(name, values, legs) and not np.isnan(values.get(name, np.nan)).all()
    }


def shorten(rows: Sequence[Row]) -> list[Row]:
    """The rows of a table; of a long one the first, some between, evenly spaced, and the last."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    gap = (len(rows) - 2 * ENDS + 1) / (BETWEEN + 1)
    between = [rows[round(ENDS - 1 + gap * (index + 1))] for index in range(BETWEEN)]
    return [*rows[:ENDS], *between, *rows[-ENDS:]]


def tabulate_cycles(scores: Scores) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """The main metrics that at least one cycle defines, by name, and a row of text per cycle, its number first."""
    pooled = pool_legs(scores)
    main = select_main(pooled, count_legs(scores))
    columns = [map(format_cell, pooled[name] * shown.factor) for name, shown in main.items()]
    cycles = range(1, len(next(iter(pooled.values()))) + 1)
    return main, [list(row) for row in zip(map(str, cycles), *columns, strict=True)]
