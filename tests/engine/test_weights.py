"""Weights that a run leaves and another one starts from."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import compose_config, is_finished, make_scenario, roll_out

import cmacexp

COMMON = ("scenario=one_leg", "reference=aware", "learning.lead=1", "gait.cycle_time=1", "gait.lift=0.05")
SAMPLES = 200
KEEP = ("record=trace", "record.weights=true")
NAMES = {
    "cmac": "feedforward=cmac",
    "rbf": "feedforward=rbf",
    "ilc": "feedforward=ilc",
    "perceptron": "feedforward._target_=pipelines.perceptron.Perceptron",
}


def weights_of(folder):
    return dict(np.load(folder / "weights.npz"))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Folder of a run of six cycles that kept its weights, by feedforward."""
    folders = {name: tmp_path_factory.mktemp(name) for name in NAMES}
    for name, folder in folders.items():
        cmacexp.run([*COMMON, NAMES[name], "cycles=6", *KEEP], folder)
    return folders


def started(folder, *overrides):
    """The scenario of a run of one cycle that starts from the weights in ``folder``."""
    start = (f"learning.start_from={folder}", "learning.start_cycle=1", "cycles=1")
    return make_scenario(compose_config([*COMMON, *start, *overrides]))


def torque_of(rollout, cycle):
    columns, rows = rollout.columns(), slice((cycle - 1) * SAMPLES, cycle * SAMPLES)
    return np.stack([columns[f"tau_feedforward_{j}"][rows, 0] for j in (1, 2)])


@pytest.mark.ci
@pytest.mark.parametrize("name", NAMES)
def test_a_run_goes_on_where_another_one_ended(trained, name):
    """The first cycle with learnt weights has as much feedforward as the next one of a longer run would have."""
    seven = roll_out(make_scenario(compose_config([*COMMON, NAMES[name], "cycles=7"])))
    scenario = started(trained[name], NAMES[name], "seed=7")
    kept, learnt = weights_of(trained[name]), scenario.feedforward.learnt()
    assert learnt.keys() == kept.keys()
    for key, value in learnt.items():
        assert_array_equal(value, kept[key])
    # Start and learning of the first steps differ: the longer run comes from cycle 6, this one from rest.
    longer, carried = torque_of(seven, 7)[:, 40:], torque_of(roll_out(scenario), 1)[:, 40:]
    assert np.corrcoef(longer.ravel(), carried.ravel())[0, 1] > 0.98


def test_another_path_keeps_the_ranges_and_rows_that_were_learnt(tmp_path):
    visited = (*COMMON, "cmac.addressing=visited")
    cmacexp.run([*visited, "cycles=2", *KEEP], tmp_path)
    kept, other = weights_of(tmp_path), started(tmp_path, *visited, "gait.lift=0.07").feedforward.learnt()
    fresh = make_scenario(compose_config([*visited, "gait.lift=0.07"])).feedforward.learnt()
    assert_array_equal(other["ranges"], kept["ranges"])
    assert (fresh["ranges"] != kept["ranges"]).any()
    known = len(kept["visited_1"])
    assert_array_equal(other["visited_1"][:known], kept["visited_1"])
    assert len(other["visited_1"]) > known
    assert not kept["weights"][0, known:].any()


def test_runs_that_began_with_other_weights_are_stale(tmp_path):
    first, second, ilc = tmp_path / "first", tmp_path / "second", (*COMMON, "feedforward=ilc")
    cmacexp.run([*ilc, *KEEP, "cycles=2"], first)
    overrides = [*ilc, *KEEP, "cycles=1", f"learning.start_from={first}"]
    cmacexp.run(overrides, second)
    assert is_finished(second, compose_config(overrides))
    cmacexp.run([*ilc, *KEEP, "cycles=3"], first)
    assert not is_finished(second, compose_config(overrides))
