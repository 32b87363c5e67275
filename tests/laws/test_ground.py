"""Laws of the ground: patches, steps of its stiffness, slope; and of the level pose of what stands on it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import LEVEL, STEEPEST, Load, balance, depth, depth_rate, make_pose
from cmacexp.models.ground import (
    damped_depression,
    depression_for,
    grade_at,
    height_at,
    stiffness_at,
    stiffness_under,
)
from cmacexp.plants.environment import make_ground, make_payload
from cmacexp.plants.kernels import advance

places = st.floats(-30.0, 30.0)
HIPS = np.array([[0.225, 0.225], [0.225, -0.225], [-0.225, 0.225], [-0.225, -0.225]])


@pytest.fixture(scope="module")
def flat(make_config):
    config = make_config("scenario=quadruped")
    return make_ground(config.terrain, config.sampling_period)


@given(places, places, st.floats(0.01, 1.0), st.integers(0, 2**32 - 1))
def test_patches_deviate_in_proportion_to_the_spread(flat, x, y, spread, seed):
    """From nothing to as much as the stiffness itself."""
    ground, relative = flat._replace(patch_size=0.15, patch_seed=seed), []
    for each in (1.0, spread):
        relative.append(stiffness_at(ground._replace(patch_spread=each), x, y) / flat.stiffness - 1.0)
    assert 0.0 < abs(relative[0]) <= 1.0
    assert_allclose(relative[1], spread * relative[0], atol=1e-12)


@pytest.mark.parametrize("legs", [None, [1], [2, 3], [4], [1, 2, 3, 4]])
def test_a_step_of_stiffness_is_under_the_legs_it_names_or_under_all(make_config, legs):
    named = [] if legs is None else [f"terrain.step_legs={legs}"]
    config = make_config("scenario=quadruped", "terrain.step_time=0.5", "terrain.step_factor=3", *named)
    ground = make_ground(config.terrain, config.sampling_period)
    for leg in range(4):
        before, after = (stiffness_under(ground, leg, step, 0.0, 0.0) for step in (99, 100))
        assert before == ground.stiffness
        assert after == ground.stiffness * (3.0 if legs is None or leg + 1 in legs else 1.0)


@given(st.floats(-0.9, 0.9), st.floats(-1.0, 1.0), places)
def test_the_grade_is_the_derivative_of_the_height(flat, slope, start, x):
    ground = flat._replace(slope=slope, slope_start=start)
    if abs(x - start) > 1e-3:
        rise = height_at(slope, start, x + 1e-4) - height_at(slope, start, x - 1e-4)
        assert grade_at(ground, x) == pytest.approx(rise / 2e-4, abs=1e-6)


def test_under_each_foot_of_a_body_the_ground_is_as_high_as_where_the_foot_is(make_config):
    slope = ("terrain.slope=0.05", "terrain.slope_start=0.1")
    plant = make_scenario(make_config("scenario=quadruped", "feedforward=none", *slope)).plant
    params, state = plant.params, plant.state
    for _ in range(4):
        x, places = state.travel[0], state.travel[0] + params.mechanism.hips[:, 0] + state.foot[:, 0]
        rise = height_at(0.05, 0.1, places) - height_at(0.05, 0.1, x)
        assert_allclose(state.level, -rise, atol=1e-12)
        assert np.ptp(rise) > 1e-3
        advance(params, state, np.zeros((4, 2)))


def test_what_never_happens_is_beyond_the_longest_run(flat, make_config):
    longest = 1_000_000 * make_config("scenario=quadruped").steps_per_cycle
    assert flat.step_at > longest
    assert make_payload(make_config("scenario=quadruped").payload, 0.005).start > longest


@given(st.floats(1e3, 1e5), st.floats(0.1, 150.0), st.integers(1, 5))
def test_a_depression_lags_behind_its_force_as_a_first_order_filter_does(stiffness, lag, waves):
    """Around a cycle, whatever the lag in samples: a sinusoid is multiplied by 1 / (1 + i w c / K)."""
    samples, step = 2000, 0.001
    phase = 2.0 * np.pi * waves * np.arange(samples) / samples
    force = np.stack([50.0 + 40.0 * np.sin(phase), 50.0 + 40.0 * np.cos(phase)], axis=1)
    found = damped_depression(stiffness, lag * step * stiffness, force, np.ones(force.shape, dtype=bool), step)
    expected = 40.0 / stiffness / (1.0 + 2j * np.pi * waves * lag / samples) * np.exp(1j * phase)
    assert_allclose(found, 50.0 / stiffness + np.stack([expected.imag, expected.real], axis=1), atol=1e-3 / stiffness)


@given(st.floats(1e3, 1e5), st.floats(0.0, 0.02))
def test_a_little_damping_changes_little_and_none_nothing(stiffness, lag):
    force = np.random.default_rng(0).uniform(0.0, 100.0, (50, 4))
    found = damped_depression(stiffness, lag * stiffness * 0.001, force, np.ones(force.shape, dtype=bool), 0.001)
    assert_allclose(found, depression_for(stiffness, force), rtol=0, atol=(lag + 1e-12) * 100.0 / stiffness)


@given(st.floats(0.0, 1e9))
def test_a_foot_that_touches_down_begins_without_what_it_left_behind(damping):
    support = np.arange(20)[:, None] < 8
    force = np.where(support, 30.0 + np.arange(20.0)[:, None], 0.0)
    found = damped_depression(1e4, damping, force, support, 0.001)
    assert found[0, 0] == depression_for(1e4, force)[0, 0]
    assert np.isfinite(found).all()
    assert not found[~support].any()


def test_a_level_pose_is_that_of_a_body_at_height_0_without_tilt():
    assert make_pose(np.zeros(3)) == LEVEL


@given(*[st.floats(-0.5, 0.5)] * 7)
def test_depth_changes_at_its_rate(pitch, roll, dh, dp, dr, x, y):
    body, rate, short = np.array([0.5, pitch, roll]), np.array([dh, dp, dr]), 1e-6
    after, before = (depth(make_pose(body + s * short * rate), x, y, 0.0) for s in (1.0, -1.0))
    assert depth_rate(make_pose(body), rate, x, y) == pytest.approx((after - before) / (2.0 * short), abs=1e-8)


@pytest.mark.parametrize("angle", [1, 2])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_search_that_begins_beyond_the_steepest_tilt_finds_nothing_either_way(angle, way):
    """Though one that begins less steep finds the level balance."""
    foot, stiffness, force = np.tile([0.0, 0.5], (4, 1)), np.full(4, 1e4), np.zeros(4)
    for tilt, found in ((STEEPEST + 0.01, False), (2.0, False), (6.0, False), (0.2, True)):
        body = np.array([0.3, 0.0, 0.0])
        body[angle] = way * tilt
        assert balance(HIPS, foot, stiffness, np.zeros(4), Load(40.0, 0.0, 0.0), body, force) == found
    assert_allclose(body, [0.5 - 1e-3, 0.0, 0.0], atol=1e-9)
    assert math.isclose(force.sum(), 40.0, rel_tol=1e-9)
