"""Laws of the perceptron: what it learns from, when, and in which units."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import BadInput, make_scenario

from cmacexp.control import Reference
from pipelines.perceptron import Perceptron

pytestmark = pytest.mark.ci

SMALL = (
    "feedforward._target_=pipelines.perceptron.Perceptron",
    "gait.cycle_time=0.2",
    "gait.lift=0.005",
    "learning.rate=0.5",
)
"""A cycle of 40 samples."""


@pytest.fixture(scope="module")
def setup(make_config):
    return make_scenario(make_config("scenario=quadruped", *SMALL)).setup


def make(setup, passes=3, batch=10, **fields):
    network = Perceptron(Perceptron.Config(hidden=6, passes=passes, batch=batch, step_size=0.01))
    network.reset(replace(setup, **fields))
    return network


def torques(network, errors, start=0):
    """Torques (steps, L, 2) of a network that is told the feedback ``errors`` (steps, L, 2) of each last step."""
    given, samples = [], len(network.torque)
    for step, error in enumerate(errors, start):
        nothing = (None,) * 5
        given.append(network.predict(Reference(step, step % samples, True, *nothing), error).copy())
    return np.array(given)


def random_errors(cycles, setup, seed=0):
    samples, legs = setup.plan.support.shape
    return np.random.default_rng(seed).normal(size=(cycles * samples, legs, 2))


def test_inputs_have_mean_0_and_deviation_1_and_what_stands_still_is_0(setup):
    network = make(setup)
    assert_allclose(network.paths.mean(axis=1), 0.0, atol=1e-12)
    assert_allclose(network.paths.std(axis=1), 1.0)
    joints = setup.plan.joints.copy()
    joints[:, 2, 0] = 0.3
    still = make(setup, plan=setup.plan._replace(joints=joints)).paths
    assert_allclose(still[2].std(axis=0), [0.0, 1.0, 1.0, 1.0], atol=1e-12)
    assert_array_equal(np.delete(still, 2, axis=0), np.delete(network.paths, 2, axis=0))


def test_it_learns_at_the_end_of_each_cycle_alone_and_gives_nothing_before(setup):
    samples = len(setup.plan.support)
    network, errors = make(setup), random_errors(3, setup)
    for cycle in range(3):
        before, rows = network.torque.copy(), slice(cycle * samples, (cycle + 1) * samples)
        given = torques(network, errors[rows], cycle * samples)
        assert_array_equal(given, network.torque)  # one table throughout the cycle
        assert (np.abs(network.torque - before).max(axis=0) > 0.0).all() == (cycle > 0)  # of each leg and joint
        assert given.any() == (cycle > 0)


def test_each_leg_learns_from_its_own_feedback(setup):
    errors = random_errors(2, setup)
    for leg in range(4):
        others = errors.copy()
        others[:, leg] += 1.0
        changed = (torques(make(setup), errors) != torques(make(setup), others)).any(axis=(0, 2))
        assert_array_equal(changed, np.arange(4) == leg)


def test_it_goes_on_from_what_was_learnt(setup):
    network = make(setup)
    torques(network, random_errors(3, setup))
    learnt = {name: value.copy() for name, value in network.learnt().items()}
    again = make(replace(setup, config=replace(setup.config, seed=5)), learnt=learnt)
    assert_allclose(again.torque, network.torque, rtol=1e-12)
    for name, value in again.learnt().items():
        assert_array_equal(value, learnt[name])
    steeper = setup.plan._replace(joints=2.0 * setup.plan.joints)
    doubled = 2.0 * (network.paths * network.spread + network.middle)
    # Standardised as the path that was learnt.
    assert_allclose(make(setup, plan=steeper, learnt=learnt).paths, (doubled - network.middle) / network.spread)


def test_without_its_library_it_says_how_to_get_it_in_one_line(make_config, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    with pytest.raises(BadInput, match="pip install") as refused:
        make_scenario(make_config(*SMALL))
    assert "\n" not in str(refused.value)
