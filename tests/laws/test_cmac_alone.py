"""The CMAC as a library: one input or a batch, ranges and defaults of its own, files, and scikit-learn."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from cmacexp.cmac import Cmac, CmacRegressor
from cmacexp.cmac.network import WORD_BYTES
from cmacexp.errors import BadInput

RNG = np.random.default_rng(5)
X, ERROR = RNG.uniform(-1.2, 3.2, (150, 2)), RNG.normal(size=(150, 3))
KINDS = [{}, {"receptive_field": "cubic"}, {"memory_bytes": 2000}, {"addressing": "visited"}]


def make_cmac(layers=8, cells=5, **options):
    return Cmac([-1.0, 0.0], [1.0, 3.0], 3, layers, cells, **options)


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_single_inputs_have_the_bits_of_a_batch(options):
    batch, single = make_cmac(**options), make_cmac(**options)
    batch.update(X, ERROR, 0.4)
    for x, error in zip(X, ERROR, strict=True):
        assert single.update(x, error, 0.4) is None
    assert single.weights.any()
    assert single.clipped == batch.clipped > 0
    one_by_one = np.stack([single.predict(list(x)) for x in X])
    assert one_by_one.shape == (150, 3)
    assert one_by_one.tobytes() == batch.predict(X).tobytes()
    assert single.clipped == batch.clipped


def test_outputs_are_new_arrays_and_follow_weights_that_are_replaced():
    cmac = make_cmac()
    first = cmac.predict([0.0, 1.0])
    cmac.weights = np.ones_like(cmac.weights)
    assert_array_equal(first, 0.0)
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


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_a_file_keeps_every_bit(tmp_path, options):
    cmac = make_cmac(**options)
    cmac.update(X, ERROR, 0.7)
    cmac.save(str(tmp_path / "cmac.npz"))
    loaded = Cmac.load(tmp_path / "cmac.npz")
    assert loaded.weights.tobytes() == cmac.weights.tobytes()
    loaded.update(X[0], ERROR[0], 0.1)
    cmac.update(X[0], ERROR[0], 0.1)
    assert loaded.predict(X[0]).tobytes() == cmac.predict(X[0]).tobytes()


def test_cells_are_dense_as_long_as_they_fit_and_hashed_beyond():
    dense_bytes = 8 * 5**2 * 3 * WORD_BYTES
    assert not make_cmac(memory_bytes=dense_bytes).address.hashed
    hashed = make_cmac(memory_bytes=dense_bytes - 1)
    assert hashed.address.hashed
    assert len(hashed.weights) == (dense_bytes - 1) // (3 * WORD_BYTES)


@pytest.mark.parametrize(
    "call",
    [
        lambda cmac: cmac.predict([0.0]),
        lambda cmac: cmac.predict([0.0, np.nan]),
        lambda cmac: cmac.predict(np.zeros((2, 3))),
        lambda cmac: cmac.update([0.0, 1.0], [1.0], 0.1),
        lambda cmac: cmac.update([0.0, 1.0], [1.0, np.inf, 0.0], 0.1),
        lambda cmac: cmac.update([0.0, 1.0], np.ones(3), np.nan),
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
    ("options", "said"),
    [
        ({"layers": 0}, "cmac.layers=0: must be at least 1"),
        ({"cells": 1}, "cmac.resolution_elements=1"),
        ({"addressing": "sparse"}, "cmac.addressing=sparse: choose from"),
        ({"addressing": "dense", "memory_bytes": 1000}, "cmac.memory_bytes=1000"),
    ],
)
def test_settings_out_of_range_are_named(options, said):
    with pytest.raises(BadInput, match=said):
        make_cmac(**options)


@pytest.mark.parametrize("high", [1.0, [2.0], [0.0, -1.0], [1.0, np.nan]])
def test_ranges_must_be_two_arrays_one_below_the_other(high):
    with pytest.raises(ValueError, match="ranges from"):
        Cmac([0.0, 0.0], high)


def test_importing_it_needs_neither_hydra_nor_tables_nor_the_compiler():
    heavy = ["hydra", "omegaconf", "pandas", "pyarrow", "numba", "scipy", "sklearn"]
    code = (
        f"import sys; from cmacexp.cmac import Cmac; Cmac([0], [1]); print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def wanted(x):
    return np.sin(3.0 * x[:, 0]) * np.cos(x[:, 1])


def test_the_regressor_generalises_and_works_in_scikit_learn():
    sklearn = pytest.importorskip("sklearn.base")
    from sklearn.model_selection import cross_val_score

    regressor = CmacRegressor(passes=8)
    assert sklearn.clone(regressor).get_params() == regressor.get_params()
    assert min(cross_val_score(regressor, X, wanted(X), cv=3)) > 0.5
    assert regressor.set_params(cells=5).fit(X, ERROR).predict(X).shape == ERROR.shape
    fitted = regressor.fit(X, wanted(X))
    assert fitted.predict(X).shape == (150,)
    assert fitted.score(X, wanted(X)) > 0.95
    with pytest.raises(ValueError, match="no parameter width"):
        regressor.set_params(width=3)
