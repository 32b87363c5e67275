"""The quadruped with a quasi-static body: order of its integration, its rates, and what its feet press on."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_scenario, stiffness_at

from cmacexp.plants.kernels import advance

HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
TORQUE = -np.array([(6.0, 1.5), (6.5, 1.2), (-6.0, -1.5), (-5.5, -1.8)])
"""Keeps all four feet down, and loads them unevenly."""


@pytest.fixture(scope="module")
def scenario_of(make_config):
    """The scenario of a quadruped."""
    return lambda *overrides: make_scenario(make_config("scenario=quadruped", *overrides))


@pytest.mark.parametrize(
    ("ground", "order"),
    [((), 4.0), (("terrain.slope=0.002", "terrain.slope_start=-0.1"), 4.0), (("terrain.damping=50",), 1.0)],
)
def test_integration_is_of_fourth_order_and_of_first_order_on_damped_ground(scenario_of, ground, order):
    """On a slope that begins under the body, too, whose feet it lifts as the body moves on."""

    def after(substeps):
        plant = scenario_of(f"plant.substeps={substeps}", *ground).plant
        state = plant.state
        advance(plant.params, state, TORQUE)
        assert (state.force > 0.0).all()
        return np.concatenate([state.q.ravel(), state.dq.ravel(), state.body])

    coarse, finer, finest = (after(substeps) for substeps in (5, 10, 20))
    found = np.log2(np.abs(coarse - finer).max() / np.abs(finer - finest).max())
    assert found == pytest.approx(order, abs=0.1 * order)


@pytest.mark.parametrize("substeps", [1, 3])
def test_rates_of_a_body_are_its_change_over_the_sampling_period(scenario_of, substeps):
    plant = scenario_of(f"plant.substeps={substeps}").plant
    state = plant.state
    assert_array_equal(state.body_rate, np.zeros(3))
    for k in range(6):
        last = state.body.copy()
        advance(plant.params, state, TORQUE * (1.0 + 0.01 * k))
        assert_allclose(state.body_rate, (state.body - last) / 0.005, rtol=1e-9, atol=1e-12)
    assert (np.abs(state.body_rate) > 1e-4).all()


def test_each_foot_stands_on_the_patch_at_its_place_under_the_travelling_body(scenario_of):
    patchy = ("terrain=patchy", "terrain.patch_seed=5", "terrain.patch_size=0.002")
    scenario = scenario_of(*patchy)
    ground, state, seen = scenario.plant.params.ground, scenario.plant.state, set()
    for k in range(1, 21):
        advance(scenario.plant.params, state, TORQUE)
        x = 0.005 * k * scenario.setup.config.body_speed + HIPS[:, 0] + state.foot[:, 0]
        expected = [stiffness_at(ground, *place) for place in zip(x, HIPS[:, 1], strict=True)]
        assert_allclose(state.stiffness, expected)
        seen |= set(expected)
    assert len(seen) > 10
