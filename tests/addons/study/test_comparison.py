"""Methods compared over tasks and worlds: what naive statistics get wrong, and laws of all results."""

import numpy as np
import pytest
from support.doors import BadInput

from cmacexp.addons.study.comparison import (
    relative_to,
    split_tasks,
)
from cmacexp.addons.study.interval import estimate
from cmacexp.study import Comparison, compare

TASKS, WORLDS = [f"task {number}" for number in range(8)], range(20)
RUNS = len(TASKS) * len(WORLDS)


def made(levels, spread=0.05, by_world=0.0, seed=1):
    """Scores about a level for each method; worlds are hard or easy for all methods and tasks alike."""
    rng = np.random.default_rng(seed)
    world, shape = by_world * rng.standard_normal(len(WORLDS)), (len(TASKS), len(WORLDS))
    return {name: level * np.exp(spread * rng.standard_normal(shape) + world) for name, level in levels.items()}


def comparison(levels, **how):
    return Comparison(made(levels, **how), TASKS, WORLDS)


def failing(scores, where):
    return Comparison({**scores, "A": np.where(where, np.inf, scores["A"])}, TASKS, WORLDS)


def test_failures_enter_no_mean_and_decide_the_order_first():
    """A method that leaves out its worst quarter by failing has the smaller mean, and is not the better one."""
    scores = made({"A": 0.4, "B": 0.41}, spread=0.3)
    worst = scores["A"] >= np.sort(scores["A"].ravel())[-RUNS // 4]
    found = failing(scores, worst)
    assert found.mean("A").value == pytest.approx(scores["A"][~worst].mean())
    assert (found.mean("A").count, found.failures("A").value) == (RUNS - RUNS // 4, 0.25)
    assert found.ratio("A", "B").value == pytest.approx(scores["A"][~worst].sum() / scores["B"][~worst].sum())
    assert found.ratio("A", "B").high < 1.0
    assert found.beats("B", "A")
    assert not found.beats("A", "B")
    assert found.order().methods == ("B", "A")


def test_one_task_that_decides_leaves_no_single_rank_and_is_named():
    scores = made({"A": 0.55, "B": 0.53}, spread=0.03)
    scores["A"][0], scores["B"][0] = 0.02, 0.9
    found = Comparison(scores, TASKS, WORLDS)
    assert found.beats("A", "B")
    assert found.without(TASKS[0]).beats("B", "A")
    assert found.order().methods == ()
    assert f"B without {TASKS[0]}" in found.order().sentence


def test_what_is_relative_to_a_failure_is_no_score():
    for undefined in (0.0, np.nan, -1.0, np.inf):
        with pytest.raises(BadInput):
            relative_to(np.ones(2), np.array([1.0, undefined]))
    assert relative_to(np.array([1.0, np.nan, np.inf]), np.full(3, 2.0)).tolist() == [0.5, np.inf, np.inf]


def test_a_task_in_which_the_reference_fails_is_excluded_with_its_reason():
    values = made({"feedback": 2.0, "A": 1.0})
    for method in values:
        values[method][2, 7] = np.nan
    values["feedback"][5, 0] = 0.0
    counted, excluded = split_tasks(values["feedback"], TASKS, WORLDS)
    assert counted == [task for task in TASKS if task not in (TASKS[2], TASKS[5])]
    assert "nan in 7" in excluded[TASKS[2]]
    assert "0 in 0" in excluded[TASKS[5]]
    found = compare(values, "feedback", TASKS, WORLDS)
    assert (found.tasks, found.excluded, found.without(TASKS[0]).excluded) == (counted, excluded, excluded)
    assert np.isfinite(found.ratio("A", "feedback").value)
    assert (found.scores["feedback"] == 1.0).all()


def everything(found, methods):
    each = {m: (found.mean(m), found.failures(m)) for m in methods}
    profiles = [part.tolist() for m in methods for part in found.profile(m, np.geomspace(0.1, 2.0, 7))]
    pairs = [(found.ratio(a, b), found.probability_of_improvement(a, b)) for a in methods for b in methods]
    return each, profiles, pairs, found.order()


def test_no_bit_depends_on_the_order_of_methods_tasks_and_worlds():
    methods, rng = ["A", "B", "C"], np.random.default_rng(3)
    scores = made({"A": 0.40, "B": 0.401, "C": 0.5}, spread=0.3, by_world=0.4)
    scores["B"][1, 3] = np.inf
    tasks, worlds = rng.permutation(len(TASKS)), rng.permutation(len(WORLDS))
    shuffled = {name: scores[name][np.ix_(tasks, worlds)] for name in reversed(methods)}
    found = Comparison(shuffled, [TASKS[i] for i in tasks], [WORLDS[i] for i in worlds])
    assert everything(found, methods) == everything(Comparison(scores, TASKS, WORLDS), methods)


def test_worlds_are_paired_and_clusters():
    """Two intervals apart waste the pairs; one over runs denies that tasks of a world are alike."""
    scores = made({"A": 0.40, "B": 0.42}, by_world=0.4)
    found = Comparison(scores, TASKS, WORLDS)
    one, over_runs = found.mean("A"), estimate(scores["A"].ravel())
    assert one.low < found.mean("B").value < one.high
    assert found.ratio("A", "B").high < 1.0
    assert one.high - one.low > 2.0 * (over_runs.high - over_runs.low)


@pytest.mark.nightly
@pytest.mark.parametrize("worlds", [5, 20])
def test_intervals_contain_the_truth_as_often_as_they_say(worlds):
    """Scores of seven tasks in worlds of different difficulty; in one task every second run fails."""
    rng, rounds, many = np.random.default_rng(5), 2000, 100_000
    levels = np.array([0.03, 0.03, 0.03, 0.04, 0.06, 0.04, 0.05])[:, None]

    def draw_quantities(count):
        hard = 0.3 * rng.standard_normal(count)
        a, b = (levels * np.exp(hard + 0.2 * rng.standard_normal((7, count))) for _ in "ab")
        a[4, rng.random(count) < 0.5] = np.inf
        found = Comparison({"A": a, "B": 1.1 * b}, [*"abcdefg"], range(count))
        return found.mean("A"), found.ratio("A", "B"), found.probability_of_improvement("A", "B")

    truth = [quantity.value for quantity in draw_quantities(many)]
    drawn = [draw_quantities(worlds) for _ in range(rounds)]
    hits = [[own.low <= true <= own.high for own, true in zip(each, truth, strict=True)] for each in drawn]
    mean, ratio, improvement = np.mean(hits, axis=0)
    assert (0.92 if worlds == 5 else 0.93) <= improvement <= 0.97  # shares of 35 runs are coarse
    assert 0.93 <= min(mean, ratio) <= max(mean, ratio) <= 0.97


@pytest.mark.parametrize(
    ("scores", "tasks", "worlds", "key"),
    [
        ({"A": np.ones((1, 2))}, ["step"], [1, 1], "worlds"),
        ({"A": np.ones((2, 1))}, ["step", "step"], [1], "tasks"),
        ({}, ["step"], [1], "methods"),
        ({"A": np.ones((2, 1))}, ["step"], [1, 2], "scores"),
        ({"A": -np.ones((1, 2))}, ["step"], [1, 2], "scores"),
    ],
)
def test_a_mistake_names_its_argument(scores, tasks, worlds, key):
    with pytest.raises(BadInput, match=f"^{key}="):
        Comparison(scores, tasks, worlds)
