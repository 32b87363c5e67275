"""Laws of the middle half of an interval on three feet, over which the force error is measured."""

import numpy as np
import pytest
from support.made_traces import make_trace, phases

from cmacexp.metrics.block import cut, three_feet


def counted(text, legs, rows=None):
    """Samples of the first leg that count."""
    block = cut(make_trace(text, rows, legs), len(text))
    found = three_feet(block)
    assert (found == found[:, :1]).all()  # of all legs alike
    return "".join("M" if here else "." for here in found[:, 0].ravel())


@pytest.mark.parametrize("quarter", [1, 2, 5])
def test_of_four_equal_parts_the_two_in_the_middle_count(quarter):
    once = "T" * 3 + "S" * 4 * quarter
    middle = "..." + "." * quarter + "M" * 2 * quarter + "." * quarter
    assert counted(once, 3) == middle
    assert counted(once, 3, rows=2 * len(once)) == 2 * middle


@pytest.mark.parametrize("legs", [1, 2, 4])
def test_on_more_or_fewer_feet_no_sample_counts(legs):
    assert "M" not in counted("TTTSSSSSSSS", legs)


def test_an_interval_that_straddles_cycles_is_one():
    assert counted("SSSSTTTSSSS", 3, rows=22) == 2 * "MM.......MM"


def test_an_interval_that_the_run_cuts_short_counts_as_far_as_it_goes():
    whole = counted("TTTSSSSSSSS", 3)
    for rows in range(12, 22):
        assert counted("TTTSSSSSSSS", 3, rows=rows)[:rows] == (2 * whole)[:rows]
        assert "M" not in counted("TTTSSSSSSSS", 3, rows=rows)[rows:]


@pytest.mark.parametrize("stands", [0, 1, 3])
def test_every_transfer_of_a_wave_is_an_interval_of_its_own(stands):
    """One leg after the other lifts for four samples; between them all four stand."""
    cycle = "TTTT" + "S" * (12 + 4 * stands)
    phase, progress = (
        np.stack([np.roll(values, (4 + stands) * leg) for leg in range(4)], axis=1) for values in phases(cycle)
    )
    block = cut(make_trace(cycle, legs=4, phase=phase, progress=progress), len(cycle))
    assert three_feet(block)[0, 2].tolist() == 4 * [False, True, True, False, *[False] * stands]
