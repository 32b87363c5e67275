"""Laws of the loop's small kernels: every value is copied, and every one that is not finite is found."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from cmacexp.loop.step import check_measured, copy_matrix, is_finite, observes_finite
from cmacexp.loop.stop import DIVERGED, RUNNING, new_limits
from cmacexp.models.mechanism import point_mass
from cmacexp.plants.kernels import new_state
from cmacexp.plants.protocol import STATE
from cmacexp.sensors.kernels import new_observation

LEGS = 3
SHAPES = {name: np.shape(getattr(new_observation(LEGS), name)) for name in STATE}
ENTRIES = [(name, entry) for name, shape in SHAPES.items() for entry in np.ndindex(shape)]
NOT_FINITE = (np.nan, np.inf, -np.inf)


@pytest.mark.parametrize(("name", "entry"), ENTRIES)
def test_an_observation_is_finite_if_each_of_its_values_is(name, entry):
    observation = new_observation(LEGS)
    assert observes_finite(observation)
    for value in NOT_FINITE:
        getattr(observation, name)[entry] = value
        assert not observes_finite(observation)


@pytest.mark.parametrize("entry", list(np.ndindex(LEGS, 2)))
def test_a_matrix_is_finite_if_each_of_its_values_is(entry):
    values = np.ones((LEGS, 2))
    assert is_finite(values)
    for value in NOT_FINITE:
        values[entry] = value
        assert not is_finite(values)


@pytest.mark.parametrize(("name", "entry"), ENTRIES)
def test_a_measured_state_has_diverged_if_one_of_its_values_is_not_finite(name, entry):
    """That of an external plant; the body of a machine on a stand is not looked at, but its rate is."""
    limits, state = new_limits(point_mass(1.0, 0.5), np.full(4, np.nan), 0.005), new_state(LEGS)
    assert check_measured(limits, 0, state) == RUNNING
    for value in NOT_FINITE:
        getattr(state, name)[entry] = value
        assert check_measured(limits, 0, state) == (RUNNING if name == "body" else DIVERGED)


def test_a_matrix_is_copied_into_its_row_alone():
    values, rows = np.random.default_rng(0).normal(size=(LEGS, 2)), np.zeros((4, LEGS, 2))
    copy_matrix(values, rows, 2)
    expected = np.zeros((4, LEGS, 2))
    expected[2] = values
    assert_array_equal(rows, expected)
    copy_matrix(values, None, 2)  # nothing to fill
