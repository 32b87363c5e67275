"""Damped ground: it takes energy, never pulls, and relaxes with the time constant c / K_n."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import Leg, depth, legs_under_body, make_pose, make_scenario
from support.grounds import NO_PAYLOAD, still_ground
from support.rollout import roll_out

from cmacexp.plants.kernels import PlantParams, balance_body, new_state, observe, update_depression

STIFFNESS = 1e4
HIPS = [(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)]


@pytest.mark.parametrize(
    ("scenario", "q", "dq"),
    [
        ("one_leg", (1.9, -0.7), (0.5, -0.2)),
        ("one_leg", (1.9, -0.7), (0.5, -60.0)),
        ("force_step", (0.1, 0.6), (0.5, 2.0)),
        ("force_step", (0.1, 0.6), (0.5, -20.0)),
    ],
)
def test_a_foot_on_damped_ground_presses_by_its_depth_and_speed_and_never_pulls(make_config, scenario, q, dq):
    ground = ("terrain.damping=3", "terrain.stiffness=40", "terrain.assumed_stiffness=10")
    plant = make_scenario(make_config(f"scenario={scenario}", *ground)).plant
    plant.state.q[0], plant.state.dq[0] = q, dq
    observe(plant.params, plant.state, np.inf)
    pressed = 40.0 * (plant.state.foot[0, 1] - 0.5) + 3.0 * plant.state.velocity[0, 1]
    assert plant.state.force[0] == pytest.approx(max(0.0, pressed))
    assert (pressed < 0.0) == (dq[1] < -1.0)


# A quasi-static body


@pytest.mark.parametrize(("damping", "step"), [(50.0, 0.005), (50.0, 1e-4), (0.1, 0.005), (1e4, 0.005)])
def test_a_step_of_load_sinks_in_with_the_time_constant_of_damping_over_stiffness(damping, step):
    """From 1 mm under 40 N to 1.25 mm, each step of backward Euler by 1/(1 + h K_n / c) nearer, for any c."""
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
        "scenario=quadruped", "cycles=1", "terrain.damping=50", "feedforward=none", "gait.cycle_time=0.6"
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
