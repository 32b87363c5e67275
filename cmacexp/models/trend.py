"""Whether a level rises from cycle to cycle: the test of trend by Mann 1945, for every detection of drift."""

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array

WINDOW = 10
"""Cycles over which a trend is tested."""
SIGNIFICANT = 35
"""Least excess of rising over falling pairs among the 45 of a window: 3 standard deviations of chance."""


@kernel
def count_rises(levels: Array, newest: int) -> int:
    """Rising minus falling pairs of ``levels`` (n,), a ring whose newest value stands at ``newest``."""
    excess, n = 0, levels.shape[0]
    for late in range(1, n):
        for early in range(late):
            rise = levels[(newest + 1 + late) % n] - levels[(newest + 1 + early) % n]
            excess += 1 if rise > 0.0 else -1 if rise < 0.0 else 0
    return excess
