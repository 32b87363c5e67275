"""Actuators: what they may do to a commanded torque, on every leg and joint alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.control.actuator import actuate, new_actuator

PERIOD, LEGS, STEPS = 0.5, 3, 12
limits = st.one_of(st.none(), st.floats(0.1, 3.0))
delays = st.integers(0, 4)
commands = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).normal(size=(2, STEPS, LEGS, 2)))
"""Feedback and feedforward, (2, STEPS, LEGS, 2), N m."""


@pytest.fixture(scope="module")
def config(make_config):
    """Of actuators that do nothing."""
    return make_config().actuator


def act(config, commanded, limit=None, rate_limit=None, delay=0, lag=0.0):
    """Feedback, feedforward and torque that act, (3, steps, L, 2)."""
    config = type(config)(limit, rate_limit, delay, lag)
    actuator = new_actuator(config, PERIOD, commanded.shape[2])
    acting = []
    for step in range(commanded.shape[1]):
        feedback, feedforward = commanded[:, step].copy()
        torque = np.full_like(feedback, np.nan)
        actuate(actuator, step, feedback, feedforward, torque)
        acting.append([feedback, feedforward, torque])
    return np.swapaxes(acting, 0, 1)


@given(commands, delays)
def test_without_limits_what_is_commanded_acts_after_the_delay(config, commanded, delay):
    feedback, feedforward, torque = act(config, commanded, delay=delay)
    late = np.concatenate([np.zeros_like(commanded[:, :delay]), commanded], axis=1)[:, :STEPS]
    assert_array_equal([feedback, feedforward], late)
    assert_array_equal(torque, late.sum(axis=0))


@given(commands, limits, limits, delays)
def test_the_torque_within_both_limits_that_is_nearest_to_the_command_acts(
    config, commanded, limit, rate_limit, delay
):
    """To that of the feedback and of as much feedforward as the limit allows; the feedback gives way."""
    most, change = np.inf if limit is None else limit, np.inf if rate_limit is None else rate_limit * PERIOD
    feedback, feedforward, torque = act(config, commanded, limit, rate_limit, delay)
    wanted = act(config, commanded, delay=delay)
    assert_array_equal(feedforward, np.clip(wanted[1], -most, most))
    assert_allclose(torque, feedback + feedforward, atol=1e-12)
    last = np.zeros((LEGS, 2))
    for sought, acting in zip(wanted[0] + feedforward, torque, strict=True):
        assert_allclose(acting, np.clip(np.clip(sought, -most, most), last - change, last + change), atol=1e-12)
        last = acting


@given(commands, limits, limits, delays, st.floats(0.01, 10.0))
def test_both_parts_follow_the_limited_torques_with_a_first_order_lag(
    config, commanded, limit, rate_limit, delay, lag
):
    limited, lagging = (act(config, commanded, limit, rate_limit, delay, each) for each in (0.0, lag))
    ages = np.arange(STEPS)[:, None] - np.arange(STEPS)
    response = np.where(ages >= 0, -np.expm1(-PERIOD / lag) * np.exp(-np.maximum(ages, 0) * PERIOD / lag), 0.0)
    assert_allclose(lagging, np.einsum("nm,kmlj->knlj", response, limited), atol=1e-9)
    assert_array_equal(lagging[2], lagging[0] + lagging[1])


@given(commands, limits, limits, delays)
def test_joints_do_not_know_of_each_other_nor_of_their_signs(config, commanded, limit, rate_limit, delay):
    acting = act(config, commanded, limit, rate_limit, delay)
    assert_array_equal(act(config, -commanded, limit, rate_limit, delay), -acting)
    alone = np.zeros_like(commanded)
    alone[:, :, 1, 0] = commanded[:, :, 1, 0]
    assert_array_equal(act(config, alone, limit, rate_limit, delay)[..., 1, 0], acting[..., 1, 0])
