"""What the study of the LEAD compensator measures of a scan of loops."""

import pandas as pd
import pytest

from pipelines.lead_design import distance, nearest, resonance

GOOD = (1.05, 10.5, 10.0, True)
PEAKED = (1.20, 10.5, 10.0, True)
FAST = (1.05, 30.0, 10.0, True)
UNSTABLE = (1.05, 10.5, 10.0, False)


def loops(*rows) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=("resonance", "bandwidth", "open_bandwidth", "stable"))


def test_an_unstable_loop_meets_no_objective():
    assert resonance(loops(GOOD, PEAKED, UNSTABLE)) == pytest.approx([0.05, 0.2, float("inf")])
    assert distance(loops(GOOD, FAST, UNSTABLE)) == pytest.approx([0.05, 2.0, float("inf")])


@pytest.mark.parametrize(
    ("rows", "expected"),
    [((GOOD, FAST), 0.05), ((PEAKED, FAST, UNSTABLE), 2.0), ((PEAKED,), float("inf"))],
)
def test_nearest_bandwidth_is_that_of_a_loop_whose_resonance_is_low(rows, expected):
    assert nearest(loops(*rows)) == pytest.approx([expected])
