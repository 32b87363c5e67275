"""Receptive fields of the CMAC."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.cmacs import make_cmac, random_inputs

from cmacexp.cmac.receptive_field import RECEPTIVE_FIELDS, spline


@pytest.mark.parametrize(("field", "at_a_quarter", "mean"), [("linear", 1 / 2, 1 / 2), ("cubic", 1 / 4, 3 / 8)])
def test_a_spline_is_one_in_the_middle_0_at_the_ends_and_has_the_same_sum_over_shifted_layers(
    field, at_a_quarter, mean
):
    kind, layers = RECEPTIVE_FIELDS[field], 8
    assert [spline(kind, place) for place in (0.0, 0.25, 0.5, 1.0)] == [0.0, at_a_quarter, 1.0, 0.0]
    for place in np.linspace(0.0, 1.0, 50):
        assert spline(kind, place) == pytest.approx(spline(kind, 1.0 - place))
        total = sum(spline(kind, (place + j / layers) % 1.0) for j in range(layers))
        assert total == pytest.approx(layers * mean)


@given(
    st.integers(1, 4), st.sampled_from(["linear", "cubic"]), st.sampled_from([1, 2, 8, 16]), st.integers(0, 2**32 - 1)
)
def test_activations_are_not_negative_and_sum_up_to_the_number_of_layers(inputs, field, layers, seed):
    cmac = make_cmac(inputs, layers=layers, receptive_field=field, addressing="hashed")
    activation = cmac.activation(random_inputs(5, inputs, seed, 1.2))
    assert (activation >= 0.0).all()
    assert_allclose(activation.sum(axis=1), layers)


def output_along(field, points, axis=0, inputs=1):
    """Output of random weights along one input, looked at so many times."""
    line = np.tile(random_inputs(1, inputs, seed=5), (points, 1))
    line[:, axis] = np.linspace(-0.9, 0.9, points)
    cmac = make_cmac(inputs, 1, addressing="dense", receptive_field=field)
    cmac.weights[:] = np.random.default_rng(1).normal(size=cmac.weights.shape)
    return cmac.predict(line)[:, 0]


@pytest.mark.parametrize(("field", "shrinks"), [("linear", True), ("cubic", True), ("rectangular", False)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_output_of_smooth_fields_is_continuous_along_every_input(field, shrinks, axis):
    coarse, fine = (np.abs(np.diff(output_along(field, points, axis, 3))).max() for points in (60, 600))
    assert (fine < 0.15 * coarse) == shrinks


def test_cubic_fields_are_smooth_where_linear_ones_have_corners():
    def largest_bend(field):
        slopes = np.diff(output_along(field, 2001))
        return np.abs(np.diff(slopes)).max() / np.abs(slopes).max()

    assert largest_bend("cubic") < 0.03 < 0.1 < largest_bend("linear")


def test_where_no_field_counts_all_cells_do():
    cmac = make_cmac(layers=2, cells=3, displacement="diagonal", receptive_field="linear")
    corner = np.array([[-0.5, 0.0]])  # half a block apart: each layer has an input on its border
    assert_array_equal(cmac.activation(corner), [[1.0, 1.0]])
