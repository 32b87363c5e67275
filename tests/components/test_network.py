"""Networks that are linear in their weights: their kernels, and a network of one's own in both loops."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.cmac.memory import read, read_weighted, train
from cmacexp.cmac.rules import PAPER, train_by_rule
from cmacexp.feedforward.network import BuiltInFeedforward, network
from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario

CELLS = np.array([4, 0, 7], dtype=np.uint32)


@given(st.lists(st.floats(0.01, 10.0), min_size=3, max_size=3), st.floats(0.01, 2.0), st.floats(-50.0, 50.0))
def test_one_weighted_update_moves_the_output_by_rate_times_error(activation, rate, error):
    weights, before, after = np.random.default_rng(0).normal(size=(9, 2)), np.empty(2), np.empty(2)
    read_weighted(weights, CELLS, np.array(activation), before)
    train_by_rule(PAPER, weights, CELLS, np.array(activation), np.array([error, -error]), rate)
    read_weighted(weights, CELLS, np.array(activation), after)
    assert_allclose(after - before, [rate * error, -rate * error], atol=1e-11)


def test_activations_of_one_are_the_cmac():
    plain, weighted = np.ones((9, 2)), np.ones((9, 2))
    train(plain, CELLS, np.array([3.0, -1.0]), 0.2)
    train_by_rule(PAPER, weighted, CELLS, np.ones(3), np.array([3.0, -1.0]), 0.2)
    outputs = np.empty((2, 2))
    read(plain, CELLS, outputs[0])
    read_weighted(weighted, CELLS, np.ones(3), outputs[1])
    assert_allclose(plain, weighted, rtol=1e-15)
    assert_allclose(*outputs, rtol=1e-15)


def test_without_activation_nothing_is_learnt():
    weights = np.ones((9, 2))
    train_by_rule(PAPER, weights, CELLS, np.zeros(3), np.array([3.0, -1.0]), 0.2)
    assert_array_equal(weights, 1.0)


class TwoNeighbours(BuiltInFeedforward):
    """One weight a sample, of which two neighbours are active."""

    def reset(self, setup):
        samples, legs = setup.plan.support.shape
        cells = (np.arange(samples)[:, None, None] + np.array([0, 1])) % samples
        shape = (samples, legs, 2)
        self.params = network(setup, np.broadcast_to(cells, shape), samples, np.broadcast_to([0.7, 0.3], shape))


def test_a_network_of_ones_own_learns_and_both_loops_give_the_same_bits(make_config):
    config = make_config("scenario=one_leg", "cycles=4", f"feedforward._target_={__name__}.{TwoNeighbours.__name__}")
    fused, stepped = roll_out(make_scenario(config)), roll_out(make_scenario(config), fused=False)
    assert_array_equal(fused.samples, stepped.samples)
    tau = fused.columns()["tau_feedforward_1"].reshape(4, -1)
    assert np.all(tau[0] == 0.0)
    assert np.all(np.diff(np.abs(tau).sum(axis=1)) > 10.0)  # what it takes over grows
