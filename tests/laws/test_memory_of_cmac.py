"""Laws of the memory of a CMAC: which cells a path visits, which share a row, and when there is too little of it."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from cmacexp.cmac import network, spread
from cmacexp.cmac.addressing import DISPLACEMENTS, InputRange, displacement
from cmacexp.cmac.memory import find_entered
from cmacexp.cmac.network import Cmac, memory_use
from cmacexp.cmac.spread import spread_shares
from cmacexp.config.cmac import CmacConfig
from cmacexp.errors import BadInput

LAYERS, ELEMENTS, BYTES_OF_ROW = 4, 3, 16


def make_cmac(addressing, rows, inputs=2):
    config = CmacConfig(LAYERS, ELEMENTS, BYTES_OF_ROW * rows, addressing, "diagonal", ["angle"], 1.0, "rectangular")
    return Cmac.from_config(config, InputRange(-np.ones(inputs), np.ones(inputs)), outputs=2, seed=3)


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.integers(LAYERS, 60))
def test_cells_that_share_a_row_are_those_of_dense_memory_that_the_hash_puts_together(seed, samples, rows):
    path = np.random.default_rng(seed).uniform(-1.2, 1.2, (samples, 2))
    hashed, dense = make_cmac("hashed", rows), make_cmac("dense", LAYERS * ELEMENTS**2)
    cells, distinct = hashed.cells(path), dense.cells(path)
    in_row: dict[int, set[int]] = {}
    for row, cell in zip(cells.ravel().tolist(), distinct.ravel().tolist(), strict=True):
        in_row.setdefault(row, set()).add(cell)
    found = memory_use(hashed, path, cells)
    assert found.rows == rows
    assert found.rows_used == len(in_row)
    assert found.cells_visited == sum(map(len, in_row.values())) == len(np.unique(distinct))
    assert found.cells_colliding == sum(len(own) for own in in_row.values() if len(own) > 1)
    assert found.clipped == (np.abs(path) > 1.0).sum()


def test_of_more_cells_than_can_be_numbered_no_collision_is_counted(monkeypatch):
    """As many as the limit are counted still."""
    cmac, path = make_cmac("hashed", 50), np.zeros((1, 2))
    for most, counted in ((LAYERS * ELEMENTS**2, True), (LAYERS * ELEMENTS**2 - 1, False)):
        monkeypatch.setattr(network, "MOST_POSITIONS", most)
        found = memory_use(cmac, path, cmac.cells(path))
        assert (found.cells_visited is not None) == (found.cells_colliding is not None) == counted
        assert (found.rows, found.rows_used) == (50, 4)


@pytest.mark.parametrize(("addressing", "least"), [("hashed", LAYERS), ("dense", LAYERS * ELEMENTS**2)])
def test_a_cmac_has_a_row_for_each_layer_or_each_cell_or_is_refused(addressing, least):
    assert len(make_cmac(addressing, least).weights) == least
    with pytest.raises(BadInput, match=rf"cmac\.memory_bytes=.*must be at least {BYTES_OF_ROW * least} B"):
        make_cmac(addressing, least - 1)


@given(st.sampled_from(sorted(DISPLACEMENTS)), st.integers(1, 16), st.integers(1, 4))
def test_layers_are_shifted_by_multiples_of_one_vector_and_no_two_alike(name, layers, inputs):
    try:
        shifts = displacement(name, layers, inputs)
    except BadInput:
        assume(False)
    assert shifts.shape == (layers, inputs)
    assert np.issubdtype(shifts.dtype, np.integer)
    vector = shifts[1 % layers]
    for j in range(layers):
        assert shifts[j].tolist() == [j * c % layers for c in vector]
    assert all(len(set(column)) == layers for column in shifts.T)


@given(st.integers(4, 30), st.integers(1, 3), st.integers(1, 3))
def test_the_window_named_as_too_wide_is_refused_and_the_one_below_is_not(samples, legs, active):
    cells = np.arange(samples * legs * active, dtype=np.uint32).reshape(samples, legs, active)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spread, "MOST_ENTRIES", 5 * cells.size)  # two neighbours on each side
        for window in range(samples):
            if 2 * window + 1 <= samples and window <= 2:
                rows, share = spread_shares(cells, np.ones(cells.shape), window)
                np.testing.assert_allclose(share.sum(axis=2), 1.0)
                assert rows.shape[2] == active * (2 * window + 1)
            else:
                with pytest.raises(BadInput, match=r"learning\.window=\d+: must be below"):
                    spread_shares(cells, np.ones(cells.shape), window)


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 5), st.integers(1, 6))
def test_every_cell_is_entered_where_it_first_occurs(seed, samples, layers, kinds):
    cells = np.random.default_rng(seed).integers(0, kinds, (samples, layers))
    entered = find_entered(cells)
    values, first = np.unique(cells, return_index=True)
    found, place = np.unique(cells[entered], return_index=True)
    assert_array_equal(found, values)
    assert_array_equal(np.flatnonzero(entered)[place], first)
