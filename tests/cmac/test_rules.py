"""Learning rules: what each does otherwise than the paper's, in any network that is linear in its weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import BadInput

from cmacexp.cmac import rules
from cmacexp.cmac.memory import read_weighted, train
from cmacexp.cmac.rules import (
    NEIGHBOURS,
    PAPER,
    REGULARISED,
    RULES,
    ZERO,
    Rule,
    RuleParams,
    binomial,
    make_rule,
    rate_after,
    spread_shares,
    train_by_rule,
    train_spread,
)

CELLS = np.array([4, 0, 7, 2], dtype=np.uint32)
OTHERS = [row for row in range(9) if row not in CELLS]
WITHOUT = {"normalised": 0.0, "dead_zone": 0.0, "leakage": 0.0, "e_modification": 0.0, "weight_smoothing": 0.0}
"""Strengths at which a rule is the paper's."""
activations = st.lists(st.floats(0.01, 3.0), min_size=4, max_size=4).map(np.array)
errors = st.floats(-50.0, 50.0)


def weights_at_first():
    return np.random.default_rng(3).normal(size=(9, 2))


def trained(rule, strength, activation, error, rate=0.2, weights=None):
    """Weights after one step of ``rule``, and those before."""
    before = weights_at_first() if weights is None else weights
    after = before.copy()
    params = RULES[rule].params._replace(strength=strength)
    train_by_rule(params, after, CELLS, np.asarray(activation), np.array([error, -error]), rate)
    return after, before


def output(weights, activation):
    given = np.empty(2)
    read_weighted(weights, CELLS, np.asarray(activation), given)
    return given


def test_a_rule_that_is_added_to_the_table_is_learnt_by(make_config, monkeypatch):
    halved = Rule("a test", "regularisation", RuleParams(divisor=REGULARISED, goal=ZERO))
    monkeypatch.setitem(RULES, "mine", halved)
    config = make_config("learning.rule=mine", "learning.regularisation=0.5").learning
    rule = make_rule(config, np.full((3, 1, 4), 2.0))
    assert rule == RuleParams(divisor=REGULARISED, goal=ZERO, strength=8.0)  # half of sum a_i^2
    weights = weights_at_first()
    train_by_rule(rule, weights, CELLS, np.ones(4), np.array([6.0, 0.0]), 0.1)
    assert_allclose(weights[CELLS, 0], 0.2 * weights_at_first()[CELLS, 0] + 0.05)


@given(activations, errors)
@pytest.mark.parametrize(("rule", "strength"), WITHOUT.items())
def test_a_rule_without_strength_is_the_papers_to_the_bit(rule, strength, activation, error):
    for active in (activation, np.ones(4)):
        after, paper = trained(rule, strength, active, error)
        if active is activation:
            step = 0.2 * np.array([error, -error]) / np.cumsum(activation * activation)[-1]  # from left to right
            paper[CELLS] += activation[:, None] * step
        else:
            train(paper, CELLS, np.array([error, -error]), 0.2)  # that of the CMAC
        assert_array_equal(after, paper)


@given(activations, errors)
@pytest.mark.parametrize("rule", [name for name, rule in RULES.items() if rule.params.teaches != NEIGHBOURS])
def test_weights_that_are_not_active_stay(rule, activation, error):
    after, before = trained(rule, 0.3, activation, error)
    assert_array_equal(after[OTHERS], before[OTHERS])
    after, before = trained(rule, 0.3, np.zeros(4), error)
    assert_array_equal(after, before)


def test_normalised_learns_less_where_little_is_active():
    for scale, part in ((1.0, 4.0 / 5.0), (0.1, 0.04 / 1.04)):
        activation = np.full(4, scale)
        after, before = trained("normalised", 1.0, activation, 2.0, rate=0.5)
        assert_allclose(output(after, activation) - output(before, activation), [part, -part])


@given(activations, st.floats(-0.5, 0.5))
def test_in_the_dead_zone_nothing_teaches_and_beyond_it_the_whole_error(activation, error):
    after, before = trained("dead_zone", 0.5, activation, error)
    assert_array_equal(after, before)
    after, before = trained("dead_zone", 0.5, np.ones(4), 0.6)
    assert_allclose((after - before)[CELLS, 0], 0.2 * 0.6 / 4)


def test_leakage_takes_its_part_of_every_active_weight():
    after, before = trained("leakage", 0.1, [1.0, 0.5, 1.0, 0.0], 0.0)
    assert_allclose((after / before)[CELLS, 0], [0.98, 0.99, 0.98, 1.0])


@given(activations, st.lists(errors, min_size=1, max_size=30), st.floats(0.001, 10.0))
def test_e_modification_bounds_every_weight_and_leaves_it_where_there_is_no_error(
    activation, learning_error, strength
):
    after, before = trained("e_modification", strength, activation, 0.0)
    assert_array_equal(after, before)
    largest = max(1.0 / strength, 0.2 * max(map(abs, learning_error)))  # or what one error teaches, if that is more
    bound = activation.max() / (activation @ activation) * largest
    weights = np.zeros((9, 2))
    for error in learning_error:
        weights, _ = trained("e_modification", strength, activation, error, weights=weights)
        assert np.abs(weights).max() <= bound * (1 + 1e-9)


@given(activations, st.floats(0.0, 1.0))
def test_smoothing_draws_weights_to_their_mean_and_leaves_the_output(activation, kappa):
    after, before = trained("weight_smoothing", kappa, activation, 0.0)
    assert_allclose(output(after, activation), output(before, activation), atol=1e-12)
    after, before = trained("weight_smoothing", kappa, np.ones(4), 0.0)
    mean = before[CELLS].mean(axis=0)
    assert_allclose(after[CELLS] - mean, (1.0 - 0.2 * kappa) * (before[CELLS] - mean), atol=1e-12)


def test_the_rate_decays_to_half_and_a_third():
    rule = RULES["decaying_rate"].params._replace(strength=100.0)
    assert [rate_after(rule, 0.6, n) for n in (0, 100, 200)] == pytest.approx([0.6, 0.3, 0.2])
    assert rate_after(PAPER, 0.6, 100) == 0.6


@pytest.mark.parametrize("window", [0, 1, 4])
def test_the_binomial_filter_turns_no_frequency_round(window):
    taps, turn = binomial(window), np.linspace(0.0, np.pi, 50)
    assert_allclose(taps, taps[::-1])
    passed = (taps * np.cos(turn[:, None] * np.arange(-window, window + 1))).sum(axis=1)
    assert_allclose(passed, np.cos(turn / 2.0) ** (2 * window), atol=1e-12)


def test_an_error_teaches_the_steps_around_the_end_of_the_cycle_too():
    cells = np.array([5, 5, 6, 7, 8], dtype=np.uint32).reshape(5, 1, 1)
    rows, share = spread_shares(cells, np.full((5, 1, 1), 2.0), 1)
    of = {k: dict(zip(rows[k, 0], share[k, 0], strict=True)) for k in range(5)}
    assert of[0] == {5: 0.375, 8: 0.125, 0: 0.0}  # half of 0.75 and 0.25, since the activation is two
    assert of[1] == {5: 0.375, 6: 0.125, 0: 0.0}
    assert of[3] == {6: 0.125, 7: 0.25, 8: 0.125}


@given(activations, errors)
def test_without_a_window_the_spread_error_is_that_of_leakage(activation, error):
    power = activation @ activation
    rows, share = spread_shares(CELLS[None, None], activation[None, None], 0)
    for leakage, rule, strength in ((0.0, "paper", 0.0), (0.1 / activation.max() * power, "leakage", 0.1)):
        after, changed = trained(rule, strength, activation, error)
        train_spread(changed, rows[0, 0], share[0, 0], np.array([error, -error]), 0.2, leakage)
        assert_allclose(changed, after, atol=1e-12)


@pytest.mark.parametrize(("samples", "widest"), [(4, 1), (5, 2), (30, 2)])
def test_a_window_wider_than_the_cycle_or_the_memory_is_refused(samples, widest, monkeypatch):
    cells = np.arange(samples * 6, dtype=np.uint32).reshape(samples, 2, 3)
    monkeypatch.setattr(rules, "MOST_ENTRIES", 5 * cells.size)  # two neighbours on each side
    rows, share = spread_shares(cells, np.ones(cells.shape), widest)
    assert_allclose(share.sum(axis=2), 1.0)
    assert rows.shape[2] == 3 * (2 * widest + 1)
    with pytest.raises(BadInput, match=r"learning\.window"):
        spread_shares(cells, np.ones(cells.shape), widest + 1)
