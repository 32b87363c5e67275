"""The project's sine and cosine against those of the C library, and their turn against exact arithmetic."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.doors import program

from cmacexp.models.leg import trigonometry, trigonometry_near
from cmacexp.models.sine import FURTHEST, LARGEST_ROTATION, rotate, sine_cosine, sines_cosines

angles = st.one_of(st.floats(-4.0, 4.0), st.floats(-1e5, 1e5), st.integers(-99, 99).map(lambda n: n * math.pi / 4))
turns = st.floats(-LARGEST_ROTATION, LARGEST_ROTATION)
joints = st.floats(-2.0, 2.0)
"""Of which the sum of two is at most 4 rad."""


@given(angles)
@example(0.0)
@example(math.pi)
@example(math.nextafter(-FURTHEST, 0.0))
def test_sine_and_cosine_are_within_two_units_of_the_last_place(angle):
    """Near a zero there are no digits to count, only what the angle lost."""
    for value, exact in zip(sine_cosine(angle), (math.sin(angle), math.cos(angle)), strict=True):
        assert abs(value - exact) <= 2.0 * np.spacing(abs(exact)) + 1e-26 * abs(angle)


@pytest.mark.parametrize("angle", [math.inf, -math.inf, math.nan, FURTHEST, -1e300])
def test_an_angle_too_large_has_none(angle):
    assert np.isnan([sine_cosine(angle), sines_cosines(np.array(angle))]).all()


@pytest.mark.ci
@pytest.mark.usefixtures("compiled")
def test_compiled_they_have_the_same_bits():
    sine, turned = program(sine_cosine), program(rotate)
    rng = np.random.default_rng(0)
    for angle in (*rng.uniform(-1e5, 1e5, 50), *rng.uniform(-4.0, 4.0, 50), math.pi, FURTHEST, math.inf, math.nan):
        pair, by = sine_cosine(angle), rng.uniform(-LARGEST_ROTATION, LARGEST_ROTATION)
        np.testing.assert_array_equal([sine(angle), sines_cosines(np.array(angle))], [pair, pair])
        np.testing.assert_array_equal(turned(*pair, by), rotate(*pair, by))


def turn_exactly(s, c, by):
    """Sine and cosine as fractions; the series leave out less than 1e-24 of them."""
    s, c, by = Fraction(s), Fraction(c), Fraction(by)
    sine = sum((-1) ** n * by ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(6))
    cosine = sum((-1) ** n * by ** (2 * n) / math.factorial(2 * n) for n in range(7))
    return s * cosine + c * sine, c * cosine - s * sine


@given(angles, turns)
@example(0.0, LARGEST_ROTATION)
@example(0.7, -LARGEST_ROTATION)
def test_a_turn_is_within_2e_16_of_the_exact_one(angle, by):
    pair = sine_cosine(angle)
    for value, exact in zip(rotate(*pair, by), turn_exactly(*pair, by), strict=True):
        assert abs(Fraction(value) - exact) < 2e-16


@given(joints, joints, turns, turns)
def test_turned_sines_of_a_leg_are_those_of_its_joints(q1, q2, by_1, by_2):
    turned = trigonometry_near(q1 + by_1, q2 + by_2, trigonometry(q1, q2), q1, q2)
    np.testing.assert_allclose(turned, trigonometry(q1 + by_1, q2 + by_2), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    "by", [(0.07, 0.0), (0.0, -0.07), (0.05, 0.05), (-3.0, 3.0), (math.nan, 0.0), (math.inf, 0.0)]
)
def test_beyond_the_largest_turn_the_sines_of_a_leg_are_computed_anew(by):
    q1, q2 = 1.0 + by[0], 0.5 + by[1]
    turned = trigonometry_near(q1, q2, (9.0, 9.0, 9.0, 9.0), 1.0, 0.5)
    np.testing.assert_array_equal(turned, trigonometry(q1, q2))
