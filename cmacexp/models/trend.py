"""Whether a level rises from cycle to cycle: the test of trend by Mann 1945, for every detection of drift."""

from collections.abc import Sequence
from itertools import combinations

WINDOW = 10
"""Cycles over which a trend is tested."""
SIGNIFICANT = 35
"""Least excess of rising over falling pairs among the 45 of a window: 3 standard deviations of chance."""


def count_rises(levels: Sequence[float]) -> int:
    """Rising minus falling pairs of ``levels``, the oldest first."""
    return sum((later > earlier) - (later < earlier) for earlier, later in combinations(levels, 2))
