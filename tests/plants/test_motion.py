"""Laws of the built-in plants: what their feet carry, how they move, and that energy is kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from support.doors import make_scenario

from cmacexp.plants.kernels import advance, compute_load, observe


@pytest.fixture(scope="module")
def walking(make_config):
    """The scenario of a walk that carries a payload from its fourth step on."""
    return make_scenario(make_config("scenario=quadruped", "payload.weight=5", "payload.x=0.05", "payload.y=-0.02"))


@given(st.floats(0.1, 50.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(0, 9), st.integers(0, 9))
def test_a_load_has_the_weight_and_the_moments_of_body_and_payload(walking, weight, x, y, start, step):
    params = walking.plant.params
    payload = params.payload._replace(load=params.payload.load._replace(weight=weight, x=x, y=y), start=start)
    load, carried = compute_load(params._replace(payload=payload), step), weight if step >= start else 0.0
    assert load.weight == pytest.approx(walking.setup.mechanism.weight + carried)
    assert [load.weight * load.x, load.weight * load.y] == pytest.approx([carried * x, carried * y], abs=1e-12)


def test_ground_with_damping_carries_a_body_at_rest_by_its_stiffness_alone(make_config):
    more = ("terrain.damping=50", "payload.weight=8", "payload.x=0.06", "payload.y=-0.04", "payload.time=0")
    plant = make_scenario(make_config("scenario=quadruped", *more)).plant
    state = plant.state
    assert (np.abs(state.body[1:]) > 1e-5).all()
    assert_allclose(state.force, state.stiffness * state.pressed, rtol=1e-9)
    assert state.force.sum() == pytest.approx(compute_load(plant.params, 0).weight)


def test_a_point_mass_is_accelerated_in_the_air_and_swings_on_the_ground(make_config):
    plant = make_scenario(make_config("scenario=force_step")).plant
    params, state, push = plant.params, plant.state, np.array([[0.3, -0.2]])
    time, (mass,), surface = (
        5 * params.step * params.substeps,
        params.mechanism.legs[:, 3],
        params.mechanism.hip_height,
    )
    for start, torque, moved, speed in (
        (-1.0, push, push[0] * time**2 / (2.0 * mass), push[0] * time / mass),
        (0.1, 0.0 * push, [0.0, 0.1 * (np.cos(w := time * np.sqrt(params.ground.stiffness / mass)) - 1.0)],
         [0.0, -0.1 * np.sin(w) * w / time]),
    ):  # fmt: skip
        state.q[0], state.dq[0] = (0.0, surface + start), 0.0
        observe(params, state, params.step)
        for _ in range(5):
            advance(params, state, torque)
        assert_allclose(state.foot[0], [moved[0], surface + start + moved[1]], atol=1e-8)
        assert_allclose(state.velocity[0], speed, atol=1e-7)
