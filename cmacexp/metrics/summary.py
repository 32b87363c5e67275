"""The main metrics of a run as a table of text: one row per cycle, several legs pooled."""

import math
from collections.abc import Sequence

from cmacexp.data.tables import Scores
from cmacexp.metrics.pooling import count_legs, pool_legs, select_main

MOST_ROWS = 24
"""A longer table shows its first and last rows."""


def format_number(value: float) -> str:
    """A number of a table; a dash where it is undefined."""
    if math.isnan(value):
        return "-"
    size = abs(value)
    return f"{value:.3f}" if size < 10 else f"{value:.1f}" if size < 1e5 else f"{value:.2e}"


def shorten(rows: Sequence[list[str]]) -> list[list[str]]:
    """The rows of a table; of a long one the first and the last, with dots between them."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    half = MOST_ROWS // 2
    return [*rows[:half], ["..."] + [""] * (len(rows[0]) - 1), *rows[-half:]]


def format_cycles(scores: Scores) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Titles with units, and one row per cycle, of the main metrics that at least one cycle defines."""
    pooled = pool_legs(scores)
    main = select_main(pooled, count_legs(scores))
    columns = [map(format_number, pooled[name] * shown.factor) for name, shown in main.items()]
    cycles = range(1, len(next(iter(pooled.values()))) + 1)
    rows = [list(row) for row in zip(map(str, cycles), *columns, strict=True)]
    return [("cycle", ""), *((shown.title, shown.unit) for shown in main.values())], shorten(rows)
