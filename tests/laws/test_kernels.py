"""Laws of kernels that a walk uses at every step: balance, loads, rates, known torques, inputs of components."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.rollout import roll_out

from cmacexp.feedforward.kernels import feedforward_step
from cmacexp.feedforward.none import NoFeedforward
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.step import copy_measurement
from cmacexp.models.body import Load, Slope, newton_step
from cmacexp.models.leg import forward_dynamics, trigonometry
from cmacexp.models.mechanism import get_leg
from cmacexp.planning.columns import Y
from cmacexp.plants.kernels import Payload, advance, compute_load
from cmacexp.plants.protocol import Measurement, get_state
from cmacexp.sensors.kernels import new_observation


@pytest.fixture(scope="module")
def walking(make_config):
    """The scenario of a walk that carries a payload from its fourth step on."""
    return make_scenario(make_config("scenario=quadruped", "payload.weight=5", "payload.x=0.05", "payload.y=-0.02"))


@given(st.floats(0.1, 50.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(0, 9), st.integers(0, 9))
def test_a_load_has_the_weight_and_the_moments_of_body_and_payload(walking, weight, x, y, start, step):
    params = walking.plant.params._replace(payload=Payload(Load(weight, x, y), start))
    load, body = compute_load(params, step), walking.setup.mechanism.weight
    carried = weight if step >= start else 0.0
    assert load.weight == pytest.approx(body + carried)
    assert load.weight * load.x == pytest.approx(carried * x, abs=1e-12)
    assert load.weight * load.y == pytest.approx(carried * y, abs=1e-12)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.3, 30.0]))
def test_a_newton_step_solves_its_equations_where_the_curvature_is_positive_definite(seed, damping):
    drawn = np.random.default_rng(seed).normal(size=(3, 3))
    curvature, gradient = drawn + drawn.T + np.diag([1.0, 2.0, 1.0]), drawn[0]
    a, b, c, d, e, f = curvature[np.triu_indices(3)]
    convex, *step = newton_step(Slope(*gradient, a, b, c, d, e, f), damping)
    damped = curvature + damping * np.eye(3)
    least = np.linalg.eigvalsh(damped).min()
    assert convex == (least > 0.0)
    expected = np.linalg.solve(damped, -gradient) if convex else np.zeros(3)
    assert_allclose(step, expected, rtol=1e-6, atol=1e-9)


def test_ground_with_damping_carries_a_body_at_rest_by_its_stiffness_alone(make_config):
    more = ("terrain.damping=50", "payload.weight=8", "payload.x=0.06", "payload.y=-0.04", "payload.time=0")
    plant = make_scenario(make_config("scenario=quadruped", *more)).plant
    state, load = plant.state, compute_load(plant.params, 0)
    assert (np.abs(state.body[1:]) > 1e-5).all()
    assert_allclose(state.force, state.stiffness * state.pressed, rtol=1e-9)
    assert state.force.sum() == pytest.approx(load.weight)


def test_rates_of_a_body_add_up_to_its_motion(walking):
    params, state = walking.plant.params, walking.plant.state
    before, period, moved = state.body.copy(), params.step * params.substeps, np.zeros(3)
    rng = np.random.default_rng(0)
    for _ in range(5):
        advance(params, state, rng.normal(size=(4, 2)))
        moved += period * state.body_rate
    assert (np.abs(moved) > 1e-9).all()
    assert_allclose(moved, state.body - before, atol=1e-14)
    assert state.clock[0] == 5
    assert state.travel[0] == pytest.approx(5 * period * params.speed)


def test_inverse_dynamics_accelerates_every_leg_as_planned_at_every_sample(make_config):
    """Against the force of the desired depression; without a feedforward there is no torque."""
    scenario = make_scenario(make_config("scenario=quadruped", "feedforward=inverse_dynamics"))
    setup, output = scenario.setup, np.zeros((4, 2))
    desired, joints, mechanism = setup.plan.desired, setup.plan.joints, setup.mechanism
    pressed = setup.config.assumed_stiffness * np.maximum(0.0, desired[..., Y] - mechanism.hip_height)
    for sample in range(3, len(joints), 60):
        feedforward_step(scenario.feedforward.params, sample, sample, np.ones((4, 2)), output)
        for i, (q1, q2, dq1, dq2, *ddq) in enumerate(joints[sample]):
            leg, trig = get_leg(mechanism, i), trigonometry(q1, q2)
            assert_allclose(forward_dynamics(leg, trig, dq1, dq2, *output[i], pressed[sample, i]), ddq, atol=1e-9)
    nothing = NoFeedforward(NoFeedforward.Config())
    nothing.reset(setup)
    feedforward_step(nothing.params, 7, 7, np.ones((4, 2)), output)
    assert not output.any()


def test_an_external_component_is_given_what_the_loop_has():
    """In the row of its step, and nothing in the others."""
    rng, observed = np.random.default_rng(1), new_observation(3)
    for values in observed:
        values[:] = rng.normal(size=values.shape)
    rows = Measurement(*(np.zeros((2, *values.shape)) for values in get_state(observed)))
    copy_measurement(observed, rows, 1)
    for given_rows, own in zip(get_state(rows), get_state(observed), strict=True):
        assert_array_equal(given_rows, [np.zeros(own.shape), own])


def test_a_point_mass_moves_as_fast_as_its_place_changes(make_config):
    config = make_config("scenario=force_step", "cycles=1")
    columns = roll_out(make_scenario(config)).columns()
    for place, speed in (("x", "vx"), ("y", "vy")):
        moved = np.diff(columns[place][:, 0])
        mean = 0.5 * config.sampling_period * (columns[speed][1:, 0] + columns[speed][:-1, 0])
        assert_allclose(moved, mean, atol=0.02 * np.abs(mean).max() + 1e-15)
    assert np.abs(columns["vy"]).max() > 0.01
