"""The main metrics of a run as a table of text: one row per cycle, several legs pooled."""

from collections.abc import Sequence
from typing import TypeVar

from cmacexp.data.tables import Scores
from cmacexp.metrics.metric import Shown
from cmacexp.metrics.pooling import count_legs, pool_legs, select_main
from cmacexp.metrics.text import format_cell

MOST_ROWS = 24
"""A longer table shows its first and last ENDS rows, and BETWEEN of the others."""
ENDS, BETWEEN = 6, 8
Row = TypeVar("Row")


def shorten(rows: Sequence[Row]) -> list[Row]:
    """The rows of a table; of a long one the first, some between, evenly spaced, and the last."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    gap = (len(rows) - 2 * ENDS + 1) / (BETWEEN + 1)
    between = [rows[round(ENDS - 1 + gap * (index + 1))] for index in range(BETWEEN)]
    return [*rows[:ENDS], *between, *rows[-ENDS:]]


def tabulate_cycles(scores: Scores) -> tuple[dict[str, Shown], list[list[str]]]:
    """The main metrics that at least one cycle defines, by name, and a row of text per cycle, its number first."""
    pooled = pool_legs(scores)
    main = select_main(pooled, count_legs(scores))
    columns = [map(format_cell, pooled[name] * shown.factor) for name, shown in main.items()]
    cycles = range(1, len(next(iter(pooled.values()))) + 1)
    return main, [list(row) for row in zip(map(str, cycles), *columns, strict=True)]
