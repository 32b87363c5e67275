"""Laws of the CMAC: quantiser, displacement, addressing, hash, memory, learning, receptive fields."""

import itertools
import math
import re
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.cmacs import make_cmac, random_inputs
from support.doors import BadInput

from cmacexp.cmac.addressing import (
    DISPLACEMENTS,
    RECEPTIVE_FIELDS,
    Address,
    InputRange,
    address,
    count_outside,
    displacement,
    least_distance,
    quantise,
    spanning,
    spline,
)
from cmacexp.cmac.memory import Visited
from cmacexp.cmac.network import find_visited, memory_use

names, fields = (st.sampled_from(sorted(table)) for table in (DISPLACEMENTS, RECEPTIVE_FIELDS))

# Quantiser


def test_every_quantum_has_the_same_width_and_the_ends_belong_to_the_first_and_the_last():
    values = -0.8 + (np.arange(2000) + 0.5) / 1000.0  # a hundred points for each of twenty quanta
    assert_array_equal(np.bincount([quantise(v, -0.8, 1.2, 20) for v in values]), np.full(20, 100))
    assert quantise(-1e-9, -0.8, 1.2, 20) + 1 == quantise(1e-9, -0.8, 1.2, 20)
    assert (quantise(-0.3, -0.3, 0.7, 10), quantise(0.7, -0.3, 0.7, 10)) == (0, 9)


@given(st.floats(0.0, 1e300))
def test_outside_is_clipped_to_the_nearer_end_and_counted(distance):
    assert quantise(1.0 + distance, -1.0, 1.0, 64) == 63
    assert quantise(-1.0 - distance, -1.0, 1.0, 64) == 0
    outside = np.array([[1.0 + distance], [-1.0 - distance]])
    assert count_outside(InputRange(np.array([-1.0]), np.array([1.0])), outside) == 2 * (1.0 + distance > 1.0)


def test_ranges_span_the_values_times_the_factor_about_their_middle():
    ranges = spanning(np.array([[1.0, 5.0], [3.0, 5.0], [2.0, 5.0]]), 5.0)
    assert_allclose([ranges.low, ranges.high], [[-3.0, 4.5], [7.0, 5.5]])  # what stands still gets width 1


# Displacement


@given(names, st.integers(1, 16), st.integers(1, 4), st.data())
def test_one_quantum_along_one_axis_changes_the_cell_of_exactly_one_layer(name, layers, inputs, data):
    try:
        shifts = displacement(name, layers, inputs)
    except BadInput:
        assume(False)
    assert shifts.tolist() == [[j * c % layers for c in DISPLACEMENTS[name](layers, inputs)] for j in range(layers)]
    quanta = 2 * layers
    params = Address(InputRange(np.zeros(inputs), np.full(inputs, quanta)), shifts, 3, 1, False, 0)
    axis = data.draw(st.integers(0, inputs - 1))
    here = np.array([data.draw(st.integers(0, quanta - 2)) for _ in range(inputs)]) + 0.5
    before, after = np.zeros((2, layers), dtype=np.int32)
    address(params, here, before)
    address(params, here + np.eye(inputs)[axis], after)
    assert (before != after).sum() == 1


@pytest.mark.parametrize(("layers", "inputs"), [(6, 2), (12, 4), (9, 2), (15, 3), (35, 4), (3, 2)])
def test_odd_lattice_whose_layers_coincide_is_refused(layers, inputs):
    with pytest.raises(BadInput, match=r"^cmac\.displacement="):
        displacement("odd_lattice", layers, inputs)


def least_distance_by_hand(vector, layers):
    """Smallest squared distance from the origin to another corner, by trying all of them."""
    return min(sum(min(j * c % layers, -j * c % layers) ** 2 for c in vector) for j in range(1, layers))


@pytest.mark.parametrize(("layers", "inputs"), [(5, 2), (7, 3), (8, 3), (12, 3), (16, 2), (13, 2)])
def test_parks_militzer_is_the_best_of_all_vectors(layers, inputs):
    coprime = [c for c in range(1, layers) if math.gcd(c, layers) == 1]
    best = max(least_distance_by_hand(v, layers) for v in itertools.product(coprime, repeat=inputs))
    assert least_distance_by_hand(DISPLACEMENTS["parks_militzer"](layers, inputs), layers) == best
    assert least_distance(np.ones((1, inputs), dtype=np.int64), layers) == inputs  # along the diagonal


# Addressing


@given(names, st.sampled_from([1, 2, 4, 8, 16, 32]), st.integers(1, 3), st.integers(2, 9), st.data())
def test_every_input_in_range_has_one_cell_per_layer_within_the_memory(name, layers, inputs, cells, data):
    point = [[data.draw(st.floats(-1.0, 1.0)) for _ in range(inputs)]]
    dense = make_cmac(inputs, 1, layers, cells, displacement=name)
    hashed = make_cmac(inputs, 1, layers, cells, addressing="hashed", memory_bytes=8 * layers, displacement=name)
    assert_array_equal(dense.cells(point)[0] // cells**inputs, np.arange(layers))
    assert hashed.cells(point).max() < len(hashed.weights) == layers
    assert dense.clipped == hashed.clipped == 0


def distinct_rows(seed, rows):
    """Hashed row of each distinct cell of a CMAC of 32 layers and two inputs."""
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 65)] * 2), axis=2).reshape(-1, 2)
    dense = make_cmac(2, 1, 32, 9, addressing="dense").cells(grid).ravel()
    hashed = make_cmac(2, 1, 32, 9, addressing="hashed", memory_bytes=8 * rows, seed=seed).cells(grid).ravel()
    return hashed[np.unique(dense, return_index=True)[1]]


@pytest.mark.parametrize("seed", [0, 1, 2**40])
@pytest.mark.parametrize("rows", [64, 100])
def test_hash_spreads_cells_evenly(seed, rows):
    cells = distinct_rows(seed, rows)
    expected = len(cells) / rows
    chi_square = ((np.bincount(cells, minlength=rows) - expected) ** 2 / expected).sum()
    assert chi_square < rows - 1 + 4.0 * math.sqrt(2.0 * (rows - 1))


# Memory


@pytest.mark.parametrize("field", RECEPTIVE_FIELDS)
def test_without_collisions_every_memory_learns_the_same_bits(field):
    kinds = [make_cmac(addressing=kind, receptive_field=field) for kind in ("dense", "hashed", "visited")]
    inputs, unseen = random_inputs(300), random_inputs(100, seed=2)
    for cmac in kinds:
        cmac.update(inputs, random_inputs(300, seed=1), 0.5)
    one, *others = (cmac.predict(unseen).tobytes() for cmac in kinds)
    assert others == [one, one]
    uses = [memory_use(cmac, inputs, cmac.cells(inputs), find_visited(cmac, inputs)) for cmac in kinds]
    assert {use.cells_colliding for use in uses} == {0}
    assert len({use.rows_used for use in uses} | {use.cells_visited for use in uses}) == 1


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.integers(4, 60))
def test_cells_that_share_a_row_are_those_of_dense_memory_that_the_hash_puts_together(seed, samples, rows):
    path = random_inputs(samples, seed=seed, reach=1.2)
    hashed = make_cmac(layers=4, cells=3, addressing="hashed", memory_bytes=16 * rows)
    cells, distinct = hashed.cells(path), make_cmac(layers=4, cells=3, addressing="dense").cells(path)
    in_row = defaultdict(set)
    for row, cell in zip(cells.flat, distinct.flat, strict=True):
        in_row[row].add(cell)
    found, before = memory_use(hashed, path, cells, find_visited(hashed, path)), hashed.clipped
    assert (found.rows, found.rows_used) == (rows, len(in_row))
    assert found.cells_visited == sum(map(len, in_row.values())) == len(np.unique(distinct))
    assert found.cells_colliding == sum(len(own) for own in in_row.values() if len(own) > 1)
    assert found.clipped == before == (np.abs(path) > 1.0).sum()


@pytest.mark.parametrize(("addressing", "least"), [("hashed", 4), ("dense", 4 * 3**2)])
def test_a_cmac_has_a_row_for_each_layer_or_each_cell_or_is_refused(addressing, least):
    made = make_cmac(layers=4, cells=3, addressing=addressing, memory_bytes=16 * least)
    assert len(made.weights) == least
    with pytest.raises(BadInput, match=r"cmac\.memory_bytes"):
        make_cmac(layers=4, cells=3, addressing=addressing, memory_bytes=16 * least - 1)


def test_the_memory_that_visited_cells_ask_for_is_exactly_enough():
    """What is refused leaves no trace."""
    few, row_bytes = Visited(5, 16), 16
    assert few.assign_rows(np.array([[7, 3], [9, 7]], dtype=np.uint64)).tolist() == [[0, 1], [2, 0]]
    more = np.array([[1, 9, 2], [5, 6, 1]], dtype=np.uint64)
    with pytest.raises(BadInput) as refused:
        few.assign_rows(more)
    assert few.positions.tolist() == [7, 3, 9]
    named = int(re.search(r"at least (\d+) B", str(refused.value))[1])
    enough, too_few = (Visited(named // row_bytes - less, row_bytes, few.positions) for less in (0, 1))
    assert enough.assign_rows(more).tolist() == [[3, 2, 4], [5, 6, 3]]
    with pytest.raises(BadInput):
        too_few.assign_rows(more)


# Learning


def test_generalisation_in_one_dimension_is_a_triangle():
    layers, quanta, trained = 16, 128, 60
    cmac = make_cmac(1, 1, layers, 9, addressing="dense")
    centres = -1.0 + (np.arange(quanta)[:, None] + 0.5) * 2.0 / quanta
    cmac.update(centres[[trained]], np.array([[1.0]]), 1.0)
    distance = np.abs(np.arange(quanta) - trained)
    assert_allclose(cmac.predict(centres)[:, 0], np.maximum(0.0, 1.0 - distance / layers), atol=1e-15)


@given(fields, st.integers(0, 2**32), st.floats(0.01, 1.9), st.floats(-100.0, 100.0))
def test_one_update_moves_each_output_by_rate_times_its_error_alone(field, seed, rate, error):
    cmac, point = make_cmac(seed=seed, receptive_field=field, addressing="hashed"), random_inputs(1, seed=2)
    cmac.update(random_inputs(20), random_inputs(20, seed=1), 0.5)
    assume(len(set(cmac.cells(point)[0])) == cmac.layers)
    before = cmac.predict(point)
    cmac.update(point, [[error, 0.0]], rate)
    assert_allclose(cmac.predict(point) - before, [[rate * error, 0.0]], rtol=1e-12, atol=1e-12)


# Receptive fields


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
    # Half a block apart: each layer has an input on its border.
    assert_array_equal(cmac.activation(np.array([[-0.5, 0.0]])), [[1.0, 1.0]])
