"""Damped ground: it takes energy, never pulls, and relaxes with the time constant c / K_n."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import make_scenario
from support.doors_B import Leg, depth, legs_under_body, make_pose, point_mass
from support.grounds import NO_PAYLOAD, still_ground
from support.rollout import roll_out

from cmacexp.plants.kernels import PlantParams, advance, balance_body, new_state, observe, update_depression

STIFFNESS = 1e4
HIPS = [(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)]


def test_a_point_mass_on_damped_ground_is_a_damped_oscillator():
    """m dd + c d + K y = F from rest at the surface, F = 20 N: by hand, at 0.05 s."""
    mass, stiffness, damping, force, duration = 0.5, 1000.0, 10.0, 20.0, 0.05
    decay = damping / (2.0 * mass)
    omega = np.sqrt(stiffness / mass - decay**2)
    swing = np.exp(-decay * duration) * (np.cos(omega * duration) + decay / omega * np.sin(omega * duration))
    expected, ground, errors = force / stiffness * (1.0 - swing), still_ground(stiffness, damping=damping), []
    for steps in (40, 80, 160):
        params = PlantParams(point_mass(mass, 0.5), ground, NO_PAYLOAD, 0.0, duration / steps, 1)
        state = new_state(1)
        state.q[0], state.stiffness[0] = (0.0, 0.5 + 1e-15), stiffness
        observe(params, state, np.inf)
        for _ in range(steps):
            advance(params, state, np.array([[0.0, force]]))
        errors.append(abs(state.q[0, 1] - 0.5 - expected))
    assert errors[0] < 1e-3 * expected
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4.0, atol=0.5)


def energy_of_leg(state, leg, hip_height, stiffness):
    (q1, q2), (w1, w2) = state.q[0], state.dq[0]
    l1, l2, m1, m2, _ = leg
    knee = l1 * w1 * np.array([-np.sin(q1), np.cos(q1)])
    foot = knee + l2 * (w1 + w2) * np.array([-np.sin(q1 + q2), np.cos(q1 + q2)])
    low = m1 * l1 * np.sin(q1) + m2 * (l1 * np.sin(q1) + l2 * np.sin(q1 + q2))
    pressed = max(0.0, state.foot[0, 1] - hip_height)
    return 0.5 * m1 * knee @ knee + 0.5 * m2 * foot @ foot - 9.81 * low + 0.5 * stiffness * pressed**2


def test_what_a_leg_loses_is_what_the_damping_takes(make_config):
    plant = make_scenario(make_config("scenario=one_leg", "terrain.damping=3", "terrain.stiffness=40")).plant
    leg = Leg(0.35, 0.35, 0.5, 0.5, -1.0)
    plant.state.q[0], plant.state.dq[0] = (1.9, -1.2), (0.0, 0.0)
    mechanism = plant.params.mechanism._replace(hip_height=0.2)
    params = plant.params._replace(mechanism=mechanism, step=2.5e-4, substeps=1)
    observe(params, plant.state, np.inf)
    before, powers = energy_of_leg(plant.state, leg, 0.2, 40.0), [3.0 * plant.state.velocity[0, 1] ** 2]
    for _ in range(400):
        advance(params, plant.state, np.zeros((1, 2)))
        assert plant.state.force[0] > 0.0
        powers.append(3.0 * plant.state.velocity[0, 1] ** 2)
    lost = np.trapezoid(powers, dx=2.5e-4)
    assert lost > 0.1
    assert before - energy_of_leg(plant.state, leg, 0.2, 40.0) == pytest.approx(lost, rel=1e-4)


# A quasi-static body


@pytest.mark.parametrize(("damping", "step"), [(50.0, 0.005), (50.0, 1e-4), (0.1, 0.005), (1e4, 0.005)])
def test_a_step_of_load_sinks_in_with_the_time_constant_of_damping_over_stiffness(damping, step):
    """From 1 mm under 40 N to 1.25 mm, each step of backward Euler by 1/(1 + h K_n / c) nearer, however small c is."""
    mechanism = legs_under_body([Leg(0.35, 0.35, 0.5, 0.5, -1.0)] * 4, 0.5, HIPS, 40.0)
    params = PlantParams(mechanism, still_ground(STIFFNESS, damping=damping), NO_PAYLOAD, 0.0, step, 1)
    state = new_state(4)
    state.foot[:], state.stiffness[:], state.body[:] = (0.0, 0.5), STIFFNESS, (0.5, 0.0, 0.0)
    assert balance_body(params, state, np.inf)
    for weight, gone in ((40.0, 0.0), (50.0, 0.25e-3)):
        params = params._replace(mechanism=mechanism._replace(weight=weight))
        for k in range(12):
            update_depression(params, state)
            assert balance_body(params, state, step)
            left = gone / (1.0 + step * STIFFNESS / damping) ** (k + 1)
            assert 0.5 - state.body[0] == pytest.approx(1e-3 + gone - left, rel=1e-6)
            assert_allclose(state.force, weight / 4.0, rtol=1e-9)


def test_feet_of_a_walking_body_press_by_spring_and_damper(make_config):
    config = make_config(
        "scenario=quadruped", "cycles=1", "terrain.damping=50", "feedforward=none", "gait.cycle_time=1"
    )
    rollout = roll_out(make_scenario(config))
    columns, body = rollout.columns(), rollout.body_samples
    down = np.array([[depth(make_pose(b), hx + x, hy, y) for (hx, hy), x, y in zip(HIPS, xs, ys, strict=True)]
                     for b, xs, ys in zip(body, columns["x"], columns["y"], strict=True)])  # fmt: skip
    rate = np.diff(np.maximum(down, 0.0), axis=0) / 0.005
    expected = np.where(down[1:] > 0.0, np.maximum(0.0, STIFFNESS * down[1:] + 50.0 * rate), 0.0)
    assert_allclose(columns["force"][1:], expected, atol=1e-6)
    assert np.abs(50.0 * rate).max() > 1.0
    assert_allclose(columns["force"].sum(axis=1), 40.0, atol=1e-6)


@pytest.mark.ci
def test_as_damping_goes_the_walk_is_that_on_elastic_ground(make_config):
    def walk(damping):
        walk = ("scenario=quadruped", "cycles=1", f"terrain.damping={damping}", "feedforward=none")
        return roll_out(make_scenario(make_config(*walk))).body_samples[:300]

    gaps = [np.abs(walk(damping) - walk(0.0)).max() for damping in (1e-3, 1e-6)]
    assert 0.0 < gaps[1] < 2e-3 * gaps[0]
    assert gaps[0] < 1e-3
