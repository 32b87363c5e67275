"""Mann's test (1945) for a level that rises from cycle to cycle, used by every detection of drift."""

from collections.abc import Sequence
from itertools import combinations

TREND_WINDOW = 10
"""Cycles over which a trend is tested."""
SIGNIFICANT = 35
"""Least excess of rising over falling pairs among the 45 of a window: 3 standard deviations without a trend."""


def count_rises(levels: Sequence[float]) -> int:
    """Count the rising minus the falling pairs of ``levels``, the oldest first."""
    return sum((later > earlier) - (later < earlier) for earlier, later in combinations(levels, 2))
