"""Laws of the checks that stop a run: they know no direction, no leg and no joint."""

import numpy as np
import pytest

from cmacexp.loop.stop import DIVERGED, FASTEST_JOINT, FELL, RUNNING, STEEPEST, has_diverged, new_limits, stop_reason
from cmacexp.planning.machine import make_mechanism
from cmacexp.plants.protocol import new_measurement

PERIOD = 0.005
ENTRIES = [(leg, joint) for leg in range(4) for joint in range(2)]
NOT_FINITE = (np.nan, np.inf, -np.inf)


@pytest.fixture
def limits(make_config):
    mechanism = make_mechanism(make_config("scenario=quadruped").machine)
    return new_limits(mechanism, np.full(10, 0.05), PERIOD)


def level(limits, pitch=0.0, roll=0.0, height=None):
    return np.array([limits.mechanism.hip_height if height is None else height, pitch, roll])


def reason(limits, body, force=None):
    state = new_measurement(4)._replace(force=np.ones(4) if force is None else force, body=body)
    return stop_reason(limits, 0, state)


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("which", range(3), ids=["q", "dq", "foot"])
def test_one_value_that_is_not_finite_is_a_divergence(limits, entry, which):
    for value in NOT_FINITE:
        state = [np.zeros((4, 2)) for _ in range(3)]
        assert not has_diverged(limits.mechanism, *state)
        state[which][entry] = value
        assert has_diverged(limits.mechanism, *state)


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_joint_may_be_as_fast_as_the_limit_and_no_faster_either_way(limits, entry, way):
    q, dq, foot = (np.zeros((4, 2)) for _ in range(3))
    dq[entry] = way * FASTEST_JOINT
    assert not has_diverged(limits.mechanism, q, dq, foot)
    dq[entry] = way * np.nextafter(FASTEST_JOINT, np.inf)
    assert has_diverged(limits.mechanism, q, dq, foot)


@pytest.mark.parametrize("leg", range(4))
def test_a_force_that_is_not_finite_is_a_divergence(limits, leg):
    for value in NOT_FINITE:
        force = np.ones(4)
        assert reason(limits, level(limits), force) == RUNNING
        force[leg] = value
        assert reason(limits, level(limits), force) == DIVERGED


@pytest.mark.parametrize("angle", ["pitch", "roll"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_body_may_be_as_steep_as_the_limit_and_no_steeper_either_way(limits, angle, way):
    high = 10.0  # so that no hip is low
    assert reason(limits, level(limits, height=high, **{angle: way * STEEPEST})) == RUNNING
    assert reason(limits, level(limits, height=high, **{angle: way * np.nextafter(STEEPEST, 1.0)})) == FELL
