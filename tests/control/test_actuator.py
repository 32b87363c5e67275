"""Laws of the actuators: what they may do to a commanded torque, on every leg and joint alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.rollout import roll_out

from cmacexp.config.schema import ActuatorConfig
from cmacexp.control.actuator import actuate, new_actuator
from cmacexp.loop.scenario import make_scenario

PERIOD, LEGS, STEPS = 0.5, 3, 12
limits = st.one_of(st.none(), st.floats(0.1, 3.0))
delays = st.integers(0, 4)
seeds = st.integers(0, 2**32 - 1)


def commands(seed):
    """Feedback and feedforward, (2, STEPS, LEGS, 2), N m."""
    return np.random.default_rng(seed).normal(size=(2, STEPS, LEGS, 2))


def act(limit, rate_limit, delay, commanded, lag=0.0):
    """Feedback, feedforward and torque that act, (3, steps, L, 2)."""
    actuator = new_actuator(ActuatorConfig(limit, rate_limit, delay, lag), PERIOD, commanded.shape[2])
    acting = []
    for step in range(commanded.shape[1]):
        feedback, feedforward = commanded[:, step].copy()
        torque = np.full_like(feedback, np.nan)
        actuate(actuator, step, feedback, feedforward, torque)
        acting.append([feedback, feedforward, torque])
    return np.swapaxes(acting, 0, 1)


@given(seeds, delays)
def test_without_limits_what_is_commanded_acts_after_the_delay(seed, delay):
    commanded = commands(seed)
    feedback, feedforward, torque = act(None, None, delay, commanded)
    late = np.concatenate([np.zeros_like(commanded[:, :delay]), commanded], axis=1)[:, :STEPS]
    assert_array_equal([feedback, feedforward], late)
    assert_array_equal(torque, late.sum(axis=0))


@given(seeds, limits, limits, delays)
def test_torque_is_the_sum_of_its_parts_within_limit_and_rate(seed, limit, rate_limit, delay):
    feedback, feedforward, torque = act(limit, rate_limit, delay, commands(seed))
    assert_allclose(torque, feedback + feedforward, atol=1e-12)
    assert np.abs(torque).max() <= (np.inf if limit is None else limit * (1.0 + 1e-12))
    changes = np.diff(np.concatenate([np.zeros((1, LEGS, 2)), torque]), axis=0)  # from rest
    assert np.abs(changes).max() <= (np.inf if rate_limit is None else rate_limit * PERIOD * (1.0 + 1e-9))


@given(seeds, limits, limits, delays)
def test_it_is_the_torque_within_both_limits_that_is_nearest_to_the_commanded_one(seed, limit, rate_limit, delay):
    """To that of the feedback and of as much feedforward as the limit allows."""
    commanded = commands(seed)
    *_, torque = act(limit, rate_limit, delay, commanded)
    feedback, feedforward, _ = act(None, None, delay, commanded)
    most, change = np.inf if limit is None else limit, np.inf if rate_limit is None else rate_limit * PERIOD
    sought, last = feedback + np.clip(feedforward, -most, most), np.zeros((LEGS, 2))
    for now, acting in zip(sought, torque, strict=True):
        assert_allclose(acting, np.clip(np.clip(now, -most, most), last - change, last + change), atol=1e-12)
        last = acting


@given(seeds, limits, limits)
def test_the_feedback_gives_way_and_the_feedforward_only_where_it_is_too_large_itself(seed, limit, rate_limit):
    commanded = commands(seed)
    _, feedforward, _ = act(limit, rate_limit, 0, commanded)
    most = np.inf if limit is None else limit
    assert_array_equal(feedforward, np.clip(commanded[1], -most, most))


@given(seeds, limits, limits, delays, st.floats(0.01, 10.0))
def test_both_parts_follow_the_limited_torques_with_a_first_order_lag(seed, limit, rate_limit, delay, lag):
    commanded = commands(seed)
    limited, lagging = (act(limit, rate_limit, delay, commanded, each) for each in (0.0, lag))
    ages = np.arange(STEPS)[:, None] - np.arange(STEPS)
    response = np.where(ages >= 0, -np.expm1(-PERIOD / lag) * np.exp(-np.maximum(ages, 0) * PERIOD / lag), 0.0)
    assert_allclose(lagging, np.einsum("nm,kmlj->knlj", response, limited), atol=1e-9)
    assert_array_equal(lagging[2], lagging[0] + lagging[1])


@given(seeds, limits, limits, delays)
def test_joints_do_not_know_of_each_other_nor_of_their_signs(seed, limit, rate_limit, delay):
    commanded = commands(seed)
    acting = act(limit, rate_limit, delay, commanded)
    assert_array_equal(act(limit, rate_limit, delay, -commanded), -acting)
    for leg in range(LEGS):
        for joint in range(2):
            alone = np.zeros_like(commanded)
            alone[:, :, leg, joint] = commanded[:, :, leg, joint]
            assert_array_equal(act(limit, rate_limit, delay, alone)[..., leg, joint], acting[..., leg, joint])


@pytest.mark.parametrize("size", [1e3, 1e12])
def test_one_step_of_any_size_is_climbed_at_the_rate(size):
    commanded = np.full((2, STEPS, LEGS, 2), size)
    *_, torque = act(None, 4.0, 0, commanded)
    assert_allclose(torque[:, 1, 1], 4.0 * PERIOD * np.arange(1, STEPS + 1))


@pytest.mark.parametrize("delay", [1, 3])
def test_in_a_run_the_torque_commanded_at_a_step_acts_so_many_steps_later(make_config, delay):
    late = roll_out(make_scenario(make_config("cycles=1", f"actuator.delay={delay}"))).columns()
    first = roll_out(make_scenario(make_config("cycles=1"))).columns()
    for joint in ("1", "2"):
        torque = late[f"tau_feedback_{joint}"][:, 0]
        assert not torque[:delay].any()
        assert torque[delay] == first[f"tau_feedback_{joint}"][0, 0]
