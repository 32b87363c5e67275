"""Weights that a run leaves and another one starts from."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.rollout import roll_out

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256
from cmacexp.data.integrity import is_finished
from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.loop.scenario import make_scenario

COMMON = ("scenario=one_leg", "reference=aware", "record=trace", "learning.lead=1")
NAMES = ["cmac", "rbf", "ilc", "perceptron"]


def option(name):
    """The override that chooses a feedforward."""
    own = "feedforward._target_=pipelines.perceptron.Perceptron"
    return own if name == "perceptron" else f"feedforward={name}"


@pytest.fixture(scope="module")
def trained(make_config, tmp_path_factory):
    """Folder of a run of six cycles that kept its weights, by feedforward."""
    folders = {name: tmp_path_factory.mktemp(name) for name in NAMES}
    for name, folder in folders.items():
        run_scenario(make_config(*COMMON, option(name), "cycles=6", "record.weights=true"), folder)
    return folders


def started(make_config, trained, name, *more):
    start = (f"learning.start_from={trained[name]}", "learning.start_cycle=1")
    return make_config(*COMMON, option(name), *start, *more)


def feedforward_of(rollout, cycle, samples=600):
    columns = rollout.columns()
    return np.stack([columns[f"tau_feedforward_{j}"][(cycle - 1) * samples : cycle * samples, 0] for j in (1, 2)])


@pytest.mark.parametrize("name", NAMES)
def test_a_run_goes_on_where_another_one_ended(make_config, trained, name):
    """The first cycle with learnt weights has as much feedforward as the next one of a longer run would have."""
    seven = roll_out(make_scenario(make_config(*COMMON, option(name), "cycles=7")))
    start = roll_out(make_scenario(started(make_config, trained, name, "cycles=1")))
    longer, carried = feedforward_of(seven, 7), feedforward_of(start, 1)
    # Start and learning of the first steps differ: the longer run comes from cycle 6, this one from rest.
    assert np.corrcoef(longer[:, 100:].ravel(), carried[:, 100:].ravel())[0, 1] > 0.98


@pytest.mark.parametrize("name", NAMES)
def test_the_first_torque_is_that_of_the_weights(make_config, trained, name):
    scenario = make_scenario(started(make_config, trained, name, "cycles=1", "seed=7"))
    with np.load(trained[name] / WEIGHTS) as kept:
        learnt = scenario.feedforward.learnt()
        assert set(learnt) == set(kept)
        for key, value in learnt.items():
            assert_array_equal(value, kept[key])


def test_another_path_is_addressed_by_the_ranges_that_were_learnt(make_config, trained):
    other = make_scenario(started(make_config, trained, "cmac", "gait.stroke=0.25", "cycles=1"))
    fresh = make_scenario(make_config(*COMMON, "gait.stroke=0.25"))
    with np.load(trained["cmac"] / WEIGHTS) as kept:
        assert_array_equal(other.feedforward.learnt()["ranges"], kept["ranges"])
        assert not np.array_equal(fresh.feedforward.learnt()["ranges"], kept["ranges"])


def test_visited_cells_keep_their_rows_on_another_path(make_config, tmp_path):
    visited = (*COMMON, "cmac.addressing=visited", "cycles=3")
    run_scenario(make_config(*visited, "record.weights=true"), tmp_path)
    start = (f"learning.start_from={tmp_path}", "learning.start_cycle=1")
    same, other = (
        make_scenario(make_config(*visited, *start, *more)).feedforward for more in ([], ["gait.lift=0.17"])
    )
    with np.load(tmp_path / WEIGHTS) as kept:
        assert_array_equal(same.learnt()["visited_1"], kept["visited_1"])
        assert_array_equal(other.learnt()["visited_1"][: len(kept["visited_1"])], kept["visited_1"])
        assert len(other.learnt()["visited_1"]) > len(kept["visited_1"])
        assert not kept["weights"][0, len(kept["visited_1"]) :].any()


def test_weights_are_a_file_of_the_run_and_the_same_each_time(make_config, trained, tmp_path):
    config = make_config(*COMMON, "cycles=6", "record.weights=true")
    run_scenario(config, tmp_path)
    assert (tmp_path / WEIGHTS).read_bytes() == (trained["cmac"] / WEIGHTS).read_bytes()
    assert manifests.read(tmp_path)["files"][WEIGHTS] == sha256(tmp_path / WEIGHTS)
    run_scenario(make_config(*COMMON, "cycles=6"), tmp_path)
    assert not (tmp_path / WEIGHTS).exists()
    assert not is_finished(tmp_path, config)


def test_a_run_is_stale_once_the_weights_it_began_with_have_changed(make_config, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    ilc = (*COMMON, "feedforward=ilc", "record.weights=true")
    run_scenario(make_config(*ilc, "cycles=2"), first)
    config = make_config(*ilc, "cycles=1", f"learning.start_from={first}")
    run_scenario(config, second)
    assert is_finished(second, config)
    run_scenario(make_config(*ilc, "cycles=3"), first)
    assert not is_finished(second, config)


def test_torques_of_samples_are_resampled_for_another_period(make_config, trained):
    scenario = make_scenario(started(make_config, trained, "ilc", "sampling_period=0.01", "cycles=1"))
    with np.load(trained["ilc"] / WEIGHTS) as kept:
        assert_array_equal(scenario.feedforward.learnt()["weights"], kept["weights"][:, ::2])


@pytest.mark.parametrize(("name", "more"), [("cmac", "cmac.layers=8"), ("rbf", "feedforward=ilc")])
def test_weights_of_another_network_are_refused(make_config, trained, name, more):
    with pytest.raises(BadInput) as raised:
        make_scenario(started(make_config, trained, name, more))
    assert raised.value.key == "learning.start_from"


@pytest.mark.parametrize("name", ["none", "inverse_dynamics"])
def test_what_learns_nothing_goes_on_from_nothing_in_its_first_cycle(make_config, tmp_path, name):
    whole = (*COMMON, f"feedforward={name}", "learning.guard=none", "record=metrics", "record.weights=true")
    run_scenario(make_config(*whole, "cycles=2"), tmp_path / "first")
    with np.load(tmp_path / "first" / WEIGHTS) as kept:
        assert not list(kept)
    second = make_config(*whole, "cycles=1", f"learning.start_from={tmp_path / 'first'}", "learning.start_cycle=5")
    torque = feedforward_of(roll_out(make_scenario(second)), 1)
    assert torque.any() == (name == "inverse_dynamics")
