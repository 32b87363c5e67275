"""The body against plain rotations: depth and energy of its feet, and balance on elastic ground."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.walks import HIPS, feet_in_world, in_world

from cmacexp.models.body import Load, balance, depth, make_pose

WEIGHT = 40.0
LEVEL = np.zeros(4)
LOAD = Load(WEIGHT, 0.0, 0.0)


def find_balance(foot, stiffness, start=(0.5, 0.0, 0.0)):
    """Whether there is a balance, the body and the forces."""
    body, force = np.array(start, dtype=float), np.zeros(len(foot))
    found = balance(HIPS, foot, np.asarray(stiffness, dtype=float), LEVEL, LOAD, body, force)
    return found, body, force


tilts = st.floats(-0.4, 0.4)
within = st.floats(-0.6, 0.6)


@st.composite
def standing(draw):
    """Feet (4, 2) in the frames of their hips, about as deep as they would press a level body, and K_n under each.

    Of some one is up in the air, and the centre of gravity within the polygon of the others.
    """
    stiffness = np.array([draw(st.floats(5e3, 5e4)) for _ in range(4)])
    down = 0.5 + np.array([draw(st.floats(6.0, 14.0)) for _ in range(4)]) / stiffness
    foot = np.column_stack([[draw(st.floats(-0.12, 0.12)) for _ in range(4)], down])
    if draw(st.booleans()):
        leg = draw(st.integers(0, 3))
        foot[leg, 1] -= 0.1
        foot[:, 0] = np.sign(HIPS[leg, 0]) * draw(st.floats(0.06, 0.15))  # towards where the lifted foot is missing
        foot[3 - leg, 0] = 0.0
    return foot, stiffness


# Depth and energy


@given(st.floats(0.3, 0.6), tilts, tilts, within, within, within)
def test_depth_is_that_of_the_turned_point(height, pitch, roll, x, y, down):
    """Pitch is positive nose down, roll right side down."""
    body = np.array([height, pitch, roll])
    expected = -in_world(body, np.array([[x, y, -down]]))[0, 2]
    assert depth(make_pose(body), x, y, down) == pytest.approx(expected, abs=1e-12)


# Balance


@given(standing(), st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_forces_in_balance_carry_the_weight_and_no_moment_wherever_the_search_starts(case, shift):
    foot, stiffness = case
    found, body, force = find_balance(foot, stiffness)
    world = feet_in_world(body, foot)
    assert found
    assert_allclose([force.sum() - WEIGHT, force @ world[:, 0], force @ world[:, 1]], 0.0, atol=1e-9 * WEIGHT)
    assert_allclose(force, stiffness * np.maximum(0.0, -world[:, 2]), atol=1e-8 * WEIGHT)
    assert (force > 0.0).sum() == (foot[:, 1] > 0.5).sum()
    for start in (body + shift, np.array([0.5, 0.0, 0.0]) + shift):
        _, other, again = find_balance(foot, stiffness, start)
        assert_allclose(other, body, atol=1e-10)
        assert_allclose(again, force, atol=1e-6)
    found, same, again = find_balance(foot, stiffness, start=body)
    assert found
    assert_array_equal(same, body)
    assert_array_equal(again, force)


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_it_finds_balance_on_ground_of_any_stiffness(stiffness):
    foot = np.column_stack([[0.05, -0.05, 0.02, 0.0], 0.5 + np.array([9.0, 11.0, 10.5, 9.5]) / stiffness])
    found, body, force = find_balance(foot, np.full(4, stiffness))
    assert found
    assert force.sum() == pytest.approx(WEIGHT, rel=1e-6)
    assert_allclose(body, [0.5, 0.0, 0.0], atol=100.0 / stiffness)


UP = -5.0
"""Height of a foot that never comes down, m below its hip."""
NOWHERE = {
    "feet on the left alone": [(0.0, 0.5), (0.0, UP), (0.0, 0.5), (0.0, UP)],
    "feet in front alone": [(0.0, 0.5), (0.0, 0.5), (0.0, UP), (0.0, UP)],
    "all feet in front": [(0.3, 0.5), (0.3, 0.5), (0.6, 0.5), (0.6, 0.5)],
    "one foot": [(0.0, 0.5), (0.0, UP), (0.0, UP), (0.0, UP)],
    "no foot": [(0.0, UP)] * 4,
    "feet that are nowhere": [(np.nan, np.nan)] * 4,
}


@pytest.mark.parametrize("feet", NOWHERE)
def test_where_there_is_no_balance_the_search_says_so(feet):
    assert not find_balance(np.array(NOWHERE[feet]), [1e4] * 4)[0]


def test_ground_too_soft_for_the_height_of_the_body_lets_it_topple():
    """Tilting stiffness K_n sum d^2 against W h: below it a level body is a maximum of the energy, not a minimum."""
    critical = WEIGHT * 0.5 / (4.0 * 0.225**2)
    level = np.tile([0.0, 0.5], (4, 1))
    tilt = (0.5 - 10.0 / critical, 0.01, 0.0)
    assert abs(find_balance(level, [1.3 * critical] * 4, tilt)[1][1]) < 1e-6
    found, body, _ = find_balance(level, [0.9 * critical] * 4, tilt)
    assert not found or abs(body[1]) > 0.05
