"""Laws of damped ground: it takes energy, never pulls, and relaxes with the time constant c / K_n."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from support.grounds import NO_PAYLOAD, still_ground
from support.rollout import roll_out

from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import depth, make_pose
from cmacexp.models.ground import contact_force, damped_force, damped_spring
from cmacexp.models.mechanism import legs_under_body, point_mass
from cmacexp.planning.machine import make_leg
from cmacexp.plants.kernels import PlantParams, advance, balance_body, new_state, observe, update_depression

STIFFNESS = 1e4
HIPS = [(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)]
TORQUE = -np.array([(6.0, 1.5), (6.5, 1.2), (-6.0, -1.5), (-5.5, -1.8)])
"""Keeps all four feet of a quadruped down, and loads them unevenly."""
stiffnesses, dampings = st.floats(1.0, 1e5), st.floats(0.0, 1e3)
depressions, rates = st.floats(-0.1, 0.1), st.floats(-5.0, 5.0)


# The law


@given(stiffnesses, dampings, depressions, rates)
def test_force_is_spring_and_damper_while_the_foot_is_in_the_ground_and_never_a_pull(k, c, d, rate):
    force = damped_force(k, c, d, rate)
    assert force == (max(0.0, k * d + c * rate) if d > 0.0 else 0.0)
    assert damped_force(k, 0.0, d, rate) == contact_force(k, d)


@given(stiffnesses, dampings, st.floats(0.0, 0.1), depressions, st.floats(1e-4, 1.0))
def test_spring_of_a_step_is_the_law_with_the_rate_over_that_step(k, c, before, d, time):
    stiffness, level = damped_spring(k, c, before, time)
    pull = k * d + c * (d - before) / time
    assert stiffness * (d - level) == pytest.approx(pull, rel=1e-9, abs=1e-9 * (k + c / time))
    assert damped_spring(k, c, before, np.inf) == (k, 0.0)


# A point mass


def test_a_point_mass_on_damped_ground_is_a_damped_oscillator():
    """m dd + c d + K y = F from rest at the surface, F = 20 N: by hand, at 0.05 s."""
    mass, stiffness, damping, force, duration = 0.5, 1000.0, 10.0, 20.0, 0.05
    decay = damping / (2.0 * mass)
    omega = np.sqrt(stiffness / mass - decay**2)
    swing = np.exp(-decay * duration) * (np.cos(omega * duration) + decay / omega * np.sin(omega * duration))
    expected = force / stiffness * (1.0 - swing)
    errors = []
    for steps in (40, 80, 160):
        params = PlantParams(
            point_mass(mass, 0.5), still_ground(stiffness, damping=damping), NO_PAYLOAD, 0.0, duration / steps, 1
        )
        state = new_state(1)
        state.q[0], state.stiffness[0] = (0.0, 0.5 + 1e-15), stiffness
        observe(params, state, np.inf)
        for _ in range(steps):
            advance(params, state, np.array([[0.0, force]]))
        errors.append(abs(state.q[0, 1] - 0.5 - expected))
    assert errors[0] < 1e-3 * expected
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4.0, atol=0.5)


# One leg


def test_what_a_leg_loses_is_what_the_damping_takes(make_config):
    config = make_config("scenario=one_leg", "plant.substeps=20", "terrain.damping=3", "terrain.stiffness=40")
    scenario = make_scenario(config)
    plant, leg = scenario.plant, make_leg(config.machine.leg)
    plant.state.q[0], plant.state.dq[0] = (1.9, -1.2), (0.0, 0.0)
    params = plant.params._replace(mechanism=plant.params.mechanism._replace(hip_height=0.2))

    def energy(state):
        (q1, q2), (w1, w2) = state.q[0], state.dq[0]
        l1, l2, m1, m2 = leg[:4]
        knee = l1 * w1 * np.array([-np.sin(q1), np.cos(q1)])
        foot = knee + l2 * (w1 + w2) * np.array([-np.sin(q1 + q2), np.cos(q1 + q2)])
        low = m1 * l1 * np.sin(q1) + m2 * (l1 * np.sin(q1) + l2 * np.sin(q1 + q2))
        pressed = max(0.0, state.foot[0, 1] - 0.2)
        return 0.5 * m1 * knee @ knee + 0.5 * m2 * foot @ foot - 9.81 * low + 20.0 * pressed**2

    observe(params, plant.state, np.inf)
    before, powers, params = energy(plant.state), [], params._replace(step=2.5e-4, substeps=1)
    for _ in range(400):
        powers.append(3.0 * plant.state.velocity[0, 1] ** 2)
        advance(params, plant.state, np.zeros((1, 2)))
        assert plant.state.force[0] > 0.0
    powers.append(3.0 * plant.state.velocity[0, 1] ** 2)
    lost = np.trapezoid(powers, dx=2.5e-4)
    assert lost > 0.1
    assert before - energy(plant.state) == pytest.approx(lost, rel=1e-4)


# A quasi-static body


@pytest.fixture
def standing(make_config):
    """A quadruped's law and state, standing level on four straight-down feet, balanced under 40 N."""

    def stand(damping, step):
        config = make_config("scenario=quadruped")
        legs = [make_leg(config.machine.legs.left_front)] * 4
        params = PlantParams(
            legs_under_body(legs, 0.5, HIPS, 40.0), still_ground(STIFFNESS, damping=damping), NO_PAYLOAD, 0.0, step, 1
        )
        state = new_state(4)
        state.foot[:], state.stiffness[:], state.body[:] = (0.0, 0.5), STIFFNESS, (0.5, 0.0, 0.0)
        assert balance_body(params, state, np.inf)
        update_depression(params, state)
        return params, state

    return stand


def settle(params, state, steps):
    """Depression of each step, m."""
    sunk = []
    for _ in range(steps):
        assert balance_body(params, state, params.step)
        update_depression(params, state)
        sunk.append(0.5 - state.body[0])
        assert_allclose(state.force.sum(), params.mechanism.weight, rtol=1e-9)
    return np.array(sunk)


@pytest.mark.parametrize(("damping", "step"), [(50.0, 0.005), (50.0, 1e-4), (0.1, 0.005), (1e4, 0.005)])
def test_a_step_of_load_sinks_in_with_the_time_constant_of_damping_over_stiffness(standing, damping, step):
    """From 1.00 to 1.25 mm, each step of backward Euler by 1/(1 + h K_n / c) nearer; stable however small c is."""
    params, state = standing(damping, step)
    heavier = params._replace(mechanism=params.mechanism._replace(weight=50.0))
    left = 1.25e-3 - settle(heavier, state, 12)
    assert_allclose(left, 0.25e-3 / (1.0 + step * STIFFNESS / damping) ** np.arange(1, 13), rtol=1e-6, atol=1e-12)


def test_at_rest_damping_changes_nothing(standing):
    params, state = standing(50.0, 0.005)
    assert_allclose(settle(params, state, 5), 1e-3, rtol=1e-9)
    assert_allclose(state.force, 10.0, rtol=1e-9)


def test_as_damping_goes_the_walk_is_that_on_elastic_ground(make_config):
    def walk(damping):
        return roll_out(make_scenario(make_config("scenario=quadruped", "cycles=2", f"terrain.damping={damping}")))

    elastic, damped_little, less = walk(0.0), walk(1e-3), walk(1e-6)
    gaps = [np.abs(run.body_samples[:300] - elastic.body_samples[:300]).max() for run in (damped_little, less)]
    assert 0.0 < gaps[1] < 2e-3 * gaps[0]
    assert gaps[0] < 1e-3


def test_feet_of_a_walking_body_press_by_spring_and_damper(make_config):
    config = make_config("scenario=quadruped", "cycles=1", "terrain.damping=50", "feedforward=none")
    rollout = roll_out(make_scenario(config))
    columns, body = rollout.columns(), rollout.body_samples
    down = np.array([[depth(make_pose(b), hx + x, hy, y) for (hx, hy), x, y in zip(HIPS, xs, ys, strict=True)]
                     for b, xs, ys in zip(body, columns["x"], columns["y"], strict=True)])  # fmt: skip
    pressed = np.maximum(down, 0.0)
    rate = np.diff(pressed, axis=0) / 0.005
    expected = np.where(down[1:] > 0.0, np.maximum(0.0, 1e4 * down[1:] + 50.0 * rate), 0.0)
    assert_allclose(columns["force"][1:], expected, atol=1e-6)
    assert np.abs(50.0 * rate).max() > 1.0
    assert_allclose(columns["force"].sum(axis=1), 40.0, atol=1e-6)


def test_a_finer_integration_nears_one_motion_with_its_step(make_config):
    def after(substeps):
        overrides = ("scenario=quadruped", "terrain.damping=50", f"plant.substeps={substeps}")
        plant = make_scenario(make_config(*overrides)).plant
        for _ in range(4):
            state = plant.step(TORQUE)
        return np.concatenate([state.q.ravel(), state.dq.ravel(), state.body])

    exact = after(400)
    errors = [np.abs(after(substeps) - exact).max() for substeps in (5, 10, 20)]
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.2)
