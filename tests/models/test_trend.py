"""Trends of a ring of values."""

import numpy as np

from cmacexp.models.trend import WINDOW, count_rises


def test_rises_are_counted_in_a_ring():
    rising = np.arange(WINDOW, dtype=float)
    assert count_rises(rising, WINDOW - 1) == count_rises(np.roll(rising, 4), 3) == WINDOW * (WINDOW - 1) // 2
    assert count_rises(np.ones(WINDOW), 0) == 0
