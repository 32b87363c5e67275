"""Rates of the body, and posture control's own derivative."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.rollout import roll_out

from cmacexp.control.hybrid_kernels import METHODS, hybrid_feedback, new_hybrid_state, posture_rate_term, posture_term
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import LEVEL, make_pose
from cmacexp.models.leg import trigonometry
from cmacexp.sensors.kernels import Observation


@pytest.mark.parametrize("substeps", [1, 3])
def test_rates_of_a_body_are_its_change_over_the_sampling_period(make_config, substeps):
    scenario = make_scenario(make_config("scenario=quadruped", f"plant.substeps={substeps}"))
    last, largest = scenario.first, 0.0
    assert_array_equal(last.body_rate, np.zeros(3))
    for k in range(20):
        new = scenario.plant.step(np.array([(-6.0, -1.5), (-6.5, -1.2), (6.0, 1.5), (5.5, 1.8)]) * (1.0 + 0.01 * k))
        assert_allclose(new.body_rate, (new.body - last.body) / 0.005, rtol=1e-9, atol=1e-12)
        last, largest = new, np.maximum(np.abs(new.body_rate), largest)
    assert (largest > 1e-4).all()


@pytest.mark.parametrize("scenario", ["one_leg", "force_step"])
def test_without_a_body_nothing_has_a_rate(make_config, scenario):
    plant = make_scenario(make_config(f"scenario={scenario}")).plant
    assert_array_equal(plant.step(np.full((1, 2), 0.3)).body_rate, np.zeros(3))


@pytest.fixture(scope="module")
def hybrid_law(make_config):
    return make_scenario(make_config("scenario=quadruped", "posture.rate_gain=5")).controller.params


rates, tilts = st.floats(-1.0, 1.0), st.floats(-0.3, 0.3)


@given(st.floats(0.4, 0.6), tilts, tilts, rates, rates, rates, st.integers(0, 3))
def test_rate_term_is_the_derivative_of_the_posture_term(hybrid_law, height, pitch, roll, dh, dp, dr, leg):
    params = hybrid_law._replace(posture_gain=5.0)
    body, rate, dt = np.array([height, pitch, roll]), np.array([dh, dp, dr]), 1e-6
    later, before = (posture_term(params, leg, make_pose(body + t * rate)) for t in (dt, -dt))
    expected = pytest.approx((later - before) / (2.0 * dt), abs=1e-7)
    assert posture_rate_term(params, leg, make_pose(body), rate) == expected
    assert posture_rate_term(params._replace(posture_rate_gain=0.0), leg, make_pose(body), rate) == 0.0


def test_one_leg_on_a_stand_has_no_rate_term(make_config):
    params = make_scenario(make_config("scenario=one_leg", "posture.rate_gain=5")).controller.params
    assert posture_rate_term(params, 0, LEVEL, np.ones(3)) == 0.0


def feedback_of(params, support, body_rate):
    """U_y of each leg at its first step, N; feet and references at zero."""
    state, two = new_hybrid_state(4), np.zeros((4, 2))
    trig = np.array([trigonometry(0.3, 1.2)] * 4)
    body = np.array([0.5, 0.0, 0.0])
    observed = Observation(two, two, two, two, np.zeros(4), body, body_rate, trig)
    hybrid_feedback(params, state, support, np.zeros((4, 7)), observed)
    return state.output[:, 1]


@pytest.mark.parametrize(
    ("method", "weight"), [("stiffness", 0.0), ("damping", 1.0), ("combined", 1.0), ("explicit", 0.0)]
)
def test_supporting_feet_are_sent_down_by_gain_times_the_speed_of_a_sinking_hip(hybrid_law, method, weight):
    """A level body sinks by 0.1 m/s and pitches its nose down by 0.2 rad/s; its hips are 0.225 m from its middle."""
    support = np.array([True, True, True, False])
    params = hybrid_law._replace(method=METHODS[method])
    sinking = 0.1 + 0.2 * np.array([0.225, 0.225, -0.225, -0.225])
    expected = weight * params.lead.b0 * params.gains.velocity_gain * 5.0 * np.where(support, sinking, 0.0)
    assert_allclose(feedback_of(params, support, np.array([-0.1, 0.2, 0.0])), expected, rtol=1e-12, atol=1e-12)


def test_a_walk_is_calmed_by_it_and_both_loops_agree(make_config):
    overrides = ("scenario=quadruped", "cycles=2", "feedforward=none")

    def walk(gain, fused=True):
        return roll_out(make_scenario(make_config(*overrides, f"posture.rate_gain={gain}")), fused=fused)

    calm, stepped, without = walk(2), walk(2, fused=False), walk(0)
    assert_array_equal(calm.samples, stepped.samples)
    assert_array_equal(calm.body_samples, stepped.body_samples)
    rocking = [np.diff(run.body_samples[600:, :3], axis=0).std(axis=0) for run in (calm, without)]
    assert (rocking[0] < 0.85 * rocking[1]).all()
