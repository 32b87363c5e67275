"""Laws of the CMAC: quantiser, displacement, addressing, hash, learning."""

import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.cmac.addressing import (
    DISPLACEMENTS,
    Address,
    InputRange,
    address,
    address_batch,
    count_outside,
    displacement,
    least_distance,
    quantise,
    spanning,
)
from cmacexp.cmac.memory import Visited
from cmacexp.cmac.network import Cmac
from cmacexp.config.cmac import CmacConfig
from cmacexp.errors import BadInput

names = st.sampled_from(sorted(DISPLACEMENTS))


def unit_range(inputs):
    return InputRange(-np.ones(inputs), np.ones(inputs))


def make_cmac(
    inputs=2,
    outputs=2,
    seed=0,
    layers=8,
    elements=5,
    rows=2**20,
    addressing="hashed",
    vector="diagonal",
    receptive_field="rectangular",
):
    config = CmacConfig(layers, elements, rows * 8 * outputs, addressing, vector, ["angle"], 1.0, receptive_field)
    return Cmac.from_config(config, unit_range(inputs), outputs, seed)


def random_inputs(samples, inputs=2, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (samples, inputs))


# Quantiser


def test_range_ends_belong_to_the_first_and_the_last_quantum():
    assert quantise(-0.3, -0.3, 0.7, 10) == 0
    assert quantise(0.7, -0.3, 0.7, 10) == 9
    assert count_outside(InputRange(np.array([-0.3]), np.array([0.7])), np.array([[-0.3], [0.7]])) == 0


@given(st.floats(0.0, 1e300, exclude_min=True), st.integers(2, 2**20))
def test_outside_is_clipped_to_the_nearer_end_and_said(distance, quanta):
    assume(1.0 + distance > 1.0)
    assert quantise(1.0 + distance, -1.0, 1.0, quanta) == quanta - 1
    assert quantise(-1.0 - distance, -1.0, 1.0, quanta) == 0
    outside = np.array([[1.0 + distance], [-1.0 - distance]])
    assert count_outside(InputRange(np.array([-1.0]), np.array([1.0])), outside) == 2


def test_every_quantum_has_the_same_width_also_around_zero():
    values = -0.8 + (np.arange(2000) + 0.5) / 1000.0  # a hundred points for each of twenty quanta
    quanta = [quantise(v, -0.8, 1.2, 20) for v in values]
    assert_array_equal(np.bincount(quanta), np.full(20, 100))
    assert quantise(-1e-9, -0.8, 1.2, 20) + 1 == quantise(1e-9, -0.8, 1.2, 20)


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
    elements = 3
    quanta = (elements - 1) * layers
    params = Address(InputRange(np.zeros(inputs), np.full(inputs, quanta)), shifts, elements, 1, False, 0)
    axis = data.draw(st.integers(0, inputs - 1))
    here = np.array([data.draw(st.integers(0, quanta - 2)) for _ in range(inputs)]) + 0.5
    before, after = np.zeros((2, layers), dtype=np.int32)
    address(params, here, before)
    address(params, here + np.eye(inputs)[axis], after)
    assert (before != after).sum() == 1


@pytest.mark.parametrize(("layers", "inputs"), [(6, 2), (12, 4), (9, 2), (15, 3), (35, 4), (3, 2)])
def test_odd_lattice_whose_layers_coincide_is_refused(layers, inputs):
    with pytest.raises(BadInput, match=f"cmac.layers={layers}") as caught:
        displacement("odd_lattice", layers, inputs)
    assert caught.value.key == "cmac.displacement"


def least_distance_by_hand(vector, layers):
    """Smallest squared distance from the origin to another corner, by trying all of them."""
    shifts = ([j * c % layers for c in vector] for j in range(1, layers))
    return min(sum(min(s, layers - s) ** 2 for s in shift) for shift in shifts)


@pytest.mark.parametrize(("layers", "inputs"), [(2, 1), (2, 5), (3, 2), (6, 4)])
def test_cells_shifted_alike_along_every_input_are_apart_by_its_diagonal(layers, inputs):
    assert least_distance(np.ones((1, inputs), dtype=np.int64), layers) == inputs


@pytest.mark.parametrize(("layers", "inputs"), [(5, 2), (7, 3), (8, 3), (9, 2), (12, 3), (16, 2), (16, 3), (13, 2)])
def test_parks_militzer_is_the_best_of_all_vectors(layers, inputs):
    coprime = [c for c in range(1, layers) if math.gcd(c, layers) == 1]
    best = max(least_distance_by_hand(v, layers) for v in itertools.product(coprime, repeat=inputs))
    assert least_distance_by_hand(DISPLACEMENTS["parks_militzer"](layers, inputs), layers) == best


# Addressing


@given(names, st.sampled_from([1, 2, 4, 8, 16, 32]), st.integers(1, 3), st.integers(2, 9), st.data())
def test_every_input_in_range_has_one_cell_per_layer_within_the_memory(name, layers, inputs, elements, data):
    point = [[data.draw(st.floats(-1.0, 1.0)) for _ in range(inputs)]]
    dense = make_cmac(inputs, 1, layers=layers, elements=elements, addressing="dense", vector=name)
    hashed = make_cmac(inputs, 1, layers=layers, elements=elements, rows=layers, vector=name)
    cells = dense.cells(point)[0]
    assert_array_equal(cells // elements**inputs, np.arange(layers))
    assert hashed.cells(point).min() >= 0
    assert hashed.cells(point).max() < len(hashed.weights) == layers
    assert dense.clipped == hashed.clipped == 0


def test_outside_the_range_is_clipped_and_every_such_input_counted():
    cmac = make_cmac()
    outside = cmac.cells([[1.5, -0.2], [-7.0, 1.1], [0.3, 0.4]])
    assert cmac.clipped == 3
    assert_array_equal(outside, cmac.cells([[1.0, -0.2], [-1.0, 1.0], [0.3, 0.4]]))
    assert cmac.clipped == 3


def test_dense_memory_beyond_its_bound_is_bad_input(make_config):
    with pytest.raises(BadInput, match="dense"):
        make_config("cmac.addressing=dense", "cmac.memory_bytes=1048576")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_an_input_that_is_not_finite_raises(bad):
    cmac = make_cmac()
    for use in (cmac.cells, cmac.predict, lambda inputs: cmac.update(inputs, np.ones((1, 2)), 1.0)):
        with pytest.raises(ValueError, match="finite"):
            use(np.array([[0.0, bad]]))


def test_inputs_and_errors_of_the_wrong_shape_raise():
    cmac = make_cmac()
    with pytest.raises(ValueError, match="shape"):
        cmac.predict(np.zeros((3, 1)))
    with pytest.raises(ValueError, match="shape"):
        cmac.update(np.zeros((3, 2)), np.ones((2, 2)), 1.0)


@pytest.mark.parametrize("vector", sorted(DISPLACEMENTS))
def test_hashed_memory_without_collisions_equals_dense_memory(vector):
    hashed, dense = make_cmac(seed=1, vector=vector), make_cmac(vector=vector, addressing="dense")
    everywhere = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 200)] * 2), axis=2).reshape(-1, 2)
    pairs = set(zip(dense.cells(everywhere).ravel(), hashed.cells(everywhere).ravel(), strict=True))
    assert len({d for d, _ in pairs}) == len({h for _, h in pairs}) == len(pairs) > 100
    inputs = random_inputs(500)
    error = np.stack([np.sin(3.0 * inputs[:, 0]), inputs[:, 1]], axis=1)
    for cmac in (hashed, dense):
        cmac.update(inputs, error, 0.3)
    assert hashed.predict(everywhere).tobytes() == dense.predict(everywhere).tobytes()


def distinct_rows(seed, rows):
    """Hashed row of each distinct cell of a CMAC of 32 layers and two inputs."""
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 257)] * 2), axis=2).reshape(-1, 2)
    dense = make_cmac(layers=32, elements=9, addressing="dense").cells(grid).ravel()
    hashed = make_cmac(layers=32, elements=9, rows=rows, seed=seed).cells(grid).ravel()
    return hashed[np.unique(dense, return_index=True)[1]]


@pytest.mark.parametrize("seed", [0, 1, 2**40])
@pytest.mark.parametrize("rows", [64, 100])
def test_hash_spreads_cells_evenly(seed, rows):
    cells = distinct_rows(seed, rows)
    expected = len(cells) / rows
    chi_square = ((np.bincount(cells, minlength=rows) - expected) ** 2 / expected).sum()
    freedom = rows - 1
    assert chi_square < freedom + 4.0 * math.sqrt(2.0 * freedom)


# Learning


def test_generalisation_in_one_dimension_is_a_triangle():
    layers, elements = 16, 9
    cmac = make_cmac(1, 1, layers=layers, elements=elements, addressing="dense")
    centres = -1.0 + (np.arange((elements - 1) * layers)[:, None] + 0.5) * 2.0 / ((elements - 1) * layers)
    trained = 60
    cmac.update(centres[[trained]], np.array([[1.0]]), 1.0)
    distance = np.abs(np.arange(len(centres)) - trained)
    assert_allclose(cmac.predict(centres)[:, 0], np.maximum(0.0, 1.0 - distance / layers), atol=1e-15)


@given(st.integers(0, 2**32), st.floats(0.01, 1.9), st.floats(-100.0, 100.0))
def test_one_update_moves_the_prediction_by_rate_times_error(seed, rate, error):
    cmac = make_cmac(seed=seed)
    cmac.update(random_inputs(20), random_inputs(20, seed=1), 0.5)
    point = random_inputs(1, seed=2)
    assume(len(set(cmac.cells(point)[0])) == cmac.layers)
    before = cmac.predict(point)
    cmac.update(point, np.full((1, 2), error), rate)
    assert_allclose(cmac.predict(point) - before, rate * error, rtol=1e-12, atol=1e-12)


def test_batch_equals_loop_to_the_bit():
    batch, loop = make_cmac(rows=50), make_cmac(rows=50)  # few rows, so that samples collide
    inputs, error = random_inputs(300), random_inputs(300, seed=1)
    batch.update(inputs, error, 0.4)
    for k in range(len(inputs)):
        loop.update(inputs[k : k + 1], error[k : k + 1], 0.4)
    assert batch.weights.tobytes() == loop.weights.tobytes()
    one_by_one = np.concatenate([loop.predict(inputs[k : k + 1]) for k in range(len(inputs))])
    assert batch.predict(inputs).tobytes() == one_by_one.tobytes()


@pytest.mark.parametrize("addressing", ["dense", "hashed", "visited"])
def test_saved_and_loaded_is_equal_to_the_bit(tmp_path, addressing):
    cmac = make_cmac(seed=2**63 - 1, addressing=addressing, vector="parks_militzer", rows=777)
    cmac.update(random_inputs(100) * 1.1, random_inputs(100, seed=1), 0.7)
    cmac.save(tmp_path / "cmac.npz")
    loaded = Cmac.load(tmp_path / "cmac.npz")
    assert loaded.weights.tobytes() == cmac.weights.tobytes()
    assert loaded.clipped == cmac.clipped > 0
    inputs = random_inputs(100, seed=2)
    assert_array_equal(loaded.cells(inputs), cmac.cells(inputs))
    loaded.update(inputs, inputs, 0.1)
    cmac.update(inputs, inputs, 0.1)
    assert loaded.predict(inputs).tobytes() == cmac.predict(inputs).tobytes()


def test_training_converges_to_a_smooth_function():
    cmac = make_cmac(outputs=1)
    inputs, unseen = random_inputs(800), random_inputs(200, seed=1)

    def wanted(x):
        return np.sin(2.0 * x[:, :1]) * np.cos(x[:, 1:])

    def rms():
        return np.sqrt(np.mean((wanted(unseen) - cmac.predict(unseen)) ** 2))

    untrained = rms()
    for _ in range(5):
        for point in inputs[:, np.newaxis]:
            cmac.update(point, wanted(point) - cmac.predict(point), 0.5)
    assert rms() < 0.05 * untrained


def test_two_outputs_share_one_address_and_are_independent():
    both, one = make_cmac(rows=60), make_cmac(outputs=1, rows=60)
    inputs, error = random_inputs(200), random_inputs(200, seed=1)
    error[:, 1] = 0.0
    assert_array_equal(both.cells(inputs), one.cells(inputs))
    both.update(inputs, error, 0.5)
    one.update(inputs, error[:, :1], 0.5)
    assert not both.predict(inputs)[:, 1].any()
    assert both.predict(inputs)[:, :1].tobytes() == one.predict(inputs).tobytes()


@pytest.mark.parametrize("addressing", ["hashed", "dense"])
@pytest.mark.parametrize("rows", [np.uint32, np.uint64])
def test_a_batch_has_the_addresses_of_its_inputs_one_by_one_compiled_or_not(addressing, rows):
    cmac, inputs = make_cmac(addressing=addressing), np.vstack([random_inputs(40), np.full((1, 2), 9.0)])
    expected, plain, compiled = (np.empty((41, cmac.layers), rows) for _ in range(3))
    for own, cells in zip(inputs, expected, strict=True):
        address(cmac.address, own, cells)
    address_batch.plain(cmac.address, inputs, plain)
    address_batch.compiled(cmac.address, inputs, compiled)
    assert expected.tolist() == plain.tolist() == compiled.tolist()


def test_the_memory_that_visited_cells_ask_for_is_exactly_enough():
    """What is refused leaves no trace."""
    few, row_bytes = Visited(5, 16), 16
    rows = few.assign_rows(np.array([[7, 3], [9, 7]], dtype=np.uint64))
    assert rows.tolist() == [[0, 1], [2, 0]]
    more = np.array([[1, 9, 2], [5, 6, 1]], dtype=np.uint64)
    with pytest.raises(BadInput) as refused:
        few.assign_rows(more)
    assert few.positions.tolist() == [7, 3, 9]
    named = int(re.search(r"at least (\d+) B", str(refused.value))[1])
    enough, too_few = (Visited(named // row_bytes - less, row_bytes, few.positions) for less in (0, 1))
    assert enough.assign_rows(more).tolist() == [[3, 2, 4], [5, 6, 3]]
    with pytest.raises(BadInput):
        too_few.assign_rows(more)
