"""What changes during a run: stiffness steps, a payload, sloping ground. Planner and controller do not know of it."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_scenario
from support.grounds import still_ground
from support.rollout import roll_out
from support.walks import HIPS, feet_in_world, in_world

SHORT = ("cycles=1", "sampling_period=0.01")
WALK = ("scenario=quadruped", "learning.start_cycle=1", *SHORT)
CHANGES = {
    "step": ("terrain.step_time=1.8", "terrain.step_factor=3"),
    "payload": ("payload.weight=10", "payload.x=0.1", "payload.y=-0.05", "payload.time=1.8"),
    "slope": ("terrain.slope=0.05", "terrain.slope_start=0.2"),
}
AT = 180
"""The step at 1.8 s."""


@pytest.fixture(scope="module")
def run(make_config):
    """``run("scenario=one_leg")`` gives a rollout; each is made once."""
    return cache(lambda *overrides: roll_out(make_scenario(make_config(*overrides))))


def height_at(slope, start, x):
    return slope * np.maximum(0.0, x - start)


def find_feet(rollout):
    """Feet (steps, 4, 3) relative to the ground below the body's centre."""
    columns = rollout.columns()
    return np.array([*map(feet_in_world, rollout.body_samples, np.stack([columns["x"], columns["y"]], axis=2))])


@pytest.mark.parametrize("change", CHANGES)
def test_the_plan_does_not_know_of_a_change_and_before_it_nothing_is_different(run, change):
    calm, changed = run(*WALK), run(*WALK, *CHANGES[change])
    assert changed.status == "completed"
    planned = ((*setup.plan.reference, *setup.plan.joints) for setup in (changed, calm))
    assert all(np.array_equal(*pair, equal_nan=True) for pair in zip(*planned, strict=True))
    assert not np.array_equal(changed.samples[AT:], calm.samples[AT:])
    if change != "slope":
        assert_array_equal(changed.samples[:AT], calm.samples[:AT])
        assert_array_equal(changed.body_samples[:AT], calm.body_samples[:AT])


# Stiffness


@pytest.mark.parametrize("substeps", [1, 3])
def test_under_one_leg_the_ground_is_of_another_stiffness_from_its_step_on(run, substeps):
    columns = run("scenario=one_leg", *SHORT, f"plant.substeps={substeps}", *CHANGES["step"]).columns()
    stiffness = np.where(np.arange(300) >= AT, 30.0, 10.0)
    assert_allclose(columns["force"][:, 0], stiffness * np.maximum(0.0, columns["y"][:, 0] - 0.5), rtol=1e-12)
    assert columns["force"][AT, 0] > 2.5 * columns["force"][AT - 1, 0] > 0.0


@pytest.mark.parametrize("change", [(*CHANGES["step"], "terrain.step_legs=[4, 1]"), CHANGES["slope"]])
def test_feet_of_a_body_press_the_ground_where_they_are_as_stiff_as_it_is_there(run, change):
    rollout, is_slope = run(*WALK, *change), change == CHANGES["slope"]
    factors = np.where((np.arange(300)[:, None] >= AT) & (not is_slope), [3.0, 1.0, 1.0, 3.0], 1.0)
    columns, x = rollout.columns(), 0.3 / (0.8 * 3.0) * 0.01 * np.arange(300)[:, None]
    higher = height_at(0.05, 0.2, x + HIPS[:, 0] + columns["x"]) - height_at(0.05, 0.2, x)
    sunk = np.maximum(0.0, is_slope * higher - find_feet(rollout)[..., 2])
    assert_allclose(columns["force"], 1e4 * factors * sunk, rtol=1e-6, atol=1e-6)
    assert np.ptp(higher, axis=1).max() > 0.02


# Payload


def test_feet_carry_the_payload_and_its_moments_from_its_time_on(run):
    rollout = run(*WALK, *CHANGES["payload"])
    force = rollout.columns()["force"]
    lies = np.concatenate([in_world(body, [[0.1, -0.05, 0.0]]) for body in rollout.body_samples])
    assert_allclose(force.sum(axis=1), np.where(np.arange(300) >= AT, 50.0, 40.0), atol=1e-8)
    moments = (force[..., None] * find_feet(rollout)).sum(axis=1)
    assert_allclose(moments[AT:, :2], 10.0 * lies[AT:, :2], atol=1e-8)


# Slope


def test_the_ground_of_a_scenario_is_that_of_its_config(make_config):
    scenario = make_scenario(make_config(*WALK, "terrain=patchy", "terrain.patch_seed=9"))
    assert scenario.plant.params.ground == still_ground(1e4, 0.15, 0.5, 9)


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_one_leg_presses_sloping_ground_where_its_foot_is(run, damping):
    overrides = ("scenario=one_leg", *SHORT, "terrain.slope=-0.3", "terrain.slope_start=0.02")
    columns = run(*overrides, f"terrain.damping={damping}").columns()
    x, y, vx, vy = (columns[name][:, 0] for name in ("x", "y", "vx", "vy"))
    sunk = y - 0.5 - 0.3 * np.maximum(0.0, x - 0.02)
    rate = vy - np.where(x > 0.02, 0.3 * vx, 0.0)
    expected = np.where(sunk > 0.0, np.maximum(0.0, 10.0 * sunk + damping * rate), 0.0)
    assert_allclose(columns["force"][:, 0], expected, rtol=1e-9, atol=1e-12)
