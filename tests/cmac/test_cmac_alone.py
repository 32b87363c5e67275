"""The CMAC as a library: one input or a batch, ranges and defaults of its own, and files."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import BadInput

from cmacexp.cmac import Cmac

RNG = np.random.default_rng(5)
X, ERROR = RNG.uniform(-1.2, 3.2, (150, 2)), RNG.normal(size=(150, 3))
KINDS = [{}, {"receptive_field": "cubic"}, {"memory_bytes": 2000, "seed": 2**63 - 1}, {"addressing": "visited"}]


def make_cmac(layers=8, cells=5, **options):
    return Cmac([-1.0, 0.0], [1.0, 3.0], 3, layers, cells, **options)


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_single_inputs_have_the_bits_of_a_batch_and_a_file_keeps_them(options, tmp_path):
    batch, single = make_cmac(**options), make_cmac(**options)
    batch.update(X, ERROR, 0.4)
    for x, error in zip(X, ERROR, strict=True):
        single.update(x, error, 0.4)
    batch.save(str(tmp_path / "cmac.npz"))
    wanted, clipped = batch.predict(X).tobytes(), batch.clipped
    for each in (single, Cmac.load(tmp_path / "cmac.npz")):
        assert each.weights.any()
        assert np.stack([each.predict(list(x)) for x in X]).tobytes() == wanted
        assert each.clipped == clipped > 0
        each.update(X[0], ERROR[0], 0.1)
        assert (each.predict(X[0]) != batch.predict(X[0])).all()


def test_without_a_hash_a_network_of_several_outputs_is_one_network_for_each_output():
    """The paper leaves open if an address has one output or one for each joint: both give the same bits."""
    together = make_cmac(addressing="visited")
    together.update(X, ERROR, 0.4)
    for k in range(3):
        alone = Cmac([-1.0, 0.0], [1.0, 3.0], 1, 8, 5, addressing="visited")
        alone.update(X, ERROR[:, [k]], 0.4)
        assert_array_equal(alone.predict(X)[:, 0], together.predict(X)[:, k])


def test_outputs_are_new_arrays_and_follow_weights_that_are_replaced():
    cmac = make_cmac()
    first = cmac.predict([0.0, 1.0])
    cmac.weights = np.ones_like(cmac.weights)
    assert_array_equal(cmac.predict([0.0, 1.0]), 8.0)
    assert_array_equal(first, 0.0)


@pytest.mark.parametrize("twin", [copy.deepcopy, lambda cmac: pickle.loads(pickle.dumps(cmac))])
def test_a_copy_learns_for_itself(twin):
    cmac = make_cmac()
    cmac.update(X[0], ERROR[0], 0.5)
    other = twin(cmac)
    assert_array_equal(other.predict(X[0]), cmac.predict(X[0]))
    other.update(X[0], ERROR[0], 0.5)
    assert (other.predict(X[0]) != cmac.predict(X[0])).all()


def test_cells_are_dense_as_long_as_they_fit_and_hashed_beyond():
    dense_bytes = 8 * 5**2 * 3 * 8
    assert not make_cmac(memory_bytes=dense_bytes).address.hashed
    hashed = make_cmac(memory_bytes=dense_bytes - 1)
    assert hashed.address.hashed
    assert len(hashed.weights) == (dense_bytes - 1) // (3 * 8)


@pytest.mark.parametrize(
    "call",
    [
        lambda cmac: cmac.predict([0.0]),
        lambda cmac: cmac.predict([0.0, np.nan]),
        lambda cmac: cmac.predict([[0.0, -np.inf]]),
        lambda cmac: cmac.predict(np.zeros((2, 3))),
        lambda cmac: cmac.update([0.0, 1.0], [1.0], 0.1),
        lambda cmac: cmac.update([0.0, 1.0], [1.0, np.inf, 0.0], 0.1),
        lambda cmac: cmac.update([0.0, 1.0], np.ones(3), np.nan),
        lambda cmac: cmac.update([[np.inf, 1.0]], np.ones((1, 3)), 0.1),
        lambda cmac: cmac.update(X, ERROR[:3], 0.1),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(call):
    cmac = make_cmac()
    with pytest.raises(ValueError, match=r"expected|shape"):
        call(cmac)
    assert not cmac.weights.any()
    assert_array_equal(cmac.predict([0.0, 1.0]), 0.0)  # of the refused numbers nothing remains


@pytest.mark.parametrize(
    ("high", "options", "error", "named"),
    [
        ([1.0, 3.0], {"layers": 0}, BadInput, "cmac.layers"),
        ([1.0, 3.0], {"cells": 1}, BadInput, "cmac.resolution_elements"),
        ([1.0, 3.0], {"addressing": "sparse"}, BadInput, "cmac.addressing"),
        ([1.0, 3.0], {"addressing": "dense", "memory_bytes": 1000}, BadInput, "cmac.memory_bytes"),
        *((high, {}, ValueError, "ranges") for high in (1.0, [2.0], [0.0, -1.0], [1.0, np.nan])),
    ],
)
def test_settings_out_of_range_are_named(high, options, error, named):
    with pytest.raises(error, match=named):
        Cmac([-1.0, 0.0], high, **options)


def test_weights_and_files_that_do_not_fit_are_refused(tmp_path):
    cmac, file = Cmac([0.0, 0.0], [1.0, 1.0], outputs=2, layers=4, cells=5), tmp_path / "cmac.npz"
    for wrong in (np.zeros((10, 2)), np.zeros(cmac.weights.shape, int), None):
        with pytest.raises(ValueError, match=r"weights must be an array of shape \(100, 2\), float64"):
            cmac.weights = wrong
    cmac.save(file)
    with np.load(file) as saved:
        parts = dict(saved)
    changes = {"weights": np.zeros((10, 2)), "law": parts["law"] * 1000, "low": np.zeros(3), "displacement": [[9, 9]]}
    for name, wrong in changes.items():
        np.savez(file, **(parts | {name: wrong}))
        with pytest.raises(BadInput, match=r"is no file of Cmac\.save"):
            Cmac.load(file)
    file.write_text("none")
    with pytest.raises(BadInput, match=r"is no file of Cmac\.save"):
        Cmac.load(file)
