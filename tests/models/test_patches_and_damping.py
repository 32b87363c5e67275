"""Ground in patches of different stiffness, and the force of ground with damping."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.grounds import still_ground

from cmacexp.models.ground import contact_force, damped_force, damped_spring, stiffness_at

PATCHY = still_ground(1e4, 0.15, 0.5, 0)
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


def test_a_patch_begins_with_its_lower_edges():
    ground = PATCHY._replace(patch_size=0.25)  # whose multiples are exact
    for i, j in ((0, 0), (3, -2), (-5, 7)):
        assert stiffness_at(ground, i * 0.25, j * 0.25) == stiffness_at(ground, (i + 0.5) * 0.25, (j + 0.5) * 0.25)


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
