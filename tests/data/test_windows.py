"""Windows of the cycles of a run: which are asked for, and how long runs are thinned."""

import pytest
from support.doors import BadInput

from cmacexp.data.window import MOST_STEPS, make_window, read_cycles


def test_windows_of_cycles_and_the_thinning_of_long_runs():
    asked = {"3-5": (3, 5), "7": (7, 7), "last": (9, 9), "last9": (1, 9)}
    assert {text: read_cycles(text, 9) for text in asked} == asked
    for text in ("5-3", "0", "10", "last10", "x"):
        with pytest.raises(BadInput, match="--cycles"):
            read_cycles(text, 9)
    kept, sharing = {1: 600, 2: 600}, 3 * MOST_STEPS // 1200
    every = [make_window(kept, sharing=number).every for number in (1, sharing, sharing + 1)]
    assert every == [1, 3, 4]
