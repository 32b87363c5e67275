"""Cells along a path: the quick ways of long cycles give what the plain ones do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from cmacexp.cmac.addressing import InputRange
from cmacexp.cmac.memory import find_entered
from cmacexp.cmac.network import Cmac, memory_use
from cmacexp.config.cmac import CmacConfig


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 5), st.integers(1, 6))
def test_every_cell_is_entered_where_it_first_occurs(seed, samples, layers, kinds):
    cells = np.random.default_rng(seed).integers(0, kinds, (samples, layers))
    entered = find_entered(cells)
    values, first = np.unique(cells, return_index=True)
    found, place = np.unique(cells[entered], return_index=True)
    assert_array_equal(found, values)
    assert_array_equal(np.flatnonzero(entered)[place], first)


@pytest.mark.parametrize("addressing", ["hashed", "visited"])
def test_the_use_of_memory_is_counted_as_from_all_cells(addressing):
    config = CmacConfig(8, 9, 1600, addressing, "diagonal", ["angle"], 1.0, "rectangular")
    dense = CmacConfig(8, 9, 2**20, "dense", "diagonal", ["angle"], 1.0, "rectangular")
    angle = np.linspace(0.0, 2.0 * np.pi, 300)
    inputs, ranges = np.stack([np.cos(angle), np.sin(angle)], axis=1), InputRange(-np.ones(2), np.ones(2))
    cmac = Cmac.from_config(config, ranges, seed=3)
    if addressing == "visited":
        cmac = Cmac.from_config(CmacConfig(**{**vars(config), "memory_bytes": 2**16}), ranges)
    cells = cmac.cells(inputs)
    pairs = set(
        zip(Cmac.from_config(dense, ranges).cells(inputs).ravel().tolist(), cells.ravel().tolist(), strict=True)
    )
    rows = [row for _, row in pairs]
    use = memory_use(cmac, inputs, cells)
    assert use.rows_used == len(set(rows))
    assert use.cells_visited == len(pairs)
    assert use.cells_colliding == sum(rows.count(row) > 1 for row in rows)
    assert (use.cells_colliding > 0) == (addressing == "hashed")
