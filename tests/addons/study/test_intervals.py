"""Intervals of samples: what the statistics of every verdict must give, and what a run that failed counts as."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.made_studies import made_errors, made_row

from cmacexp.addons.study.interval import EXACT, FEW, RANGE, UNPAIRED, Interval, estimate
from cmacexp.addons.study.samples import per_seed, quotients, relative
from cmacexp.addons.study.views import completed, over_cycles, tabulate
from cmacexp.study import Results, at_most


def last_error(results: Results) -> np.ndarray:
    return results.at(5, "transfer_rmse_x")


def test_wilson_s_interval_of_38_of_40():
    """Agresti & Coull 1998: (p + z^2/2n -+ z sqrt(pq/n + z^2/4n^2)) / (1 + z^2/n)."""
    z, p, n = 1.959964, 0.95, 40
    centre, reach = p + z**2 / (2 * n), z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    found = estimate([True] * 38 + [False] * 2)
    expected = [(centre - reach) / (1 + z**2 / n), (centre + reach) / (1 + z**2 / n)]
    assert (found.low, found.high) == pytest.approx(expected)
    assert found.size == "38 of 40"


def test_values_that_nothing_changes_are_exact():
    assert estimate([2.0, 2.0, 2.0]) == Interval(2.0, 2.0, 2.0, 3, EXACT)


def test_fewer_than_ten_values_have_student_s_t_and_more_a_bootstrap():
    three = estimate([-1.0, 0.0, 1.0])
    reach = 4.302653 / math.sqrt(3)  # 97.5 % quantile of Student's t with two degrees of freedom; deviation 1
    assert (three.low, three.value, three.high) == pytest.approx((-reach, 0.0, reach))
    many = estimate(np.random.default_rng(0).normal(5.0, 1.0, 100))
    assert many.low < 5.0 < many.high
    assert many.high - many.low == pytest.approx(2 * 1.96 * 0.1, rel=0.35)
    assert estimate([1.0] * 5 + [1.1] * 4 + [1e9]).value == pytest.approx(1.05, abs=0.02)  # outliers do not move it


def test_few_positive_values_have_an_interval_of_their_logarithms():
    ratios = np.array([0.5, 0.8, 1.25, 2.0])
    found, turned = (estimate(each) for each in (ratios, 1.0 / ratios))
    assert (found.value, found.low, found.high) == pytest.approx((1.0, 1.0 / turned.high, 1.0 / turned.low))
    errors = estimate([0.00074, 0.0009, 0.00083, 0.0121, 0.0007])  # one walk of five is far off
    assert 0.0 < errors.low < 0.001 < errors.value < errors.high
    assert estimate([1e-300, 1e300]).low == 0.0


@pytest.mark.parametrize("count", [3, FEW + 2])
def test_conditions_chosen_by_hand_have_a_median_and_a_range(count):
    values = np.linspace(-1.0, 4.0, count)
    found = estimate(values, picked=True)
    assert (found.low, found.high, found.count, found.method) == (-1.0, 4.0, count, RANGE)
    assert found.value == pytest.approx(1.5)
    rows = [row for value in values for row in made_errors(value).rows]
    assert Results(rows).has_picked_conditions
    assert not Results([replace(row, seeded=True) for row in rows]).has_picked_conditions
    assert not Results([*rows, *made_errors(1.0, seed=1).rows]).has_picked_conditions


def test_a_few_values_of_which_one_is_zero_have_a_range_that_is_not_negative():
    assert estimate([0.0, 1.0, 4.0]) == Interval(1.0, 0.0, 4.0, 3, RANGE)


@pytest.mark.nightly
@pytest.mark.parametrize("size", [3, 5, 9, FEW, 20])
@pytest.mark.parametrize("signed", [False, True])
def test_intervals_cover_the_true_value_in_95_per_cent_of_the_draws(size, signed):
    """Of normal values, and of positive values whose median is 1; the limits are those of 2,000 draws."""
    drawn = np.random.default_rng(3).normal(0.0, 0.3, (2000, size))
    samples, truth = (drawn, 0.0) if signed else (np.exp(drawn), 1.0)
    found = [estimate(sample, signed=signed) for sample in samples]
    assert 0.93 <= np.mean([each.low <= truth <= each.high for each in found]) <= 0.97


def test_runs_that_failed_are_counted_apart_and_meet_no_limit():
    sample = last_error(made_errors(0.1, 0.3, math.nan))
    assert sample.tolist() == [0.1, 0.3, math.inf]
    found = estimate(sample)
    assert (found.size, found.failed, found.reach) == ("2 of 3", 1, math.inf)
    assert found.value == pytest.approx(math.sqrt(0.03))
    assert not at_most(1e9).contains(found)
    # The worst of a metric that should be large.
    assert made_errors(math.nan).at(5, "feedforward_share").tolist() == [0.0]


def test_a_pair_whose_reference_failed_says_nothing():
    found = estimate(quotients(np.array([1.0, 2.0, math.inf, 1.0]), np.array([2.0, math.inf, 1.0, 2.0])))
    assert (found.value, found.size, found.failed, found.unpaired) == (0.5, "2 of 4", 1, 1)
    assert quotients(np.ones(1), np.full(1, math.inf)).tolist() == [UNPAIRED]


def test_a_ratio_is_that_of_the_same_seed_and_infinite_where_the_run_ended():
    own = Results([*made_errors(2.0, seed=0).rows, *made_errors(4.0, seed=1).rows])
    other = Results([run for seed, error in ((1, 6.0), (0, 1.0), (1, math.nan))
                     for run in made_errors(error, seed=seed).rows])  # fmt: skip
    ratios = relative(other, own, last_error)
    assert ratios.tolist() == pytest.approx([1.5, 0.5, math.inf])
    assert per_seed(other, ratios, min).tolist() == pytest.approx([1.5, 0.5])


def test_groups_of_runs_are_tabulated_and_drawn_by_their_settings():
    groups = {("soft", "a"): [0.001], ("soft", "b"): [0.009], ("hard", "a"): [0.002, math.nan]}
    results = Results(
        [row for (walk, law), errors in groups.items() for row in made_errors(*errors, walk=walk, law=law).rows]
    )
    table = tabulate(results, {"walk": "ground", "law": "law"}, {"done": completed, "error": last_error})
    assert table.to_numpy().tolist() == [
        ["soft", "a", "1 of 1", pytest.approx(0.001)],
        ["soft", "b", "1 of 1", pytest.approx(0.009)],
        ["hard", "a", "1 of 2", pytest.approx(0.002)],  # of the run that completed
    ]
    assert [
        *results.table[["walk", "status", "cycles"]].values.tolist()[-1],
        *Results([made_row({"transfer_rmse_x": [9.0, 3.0], "transfer_rmse_y": [9.0, 4.0]})]).measure("transfer_rmse"),
    ] == ["hard", "fell", 2, 5.0]
    assert [  # but for the run that fell in its first cycle
        line.name
        for line in over_cycles(
            Results([*results.rows, made_row({}, 5, walk="wet")]), "transfer_rmse_x", "walk"
        ).series
    ] == ["soft", "hard"]
