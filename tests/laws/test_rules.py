"""Learning rules: what each does otherwise than the paper's, in any network that is linear in its weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.command import ROOT
from support.loops import run_both
from support.rollout import roll_out

from cmacexp.cmac.memory import read_weighted, train
from cmacexp.cmac.rules import (
    DIVISORS,
    GOALS,
    NEIGHBOURS,
    PAPER,
    RATES,
    REGULARISED,
    RULES,
    TEACHES,
    ZERO,
    Rule,
    RuleParams,
    make_rule,
    rate_after,
    train_by_rule,
)
from cmacexp.cmac.spread import binomial, spread_shares, train_spread
from cmacexp.config.schema import LearningConfig
from cmacexp.feedforward.network import BuiltInFeedforward, network
from cmacexp.loop.scenario import make_scenario

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


def documented(name, rule, config):
    """The row of a rule in docs/learning-rules.md."""
    choices = (TEACHES[rule.params.teaches], DIVISORS[rule.params.divisor], GOALS[rule.params.goal])
    strength = "none"
    if rule.strength:
        unit = LearningConfig.__dataclass_fields__[rule.strength].metadata["unit"]
        strength = f"`{rule.strength}` {getattr(config, rule.strength):g} {unit}".strip()
    return f"| `{name}` | {' | '.join(choices)} | {RATES[rule.params.rate]} | {strength} | {rule.source} |"


@pytest.mark.parametrize(("name", "rule"), RULES.items())
def test_the_documentation_has_the_row_of_every_rule(make_config, name, rule):
    page = (ROOT / "docs" / "learning-rules.md").read_text()
    assert documented(name, rule, make_config().learning) in page.splitlines()


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
    after, paper = trained(rule, strength, activation, error)
    step = 0.2 * np.array([error, -error]) / np.cumsum(activation * activation)[-1]  # from left to right
    paper[CELLS] += activation[:, None] * step
    assert_array_equal(after, paper)


@pytest.mark.parametrize(("rule", "strength"), WITHOUT.items())
def test_with_activations_of_one_it_is_that_of_the_cmac_to_the_bit(rule, strength):
    after, paper = trained(rule, strength, np.ones(4), 3.0)
    train(paper, CELLS, np.array([3.0, -3.0]), 0.2)
    assert_array_equal(after, paper)


@given(activations, errors)
@pytest.mark.parametrize("rule", [name for name, rule in RULES.items() if rule.params.teaches != NEIGHBOURS])
def test_weights_that_are_not_active_stay(rule, activation, error):
    after, before = trained(rule, 0.3, activation, error)
    assert_array_equal(after[OTHERS], before[OTHERS])


def test_without_activation_nothing_is_learnt():
    after, before = trained("paper", 0.0, np.zeros(4), 3.0)
    assert_array_equal(after, before)


def test_normalised_learns_less_where_little_is_active():
    for scale, part in ((1.0, 4.0 / 5.0), (0.1, 0.04 / 1.04)):
        activation = np.full(4, scale)
        after, before = trained("normalised", 1.0, activation, 2.0, rate=0.5)
        assert_allclose(output(after, activation) - output(before, activation), [part, -part])


@given(activations, st.floats(-0.5, 0.5))
def test_the_dead_zone_teaches_nothing(activation, error):
    after, before = trained("dead_zone", 0.5, activation, error)
    assert_array_equal(after, before)


def test_beyond_the_dead_zone_the_whole_error_teaches():
    after, before = trained("dead_zone", 0.5, np.ones(4), 0.6)
    assert_allclose((after - before)[CELLS, 0], 0.2 * 0.6 / 4)


def test_leakage_takes_its_part_of_every_active_weight():
    after, before = trained("leakage", 0.1, np.ones(4), 0.0)
    assert_allclose(after[CELLS], (1.0 - 0.2 * 0.1) * before[CELLS])


def test_what_is_half_as_active_leaks_half_as_much():
    after, before = trained("leakage", 0.1, [1.0, 0.5, 1.0, 0.0], 0.0)
    assert_allclose((after / before)[CELLS, 0], [0.98, 0.99, 0.98, 1.0])


@given(activations, st.lists(errors, min_size=1, max_size=30), st.floats(0.001, 10.0))
def test_e_modification_bounds_every_weight(activation, learning_error, strength):
    largest = max(1.0 / strength, 0.2 * max(map(abs, learning_error)))  # or what one error teaches, if that is more
    bound = activation.max() / (activation @ activation) * largest
    weights = np.zeros((9, 2))
    for error in learning_error:
        weights, _ = trained("e_modification", strength, activation, error, weights=weights)
        assert np.abs(weights).max() <= bound * (1 + 1e-9)


def test_e_modification_leaves_weights_where_there_is_no_error():
    after, before = trained("e_modification", 5.0, np.ones(4), 0.0)
    assert_array_equal(after, before)


@given(activations, st.floats(0.0, 1.0))
def test_smoothing_leaves_the_output_as_it_is(activation, kappa):
    after, before = trained("weight_smoothing", kappa, activation, 0.0)
    assert_allclose(output(after, activation), output(before, activation), atol=1e-12)


def test_smoothing_keeps_the_mean_of_the_active_weights_and_draws_them_to_it():
    after, before = trained("weight_smoothing", 0.7, np.ones(4), 0.0)
    mean = before[CELLS].mean(axis=0)
    assert_allclose(after[CELLS] - mean, (1.0 - 0.2 * 0.7) * (before[CELLS] - mean))


def test_the_rate_decays_to_half_and_a_third():
    rule = RULES["decaying_rate"].params._replace(strength=100.0)
    assert [rate_after(rule, 0.6, n) for n in (0, 100, 200)] == pytest.approx([0.6, 0.3, 0.2])
    assert rate_after(PAPER, 0.6, 100) == 0.6


@pytest.mark.parametrize("window", [0, 1, 4, 10])
def test_the_binomial_filter_turns_no_frequency_round(window):
    taps = binomial(window)
    assert_allclose(taps, taps[::-1])
    turn = np.linspace(0.0, np.pi, 50)
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
    after, before = trained("leakage", 0.1, activation, error)
    spread = before.copy()
    train_spread(spread, rows[0, 0], share[0, 0], np.array([error, -error]), 0.2, 0.0)
    assert_allclose(spread, trained("paper", 0.0, activation, error)[0], atol=1e-12)
    train_spread(before, rows[0, 0], share[0, 0], np.array([error, -error]), 0.2, 0.1 / activation.max() * power)
    assert_allclose(before, after, atol=1e-12)


# In the loop


class Tents(BuiltInFeedforward):
    """Weights every tenth sample, of which two neighbours are active by their distance."""

    def reset(self, setup):
        samples, legs = setup.plan.support.shape
        left, part = np.divmod(np.arange(samples), 10)
        cells = np.stack([left, left + 1], axis=1) % (samples // 10)
        activation = np.stack([10 - part, part], axis=1) / 10.0
        shape = (samples, legs, 2)
        spread = [np.broadcast_to(a[:, None, :], shape) for a in (cells, activation)]
        self.params = network(setup, spread[0], samples // 10, spread[1])


@pytest.mark.parametrize("feedforward", ["cmac", "tents"])
@pytest.mark.parametrize("rule", RULES)
def test_both_loops_give_the_same_bits(make_config, rule, feedforward):
    own = [f"feedforward._target_={__name__}.{Tents.__name__}"] if feedforward == "tents" else []
    learns = f"learning.rule={rule}", f"learning.lead={list(RULES).index(rule) % 3}", "learning.start_cycle=1"
    config = make_config("cycles=2", "gait.cycle_time=0.5", *learns, *own)
    share = np.abs(run_both(config).columns()["tau_feedforward_1"])[-config.steps_per_cycle :].mean()
    assert share > 0.1  # it has learnt


def test_no_two_rules_are_the_same(make_config):
    ends = {
        roll_out(make_scenario(make_config("cycles=3", "gait.cycle_time=1", f"learning.rule={rule}")))
        .samples[-1]
        .tobytes()
        for rule in RULES
    }
    assert len(ends) == len(RULES)


@pytest.mark.parametrize("rule", ["weight_smoothing", "e_modification"])
def test_a_rule_that_holds_outlasts_the_papers_law(make_config, rule):
    ended = {
        each: roll_out(make_scenario(make_config("cycles=400", f"learning.rule={each}"))).status
        for each in ("paper", rule)
    }
    assert ended == {"paper": "diverged", rule: "completed"}


@pytest.mark.parametrize("lead", [0, 1, 2])
def test_zero_phase_holds_whatever_the_lead(make_config, lead):
    changed = ("cycles=400", f"learning.lead={lead}")
    ended = [
        roll_out(make_scenario(make_config(*changed, f"learning.rule={rule}"))) for rule in ("paper", "zero_phase")
    ]
    assert ended[0].status == ("completed" if lead == 1 else "diverged")
    assert ended[1].status == "completed"
    feedback = np.abs(ended[1].columns()["tau_feedback_1"]).reshape(400, -1).mean(axis=1)
    assert feedback[-1] < 1.5 * feedback.min() < 0.3 * feedback[0]
