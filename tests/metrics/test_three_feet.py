"""The middle half of an interval on three feet, over which the force error is measured."""

import numpy as np
import pytest
from support.made_traces import make_trace, phases

from cmacexp.metrics.block import split_cycles, three_feet


def counted(text, legs=3, cycles=1, rows=None):
    """Samples of the first leg that count."""
    found = three_feet(split_cycles(make_trace(text, rows or cycles * len(text), legs), len(text)))
    assert (found == found[:, :1]).all()  # of all legs alike
    return "".join("M" if here else "." for here in found[:, 0].ravel())


@pytest.mark.parametrize(
    ("text", "legs", "cycles", "middle"),
    [
        ("TTTSSSS", 3, 1, "....MM."),
        ("TTTSSSSSSSS", 3, 2, 2 * ".....MMMM.."),
        ("SSSSTTTSSSS", 3, 2, 2 * "MM.......MM"),  # one that straddles cycles
        *[("TTTSSSSSSSS", legs, 1, 11 * ".") for legs in (1, 2, 4)],
    ],
)
def test_of_four_equal_parts_on_three_feet_the_two_in_the_middle_count(text, legs, cycles, middle):
    assert counted(text, legs, cycles) == middle


def test_an_interval_that_the_run_cuts_short_counts_as_far_as_it_goes():
    whole = counted("TTTSSSSSSSS", cycles=2)
    for rows in range(12, 22):
        assert counted("TTTSSSSSSSS", rows=rows) == whole[:rows].ljust(22, ".")


@pytest.mark.parametrize("stands", [0, 1, 3])
def test_every_transfer_of_a_wave_is_an_interval_of_its_own(stands):
    """One leg after the other lifts for four samples; between them all four stand."""
    cycle = "TTTT" + "S" * (12 + 4 * stands)
    phase, progress = (
        np.stack([np.roll(values, (4 + stands) * leg) for leg in range(4)], axis=1) for values in phases(cycle)
    )
    block = split_cycles(make_trace(cycle, legs=4, phase=phase, progress=progress), len(cycle))
    assert three_feet(block)[0, 2].tolist() == 4 * [False, True, True, False, *[False] * stands]
