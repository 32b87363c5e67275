"""Cells along a path: the quick ways of long cycles give what the plain ones do."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from cmacexp.cmac.memory import find_entered


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 5), st.integers(1, 6))
def test_every_cell_is_entered_where_it_first_occurs(seed, samples, layers, kinds):
    cells = np.random.default_rng(seed).integers(0, kinds, (samples, layers))
    entered = find_entered(cells)
    values, first = np.unique(cells, return_index=True)
    found, place = np.unique(cells[entered], return_index=True)
    assert_array_equal(found, values)
    assert_array_equal(np.flatnonzero(entered)[place], first)
