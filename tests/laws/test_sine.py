"""The project's sine and cosine against those of the C library."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cmacexp.jit.compiler import program
from cmacexp.models.sine import FURTHEST, sine_cosine

compiled = program(sine_cosine).compiled
angles = st.one_of(st.floats(-4.0, 4.0), st.floats(-1e5, 1e5), st.integers(-99, 99).map(lambda n: n * math.pi / 4))


def close(value, exact, angle):
    """Within two units of the last place; near a zero there are no digits to count, only what the angle lost."""
    return abs(value - exact) <= 2.0 * np.spacing(abs(exact)) + 1e-26 * abs(angle)


@given(angles)
@example(0.0)
@example(math.pi)
@example(math.nextafter(-FURTHEST, 0.0))
def test_sine_and_cosine_are_within_two_units_of_the_last_place(angle):
    s, c = sine_cosine(angle)
    assert close(s, math.sin(angle), angle)
    assert close(c, math.cos(angle), angle)


@given(angles)
def test_plain_python_gives_the_same_bits(angle):
    assert np.array(sine_cosine(angle)).tobytes() == np.array(compiled(angle)).tobytes()


@pytest.mark.parametrize("angle", [math.inf, -math.inf, math.nan, FURTHEST, -1e300])
def test_an_angle_too_large_has_none(angle):
    for pair in (sine_cosine(angle), compiled(angle)):
        assert np.isnan(pair).all()
