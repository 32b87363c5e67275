"""The quadruped with a quasi-static body: order of its integration, its rates, and what its feet press on."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_scenario
from support.doors_B import stiffness_at
from support.rollout import roll_out

from cmacexp.plants.environment import make_ground

HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
TORQUE = -np.array([(6.0, 1.5), (6.5, 1.2), (-6.0, -1.5), (-5.5, -1.8)])
"""Keeps all four feet down, and loads them unevenly."""


@pytest.mark.parametrize(("damping", "order"), [(0, 4.0), (50, 1.0)])
def test_integration_is_of_fourth_order_and_of_first_order_on_damped_ground(make_config, damping, order):
    def after(substeps):
        overrides = ("scenario=quadruped", f"terrain.damping={damping}", f"plant.substeps={substeps}")
        plant = make_scenario(make_config(*overrides)).plant
        for _ in range(2):
            state = plant.step(TORQUE)
        assert (state.force > 0.0).all()
        return np.concatenate([state.q.ravel(), state.dq.ravel(), state.body])

    exact = after(200)
    errors = [np.abs(after(substeps) - exact).max() for substeps in (5, 10, 20)]
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), order, atol=0.5 if order > 1.0 else 0.25)


@pytest.mark.parametrize("substeps", [1, 3])
def test_rates_of_a_body_are_its_change_over_the_sampling_period(make_config, substeps):
    scenario = make_scenario(make_config("scenario=quadruped", f"plant.substeps={substeps}"))
    last, largest = scenario.first, np.zeros(3)
    assert_array_equal(last.body_rate, np.zeros(3))
    for k in range(20):
        new = scenario.plant.step(TORQUE * [[1], [1], [-1], [-1]] * (1.0 + 0.01 * k))
        assert_allclose(new.body_rate, (new.body - last.body) / 0.005, rtol=1e-9, atol=1e-12)
        last, largest = new, np.maximum(np.abs(new.body_rate), largest)
    assert (largest > 1e-4).all()


@pytest.mark.parametrize("scenario", ["one_leg", "force_step"])
def test_without_a_body_nothing_has_a_rate(make_config, scenario):
    plant = make_scenario(make_config(f"scenario={scenario}")).plant
    assert_array_equal(plant.step(np.full((1, 2), 0.3)).body_rate, np.zeros(3))


def test_each_foot_presses_the_patch_that_it_stands_on(make_config):
    walk = ("scenario=quadruped", "cycles=2", "gait.cycle_time=1.5", "feedforward=none")
    config = make_config(*walk, "terrain=patchy", "terrain.patch_seed=5")
    rollout = roll_out(make_scenario(config))
    columns, body, ground = rollout.columns(), rollout.body_samples, make_ground(config.terrain, 0.005)
    x = HIPS[:, 0] + columns["x"] + config.body_speed * 0.005 * np.arange(len(body))[:, None]
    clear = np.abs(x / 0.15 - np.rint(x / 0.15)) > 1e-9
    stiffness = np.array([[stiffness_at(ground, a, y) for a, y in zip(row, HIPS[:, 1], strict=True)] for row in x])
    height, sp, cp, sr, cr = [body[:, :1], *(f(body[:, [n]]) for n in (1, 2) for f in (np.sin, np.cos))]
    aside = (columns["y"] * cr - HIPS[:, 1] * sr) * cp
    depth = (HIPS[:, 0] + columns["x"]) * sp + aside - height
    expected = stiffness * np.maximum(0.0, depth)
    assert_allclose(columns["force"][clear], expected[clear], rtol=1e-9, atol=1e-9)
    assert len(np.unique(stiffness)) > 10
