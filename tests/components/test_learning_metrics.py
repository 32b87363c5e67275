"""Each cycle against the first: ratios, and the cycles that learning takes to 1/e."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.made_traces import NOTHING, make_trace, measure

from cmacexp.metrics import compute
from cmacexp.metrics.learning import LEARNED, cycles_to_1_e, ratio_to_first
from cmacexp.metrics.registry import METRICS

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def of_one_leg(function, values):
    return function(np.array(values)[:, None])[:, 0]


def test_ratio_is_that_to_the_first_cycle():
    assert_allclose(of_one_leg(ratio_to_first, [4.0, 6.0, 2.0, 0.0]), [1.0, 1.5, 0.5, 0.0])


def test_ratio_of_signed_errors_is_that_of_their_sizes():
    assert_allclose(of_one_leg(ratio_to_first, [-0.4, 0.2, -0.1]), [1.0, 0.5, 0.25])


@pytest.mark.parametrize("first", [0.0, NOTHING])
def test_without_a_first_value_nothing_is_known_of_learning(first):
    assert np.isnan(of_one_leg(ratio_to_first, [first, 1.0, 0.0])).all()
    assert np.isnan(of_one_leg(cycles_to_1_e, [first, 1.0, 0.0])).all()


@pytest.mark.parametrize(
    ("values", "counts"),
    [
        ([1.0, 0.5, 0.37, 0.36, 0.1], [NOTHING, NOTHING, NOTHING, 3.0, 3.0]),
        ([1.0, 0.1, 0.9, 0.1], [NOTHING, 1.0, 1.0, 1.0]),  # the first time counts, even if it does not last
        ([1.0, 2.0, 1.0, 0.5], [NOTHING] * 4),
        ([1.0, NOTHING, 0.2], [NOTHING, NOTHING, 2.0]),
        ([1.0, 0.2, NOTHING], [NOTHING, 1.0, 1.0]),
        ([1.0, math.exp(-1.0)], [NOTHING, 1.0]),  # at most 1/e
        ([1.0], [NOTHING]),
        ([1.0, 0.0], [NOTHING, 1.0]),
    ],
)
def test_cycles_to_1_e_are_counted_after_the_first_and_known_from_when_they_are_over(values, counts):
    assert_array_equal(of_one_leg(cycles_to_1_e, values), counts)


@pytest.mark.parametrize("constant", [0.7, 2.5, 6.2])
def test_of_a_decaying_error_they_are_its_time_constant_rounded_up(constant):
    error = 0.03 * np.exp(-np.arange(12) / constant)
    assert of_one_leg(cycles_to_1_e, error)[-1] == math.ceil(constant)


def learning(cycles, legs=1):
    """A trace of ``cycles`` cycles of four steps whose errors change from cycle to cycle and leg to leg."""
    rng = np.random.default_rng(7)
    size = (4 * cycles, legs)
    decay = np.repeat(np.exp(-0.4 * np.arange(cycles)), 4)[:, None]
    columns = {name: decay * rng.uniform(0.5, 1.5, size) for name in ("x", "y", "tau_feedback_1")}
    return {"rows": 4 * cycles, "legs": legs, "force": 1.0 + decay * rng.uniform(0.5, 1.5, size), **columns}


def test_each_leg_is_measured_against_its_own_first_cycle():
    x = np.array([[1.0, 10.0], [0.9, 2.0], [0.1, 1.0]]).repeat(2, axis=0)
    metrics = measure("TS", rows=6, legs=2, x=x)
    assert_allclose(metrics["transfer_rmse_x_ratio"], [1.0, 1.0, 0.9, 0.2, 0.1, 0.1])
    assert_allclose(metrics["transfer_rmse_x_cycles_to_1_e"], [NOTHING, NOTHING, NOTHING, 1.0, 2.0, 1.0])


@pytest.mark.parametrize("name", LEARNED)
def test_the_columns_follow_from_the_metric_beside_them(name):
    metrics = measure("TSSS", **learning(8), force_desired=1.0)
    assert_array_equal(metrics[f"{name}_ratio"][:, None], ratio_to_first(metrics[name][:, None]))
    assert_array_equal(metrics[f"{name}_cycles_to_1_e"][:, None], cycles_to_1_e(metrics[name][:, None]))


def test_a_row_knows_nothing_of_later_cycles():
    trace = make_trace("TSSS", **learning(8, legs=2), force_desired=1.0)
    whole = compute(trace, 4)
    for cycles in range(1, 8):
        begun = compute(trace.slice(0, 8 * cycles), 4)
        for name in METRICS:
            assert_array_equal(
                begun.column(name).to_numpy(), whole.column(name).to_numpy()[: 2 * cycles], err_msg=name
            )
