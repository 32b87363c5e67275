"""Laws of the ground: patches, steps of its stiffness, slope, damping; and of the level pose of what stands on it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.models.body import (
    LEVEL,
    depth,
    depth_rate,
    make_pose,
)
from cmacexp.models.ground import (
    ALL_LEGS,
    NEVER,
    Ground,
    contact_force,
    damped_depression,
    damped_force,
    damped_spring,
    depression_for,
    first_sample,
    grade_at,
    height_at,
    stiffness_at,
    stiffness_under,
)

places = st.floats(-30.0, 30.0)
FLAT = Ground(1e4, 0.15, 0.0, 0, 0.0, NEVER, 1.0, ALL_LEGS, 0.0, 0.0)
PATCHY = FLAT._replace(patch_spread=0.5)
parts = st.floats(0.01, 0.99)
stiffnesses, dampings = st.floats(1.0, 1e5), st.floats(0.0, 1e3)
depressions = st.floats(-0.1, 0.1)


def of_patches(ground):
    """Stiffness in the middle of many patches, (40, 40)."""
    middles = (np.arange(-20, 20) + 0.5) * ground.patch_size
    return np.array([[stiffness_at(ground, x, y) for y in middles] for x in middles])


@given(st.integers(-200, 200), st.integers(-200, 200), parts, parts)
def test_within_a_patch_the_ground_is_of_one_stiffness(i, j, u, v):
    one, other = (stiffness_at(PATCHY, (i + a) * 0.15, (j + b) * 0.15) for a, b in ((u, v), (0.5, 0.5)))
    assert one == other


def test_patches_fill_the_spread_evenly_and_know_nothing_of_their_neighbours_nor_of_another_seed():
    grid, other = of_patches(PATCHY), of_patches(PATCHY._replace(patch_seed=1))
    assert len(np.unique(grid)) == grid.size
    assert_allclose(np.histogram(grid, 4, (0.5e4, 1.5e4))[0] / grid.size, 0.25, atol=0.04)
    assert_array_equal(grid, of_patches(PATCHY))
    for one, next_one in ((grid[1:], grid[:-1]), (grid[:, 1:], grid[:, :-1]), (grid, other)):
        assert abs(np.corrcoef(one.ravel(), next_one.ravel())[0, 1]) < 0.1
    upper = np.triu_indices(40, 1)
    assert abs(np.corrcoef(grid[upper], grid.T[upper])[0, 1]) < 0.1


@given(stiffnesses, dampings, depressions, st.floats(-5.0, 5.0))
def test_force_is_spring_and_damper_while_the_foot_is_in_the_ground_and_never_a_pull(k, c, d, rate):
    assert damped_force(k, c, d, rate) == (max(0.0, k * d + c * rate) if d > 0.0 else 0.0)
    assert damped_force(k, 0.0, d, rate) == contact_force(k, d)


@given(stiffnesses, dampings, st.floats(0.0, 0.1), depressions, st.floats(1e-4, 1.0))
def test_spring_of_a_step_is_the_law_with_the_rate_over_that_step(k, c, before, d, time):
    stiffness, level = damped_spring(k, c, before, time)
    pull = k * d + c * (d - before) / time
    assert stiffness * (d - level) == pytest.approx(pull, rel=1e-9, abs=1e-9 * (k + c / time))
    assert damped_spring(k, c, before, np.inf) == (k, 0.0)


@given(places, places, st.floats(0.01, 1.0), st.integers(0, 2**32 - 1))
def test_patches_deviate_in_proportion_to_the_spread(x, y, spread, seed):
    """From nothing to as much as the stiffness itself."""
    ground, relative = FLAT._replace(patch_seed=seed), []
    for each in (1.0, spread):
        relative.append(stiffness_at(ground._replace(patch_spread=each), x, y) / FLAT.stiffness - 1.0)
    assert 0.0 < abs(relative[0]) <= 1.0
    assert_allclose(relative[1], spread * relative[0], atol=1e-12)


@given(st.integers(0, 15))
def test_a_step_of_stiffness_is_under_the_legs_it_names(legs):
    ground = FLAT._replace(step_at=100, step_factor=3.0, step_legs=legs)
    found = [[stiffness_under(ground, leg, step, 0.0, 0.0) / 1e4 for step in (99, 100)] for leg in range(4)]
    assert found == [[1.0, 3.0 if legs & 2**leg else 1.0] for leg in range(4)]


@given(st.floats(-0.9, 0.9), st.floats(-1.0, 1.0), places)
def test_the_grade_is_the_derivative_of_the_height(slope, start, x):
    ground = FLAT._replace(slope=slope, slope_start=start)
    if abs(x - start) > 1e-3:
        rise = height_at(slope, start, x + 1e-4) - height_at(slope, start, x - 1e-4)
        assert grade_at(ground, x) == pytest.approx(rise / 2e-4, abs=1e-6)


@given(st.floats(1e3, 1e5), st.floats(0.1, 75.0), st.integers(1, 2))
def test_a_depression_lags_behind_its_force_as_a_first_order_filter_does(stiffness, lag, waves):
    """Around a cycle, whatever the lag in samples: a sinusoid is multiplied by 1 / (1 + i w c / K)."""
    samples, step = 1000, 0.001
    phase = 2.0 * np.pi * waves * np.arange(samples) / samples
    force = np.stack([50.0 + 40.0 * np.sin(phase), 50.0 + 40.0 * np.cos(phase)], axis=1)
    found = damped_depression(stiffness, lag * step * stiffness, force, np.ones(force.shape, dtype=bool), step)
    expected = 40.0 / stiffness / (1.0 + 2j * np.pi * waves * lag / samples) * np.exp(1j * phase)
    assert_allclose(found, 50.0 / stiffness + np.stack([expected.imag, expected.real], axis=1), atol=1e-3 / stiffness)


@given(st.integers(0, 10**7), st.sampled_from([0.005, 0.001, 0.01, 1e-4]))
def test_a_change_acts_from_the_first_sample_that_is_not_before_it(sample, period):
    assert first_sample(sample * period, period) == sample
    assert first_sample((sample + 0.01) * period, period) == sample + 1


@given(st.floats(0.0, 1e9))
def test_a_foot_that_touches_down_begins_without_what_it_left_behind(damping):
    support = np.arange(20)[:, None] < 8
    force = np.where(support, 30.0 + np.arange(20.0)[:, None], 0.0)
    found = damped_depression(1e4, damping, force, support, 0.001)
    assert found[0, 0] == depression_for(1e4, force)[0, 0]
    assert np.isfinite(found).all()
    assert not found[~support].any()


@given(*[st.floats(-0.5, 0.5)] * 7)
def test_depth_changes_at_its_rate(pitch, roll, dh, dp, dr, x, y):
    assert make_pose(np.zeros(3)) == LEVEL
    body, rate, short = np.array([0.5, pitch, roll]), np.array([dh, dp, dr]), 1e-6
    after, before = (depth(make_pose(body + s * short * rate), x, y, 0.0) for s in (1.0, -1.0))
    assert depth_rate(make_pose(body), rate, x, y) == pytest.approx((after - before) / (2.0 * short), abs=1e-8)
