"""Trends of a series of values."""

from cmacexp.models.trend import WINDOW, count_rises


def test_rising_and_falling_pairs_are_counted():
    rising = list(range(WINDOW))
    assert count_rises(rising) == -count_rises(rising[::-1]) == WINDOW * (WINDOW - 1) // 2
    assert count_rises([1.0] * WINDOW) == 0
    assert count_rises([1.0, 3.0, 2.0]) == 1
