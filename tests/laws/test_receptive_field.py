"""Receptive fields of the CMAC, and addressing that gives every visited cell a row of its own."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.command import cmacexp
from support.rollout import roll_out
from test_cmac import make_cmac, random_inputs

from cmacexp.cmac.network import memory_use
from cmacexp.cmac.receptive_field import RECEPTIVE_FIELDS, spline
from cmacexp.loop.scenario import make_scenario

SMOOTH = ["linear", "cubic"]


def with_random_weights(**options):
    cmac = make_cmac(**options)
    cmac.weights[:] = np.random.default_rng(1).normal(size=cmac.weights.shape)
    return cmac


# Receptive fields


@pytest.mark.parametrize("field", SMOOTH)
def test_a_spline_is_one_in_the_middle_and_nothing_at_the_ends(field):
    kind = RECEPTIVE_FIELDS[field]
    assert (spline(kind, 0.0), spline(kind, 0.5), spline(kind, 1.0)) == (0.0, 1.0, 0.0)
    assert spline(kind, 0.25) == {"linear": 0.5, "cubic": 0.25}[field]
    assert spline(kind, 0.3) == pytest.approx(spline(kind, 0.7))


@pytest.mark.parametrize("field", SMOOTH)
def test_splines_of_layers_that_share_a_block_evenly_sum_up_to_the_same_everywhere(field):
    layers = 8
    sums = [
        sum(spline(RECEPTIVE_FIELDS[field], (place + j / layers) % 1.0) for j in range(layers))
        for place in np.linspace(0.0, 1.0, 50)
    ]
    assert_allclose(sums, layers * {"linear": 1 / 2, "cubic": 3 / 8}[field])


@given(st.integers(1, 4), st.sampled_from(SMOOTH), st.sampled_from([1, 2, 8, 16]), st.integers(0, 2**32 - 1))
def test_activations_are_not_negative_and_sum_up_to_the_number_of_layers(inputs, field, layers, seed):
    cmac = make_cmac(inputs, layers=layers, receptive_field=field)
    activation = cmac.activation(1.2 * random_inputs(20, inputs, seed))
    assert (activation >= 0.0).all()
    assert_allclose(activation.sum(axis=1), layers)


def test_equal_weights_give_the_same_with_every_receptive_field():
    inputs = random_inputs(50)
    for field in RECEPTIVE_FIELDS:
        cmac = make_cmac(receptive_field=field)
        cmac.weights[:] = 0.25
        assert_allclose(cmac.predict(inputs), 8 * 0.25)


def largest_step(field, points, axis=1, inputs=3):
    """Of the output along one input, looked at so many times."""
    line = np.tile(random_inputs(1, inputs, seed=5), (points, 1))
    line[:, axis] = np.linspace(-0.9, 0.9, points)
    output = with_random_weights(inputs=inputs, outputs=1, receptive_field=field).predict(line)
    return np.abs(np.diff(output[:, 0])).max()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("field", SMOOTH)
def test_the_output_is_continuous_along_every_input(field, axis):
    coarse, fine = largest_step(field, 500, axis), largest_step(field, 5_000, axis)
    assert fine < 0.12 * coarse


def test_that_of_rectangular_fields_jumps():
    assert largest_step("rectangular", 5_000) == pytest.approx(largest_step("rectangular", 500))


def test_cubic_fields_are_smooth_where_linear_ones_have_corners():
    def largest_bend(field):
        line = np.linspace(-0.9, 0.9, 4_001)[:, None]
        output = with_random_weights(inputs=1, outputs=1, receptive_field=field).predict(line)[:, 0]
        slopes = np.diff(output) / np.diff(line[:, 0])
        return np.abs(np.diff(slopes)).max() / np.abs(slopes).max()

    assert largest_bend("cubic") < 0.01 < 0.1 < largest_bend("linear")


@pytest.mark.parametrize("field", SMOOTH)
def test_one_update_moves_the_output_by_rate_times_error(field):
    cmac = make_cmac(receptive_field=field)
    point = random_inputs(1)
    cmac.update(point, [[2.0, -1.0]], 0.3)
    assert_allclose(cmac.predict(point), [[0.6, -0.3]])


def test_where_no_field_counts_all_cells_do():
    cmac = make_cmac(inputs=2, layers=2, elements=3, receptive_field="linear")
    corner = np.array([[-0.5, 0.0]])  # half a block apart: each layer has an input on its border
    assert_array_equal(cmac.activation(corner), [[1.0, 1.0]])


@pytest.mark.parametrize("field", SMOOTH)
def test_batch_equals_loop_and_what_is_loaded(field):
    batch, loop = make_cmac(receptive_field=field), make_cmac(receptive_field=field)
    inputs, error = random_inputs(60), random_inputs(60, seed=1)
    batch.update(inputs, error, 0.4)
    for k in range(60):
        loop.update(inputs[k : k + 1], error[k : k + 1], 0.4)
    assert batch.weights.tobytes() == loop.weights.tobytes()
    assert pickle.loads(pickle.dumps(batch)).predict(inputs).tobytes() == batch.predict(inputs).tobytes()


# Visited addressing


def test_visited_cells_get_rows_in_turn_and_keep_them():
    cmac = make_cmac(addressing="visited", inputs=1, layers=4)
    near, far = np.array([[-0.99]]), np.array([[0.99]])
    first = cmac.cells(near)
    assert_array_equal(first, [[0, 1, 2, 3]])
    assert_array_equal(cmac.cells(far), [[4, 5, 6, 7]])
    assert_array_equal(cmac.cells(near), first)
    assert cmac.cells(near + 0.13).max() == 8  # one layer alone has moved on


@pytest.mark.parametrize("field", RECEPTIVE_FIELDS)
def test_visited_memory_equals_dense_memory_to_the_bit(field):
    options = {"inputs": 2, "layers": 8, "elements": 5, "receptive_field": field}
    visited, dense = (make_cmac(addressing=name, **options) for name in ("visited", "dense"))
    inputs, error = random_inputs(300), random_inputs(300, seed=1)
    for cmac in (visited, dense):
        cmac.update(inputs, error, 0.5)
    unseen = random_inputs(100, seed=2)
    assert visited.predict(unseen).tobytes() == dense.predict(unseen).tobytes()
    use = memory_use(visited, inputs, visited.cells(inputs))
    assert use.cells_colliding == 0
    assert use.rows_used == memory_use(dense, inputs, dense.cells(inputs)).cells_visited


def test_use_of_memory_counts_no_clipping_twice():
    cmac = make_cmac()
    outside = np.full((3, 2), 9.0)
    cells = cmac.cells(outside)
    assert [memory_use(cmac, outside, cells).clipped for _ in range(2)] == [6, 6]
    assert cmac.clipped == 6


# In a run


def test_hashing_does_not_change_what_visited_memory_learns(make_config):
    ends = [
        roll_out(make_scenario(make_config("cycles=3", "cmac.addressing=visited", f"seed={seed}"))) for seed in (0, 1)
    ]
    assert ends[0].samples.tobytes() == ends[1].samples.tobytes()


def test_a_run_tells_how_much_memory_its_path_needs(tmp_path):
    config = ["cycles=1", "record=trace", "cmac.addressing=visited", f"hydra.run.dir={tmp_path / 'run'}"]
    done = cmacexp(*config, "cmac.memory_bytes=1024", folder=tmp_path)
    assert done.returncode == 2
    needed = int(done.stderr.split("at least ")[1].split()[0])
    assert cmacexp(*config, f"cmac.memory_bytes={needed - 1}", folder=tmp_path).returncode == 2
    assert cmacexp(*config, f"cmac.memory_bytes={needed}", folder=tmp_path).returncode == 0
