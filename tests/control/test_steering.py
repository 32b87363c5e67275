"""Steering: a body off its course is moved back by its supporting feet, and caught by those in transfer."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import RobotMachine

from cmacexp.control.steering import (
    LARGEST_COMMAND,
    LARGEST_STATIC_COMMAND,
    LATERAL,
    LONGITUDINAL,
    TURN,
    Steering,
    new_steering,
    steer,
    steer_lateral,
    steer_longitudinal,
)  # fmt: skip

SUPPORT = np.array([True, False, False, True])


def make_steering():
    shape = (0.5, 0.001, 0.25, np.zeros((10, 2)), LARGEST_COMMAND, np.zeros(3))
    return Steering(1.0, 1.0, *shape, 0.3, 0.2, np.zeros(1), np.zeros(4))


@pytest.mark.parametrize(
    ("travel", "which"), [((-0.01, 0, 0), LONGITUDINAL), ((0, -0.01, 0), LATERAL), ((0, 0, -0.01), TURN)]
)
def test_a_body_off_its_course_is_moved_back(travel, which):
    steering = make_steering()
    steer(steering, np.array(travel, dtype=float), 0, 0, SUPPORT)
    assert 0.0 < steering.command[which] <= LARGEST_COMMAND
    assert np.count_nonzero(steering.command) == 1
    steer(steering, 100.0 * np.array(travel), 0, 0, SUPPORT)
    assert steering.command[which] == LARGEST_COMMAND


@pytest.mark.parametrize(("rate", "place"), [(0.5, 0.15), (-0.5, -0.15), (0.9, 0.2), (0.1, 0.0)])
def test_feet_in_transfer_go_where_they_catch_a_body_that_leaves_its_course(rate, place):
    steering = make_steering()
    for step in range(300):
        steer(steering, np.array([0.0, rate * step * steering.period, 0.0]), step, 0, SUPPORT)
    assert_allclose(steering.offset, np.where(SUPPORT, 0.0, place), rtol=1e-3)
    for step in range(300):
        steer(steering, np.zeros(3), step, 0, SUPPORT)
    assert_allclose(steering.offset, 0.0, atol=1e-4)


def test_a_turning_body_moves_its_feet_round_its_centre():
    steering, hips = make_steering(), np.array([[0.2, 0.15], [-0.2, -0.15]])
    steering.command[TURN] = 0.05
    rate, vx = 0.05 * 0.5 / 0.25, -0.5  # of the body, and of a foot that supports
    reference = SimpleNamespace(position=np.ones((2, 3)), velocity=np.array(2 * [[vx, 0.0, 0.0]]))
    for i, (x, y) in enumerate(hips):
        assert steer_longitudinal(steering, hips, i, reference)[1] == pytest.approx(vx + rate * y)
        assert steer_lateral(steering, hips, i, reference)[1] == pytest.approx(-rate * x)
    assert steer_longitudinal(None, hips, 0, reference) == (1.0, vx)
    assert steer_lateral(None, hips, 0, reference) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("pattern", "capture", "most"),
    [("trot", 0.15 + (0.3 / 9.81) ** 0.5, LARGEST_COMMAND), ("wave", 0.0, LARGEST_STATIC_COMMAND)],
)
def test_a_robot_is_caught_half_a_support_and_the_time_of_its_pendulum_ahead(pattern, capture, most):
    """Raibert 1986, Pratt 2006: feet that catch it lie aside by its speed times this time; a slow gait needs none."""
    gait = SimpleNamespace(pattern=pattern, duty_factor=0.6, cycle_time=0.5)
    posture, hips = SimpleNamespace(course_gain=1.0, heading_gain=2.0), np.array([[0.3, 0.4], [-0.3, 0.0]])
    config = SimpleNamespace(gait=gait, posture=posture, body_speed=0.2, sampling_period=0.001)
    config.machine = object.__new__(RobotMachine)
    sway = SimpleNamespace(position=np.array([[0.01, 0.02], [0.03, 0.02]]))
    mechanism, plan = SimpleNamespace(hips=hips, hip_height=0.3), SimpleNamespace(sway=sway)
    steering = new_steering(SimpleNamespace(config=config, mechanism=mechanism, plan=plan))
    assert (steering.capture, steering.radius, steering.most) == pytest.approx((capture, 0.5, most))
    assert not np.any([*steering.offset, *steering.command])
    assert_allclose(steering.sway, [[0.0, 0.0], [0.02, 0.0]])
