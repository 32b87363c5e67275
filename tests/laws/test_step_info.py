"""Metrics of one response against cases worked out by hand; the awkward ones are NaN, and nothing warns."""

import doctest
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.made_traces import PERIOD, measure

from cmacexp.metrics import step, step_info
from cmacexp.metrics.step import StepInfo

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

RESPONSE = np.array([0.0, 0.2, 0.6, 1.2, 1.1, 1.0, 1.0, 1.0, 1.0, 1.0])
BY_HAND = StepInfo(
    settled=1.0,
    steady_state_error=0.0,
    overshoot=0.2,
    ripple=0.0,
    rise_time=0.2,
    settling_time=0.5,
    rmse=math.sqrt((1.0 + 0.64 + 0.16 + 0.04 + 0.01) / 10.0),
    iae=(1.0 + 0.8 + 0.4 + 0.2 + 0.1) * PERIOD,
    ise=(1.0 + 0.64 + 0.16 + 0.04 + 0.01) * PERIOD,
    itae=(0.1 * 0.8 + 0.2 * 0.4 + 0.3 * 0.2 + 0.4 * 0.1) * PERIOD,
)


def respond(value, target=1.0, start=None, begin=0.0):
    return step_info(begin + PERIOD * np.arange(len(value)), value, target, start)


def names_that_are_nan(info):
    return {name for name, value in info._asdict().items() if math.isnan(value)}


EVERY = set(StepInfo._fields)
OF_THE_WAY = {"steady_state_error", "overshoot", "rise_time", "settling_time"}


def test_a_response_is_what_it_is_by_hand():
    assert_allclose(respond(RESPONSE), BY_HAND, atol=1e-12)


def test_the_examples_of_the_documentation_run():
    tried = doctest.testmod(step)
    assert tried.attempted > 0
    assert tried.failed == 0


@pytest.mark.parametrize(("start", "target"), [(0.0, -1.0), (1.0, 0.0), (-3.0, -4.0), (5.0, 4.0)])
def test_a_response_downwards_has_the_metrics_of_the_same_one_upwards(start, target):
    down = respond(start - RESPONSE, target)
    assert_allclose(down._replace(settled=1.0), BY_HAND, atol=1e-12)
    assert down.settled == pytest.approx(target)


def test_only_the_scale_of_a_response_changes_with_its_unit():
    metres, millimetres = respond(RESPONSE), respond(1e3 * RESPONSE, 1e3)
    factors = StepInfo(1e3, 1.0, 1.0, 1e3, 1.0, 1.0, 1e3, 1e3, 1e6, 1e3)
    assert_allclose(millimetres, np.multiply(metres, factors), atol=1e-9)


def test_time_counts_from_the_first_sample():
    assert_allclose(respond(RESPONSE, begin=7.0), respond(RESPONSE), rtol=1e-9, atol=1e-12)


def test_a_response_that_stops_short_settles_where_it_is():
    info = respond(0.5 * RESPONSE)
    assert info.settled == pytest.approx(0.5)
    assert info.steady_state_error == pytest.approx(-0.5)
    assert info.overshoot == pytest.approx(-0.4)
    assert (info.rise_time, info.settling_time) == pytest.approx((0.2, 0.5))


def test_a_response_that_goes_the_wrong_way_overshoots_by_less_than_nothing():
    info = respond([0.0, -0.5, -1.0, -1.0], target=1.0)
    assert (info.steady_state_error, info.overshoot) == pytest.approx((-2.0, -1.0))


def test_a_limit_cycle_neither_rises_nor_settles():
    info = respond([0.0, 1.5, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5])
    assert names_that_are_nan(info) == {"rise_time", "settling_time"}
    assert (info.settled, info.ripple, info.overshoot) == pytest.approx((1.0, 0.5, 0.5))


def test_a_ramp_neither_rises_nor_settles():
    assert names_that_are_nan(respond(np.linspace(0.0, 1.0, 20))) == {"rise_time", "settling_time"}


def test_a_single_sample_has_no_more_than_an_error():
    for info in (respond([3.0]), respond([3.0], start=0.0)):
        assert names_that_are_nan(info) == EVERY - {"rmse"}
        assert info.rmse == 2.0


def test_two_samples_end_with_the_second():
    info = respond([0.0, 1.0])
    assert (info.settled, info.rise_time, info.settling_time) == pytest.approx((1.0, 0.0, 0.1))


def test_a_response_that_never_starts_has_gone_no_way():
    info = respond([0.0] * 6, target=1.0)
    assert names_that_are_nan(info) == {"rise_time", "settling_time"}
    assert (info.steady_state_error, info.overshoot) == (-1.0, -1.0)


def test_without_a_step_nothing_relative_to_it_is_defined():
    assert names_that_are_nan(respond([0.0] * 6, target=0.0)) == OF_THE_WAY
    assert respond([0.0] * 6, target=0.0).iae == 0.0


def test_the_rise_of_a_response_that_is_already_on_its_way_was_not_seen():
    info = respond([0.5, 0.9, 1.0, 1.0, 1.0, 1.0], start=0.0)
    assert names_that_are_nan(info) == {"rise_time"}
    assert info.settling_time == pytest.approx(0.2)


def test_a_response_that_is_there_at_once_settles_in_no_time():
    assert respond([1.0] * 5, start=0.0).settling_time == 0.0


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_of_a_response_that_diverges_nothing_is_defined(value):
    assert names_that_are_nan(respond([0.0, 1.0, value, 1.0])) == EVERY
    assert names_that_are_nan(respond(RESPONSE, target=value)) == EVERY


@pytest.mark.parametrize(
    ("time", "value", "why"),
    [
        ([], [], "one value for each time"),
        ([0.0, 0.1], [1.0], r"shapes \(2,\) and \(1,\)"),
        ([0.0, 0.1, 0.3], [1.0] * 3, "evenly spaced"),
        ([0.0, -0.1, -0.2], [1.0] * 3, "increasing"),
        ([0.0, 0.0, 0.0], [1.0] * 3, "increasing"),
        ([0.0, math.nan, 0.2], [1.0] * 3, "evenly spaced"),
    ],
)
def test_times_that_tell_no_period_are_refused(time, value, why):
    with pytest.raises(ValueError, match=why):
        step_info(time, value, 1.0)


def test_a_support_has_the_metrics_of_the_response_of_its_force():
    metrics = measure("TT" + "S" * len(RESPONSE), force=[0.0, 0.0, *RESPONSE], force_desired=1.0)
    names = StepInfo._fields
    assert_allclose([metrics[f"force_{name}"][0] for name in names], [getattr(BY_HAND, n) for n in names], atol=1e-12)


@pytest.mark.parametrize(("uneven", "refused"), [(1e-9, False), (2e-6, True)])
def test_times_are_even_to_a_millionth_of_their_step(uneven, refused):
    times = PERIOD * np.arange(len(RESPONSE))
    times[3] += uneven * PERIOD
    if refused:
        with pytest.raises(ValueError, match="evenly spaced"):
            step_info(times, RESPONSE, 1.0)
    else:
        assert_allclose(step_info(times, RESPONSE, 1.0), respond(RESPONSE), rtol=1e-6, atol=1e-12)
