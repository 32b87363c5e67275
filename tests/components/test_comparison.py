"""Methods compared over tasks and worlds: what naive statistics get wrong, and laws of all results."""

import time

import numpy as np
import pytest

from cmacexp.errors import BadInput
from cmacexp.report.figures import draw
from cmacexp.study import Comparison, compare
from cmacexp.study.comparison import (
    estimate_ratios,
    find_order,
    interval_panel,
    profile_panel,
    relative_to,
    split_tasks,
)
from cmacexp.study.interval import estimate

TASKS, WORLDS = [f"task {number}" for number in range(8)], range(20)
RUNS = len(TASKS) * len(WORLDS)


def made(levels, spread=0.05, by_world=0.0, tasks=TASKS, seed=1):
    """Scores about a level for each method; worlds are hard or easy for all methods and tasks alike."""
    rng = np.random.default_rng(seed)
    world = by_world * rng.standard_normal(len(WORLDS))
    shape = (len(tasks), len(WORLDS))
    return {name: level * np.exp(spread * rng.standard_normal(shape) + world) for name, level in levels.items()}


def comparison(levels, **how):
    return Comparison(made(levels, **how), how.get("tasks", TASKS), WORLDS)


def with_failures(scores, where):
    return {**scores, "A": np.where(where, np.inf, scores["A"])}


def headlines(found, method="A", other="B"):
    """Every number that is reported of a method."""
    at_one = found.profile(method, [1.0])
    return {
        "mean": found.mean(method).value,
        "failures": found.failures(method).value,
        "profile at 1": float(at_one[0][0]),
        "probability of improvement": found.probability_of_improvement(method, other).value,
        "ratio": found.ratio(method, other).value,
    }


def test_failures_enter_no_mean_and_decide_the_order_first():
    """A method that leaves out its worst quarter by failing has the smaller mean, and is not the better one."""
    scores = made({"A": 0.4, "B": 0.41}, spread=0.3)
    worst = scores["A"] >= np.sort(scores["A"].ravel())[-RUNS // 4]
    whole, failing = (Comparison(each, TASKS, WORLDS) for each in (scores, with_failures(scores, worst)))
    assert failing.mean("A").value == pytest.approx(scores["A"][~worst].mean())
    assert failing.mean("A").value < 0.9 * whole.mean("A").value
    assert (failing.mean("A").count, failing.failures("A").value) == (RUNS - RUNS // 4, 0.25)
    both = scores["A"][~worst].sum() / scores["B"][~worst].sum()
    assert failing.ratio("A", "B").value == pytest.approx(both)
    assert failing.ratio("A", "B").high < 1.0
    assert failing.beats("B", "A")
    assert not failing.beats("A", "B")
    order = failing.order()
    assert order.methods == ("B", "A")
    assert order.sentence == "Clearly better than all that follow: B, then A. A failed in 40 of 160 runs."


def test_failures_that_are_too_few_to_tell_leave_the_decision_to_the_errors():
    scores = made({"A": 0.2, "B": 0.9})
    order = Comparison(with_failures(scores, np.arange(RUNS).reshape(8, 20) == 3), TASKS, WORLDS).order()
    assert order.methods == ("A", "B")
    assert "A failed in 1 of 160 runs." in order.sentence


def test_a_quarter_of_failures_anywhere_shows_in_what_counts_them_and_in_no_mean():
    scores = made({"A": 0.4, "B": 0.5})
    anywhere = np.random.default_rng(2).permutation(RUNS).reshape(len(TASKS), len(WORLDS)) < RUNS // 4
    before = headlines(Comparison(scores, TASKS, WORLDS))
    after = headlines(Comparison(with_failures(scores, anywhere), TASKS, WORLDS))
    worse = {name: after[name] - before[name] for name in before}
    assert worse["failures"] == 0.25
    assert worse["profile at 1"] == -0.25
    assert worse["probability of improvement"] < -0.2
    assert abs(worse["mean"]) < 0.01
    assert abs(worse["ratio"]) < 0.02


def test_a_method_that_always_fails_has_no_mean_and_is_last():
    scores = made({"A": 0.4, "B": 0.5})
    allfailed = Comparison(with_failures(scores, True), TASKS, WORLDS)
    assert np.isnan(allfailed.mean("A").value)
    assert np.isnan(allfailed.ratio("A", "B").value)
    assert (allfailed.mean("A").count, allfailed.failures("A").value) == (0, 1.0)
    assert allfailed.order().methods == ("B", "A")


def one_task_decides():
    """A is far better in one task and slightly worse in the others."""
    scores = made({"A": 0.55, "B": 0.53}, spread=0.03)
    scores["A"][0], scores["B"][0] = 0.02, 0.9
    return Comparison(scores, TASKS, WORLDS)


def test_one_task_that_decides_leaves_no_single_rank_and_is_named():
    found = one_task_decides()
    assert found.beats("A", "B")
    rest = found.without(TASKS[0])
    assert rest.beats("B", "A")
    assert rest.tasks == TASKS[1:]
    order = found.order()
    assert order.methods == ()
    assert order.sentence == f"No single place 1: A, but B without {TASKS[0]}."


def test_where_the_metric_decides_a_sentence_says_which():
    last, worst = (comparison(levels) for levels in ({"A": 0.3, "B": 0.4}, {"A": 0.8, "B": 0.6}))
    assert last.order().methods == ("A", "B")
    assert worst.order().methods == ("B", "A")
    both = find_order({"the last cycle": last, "the worst cycle": worst})
    assert both.methods == ()
    assert both.sentence == "No single place 1: A by the last cycle; B by the worst cycle."
    assert find_order({"one": last, "again": last}).methods == ("A", "B")


def test_an_order_goes_as_far_as_it_is_clear():
    levels = {"A": 0.2, "B": 0.5, "C": 0.5, "D": 0.9}
    scores = made(levels)
    scores["C"] = scores["B"]
    order = Comparison(scores, TASKS, WORLDS).order()
    assert order.methods == ("A",)
    assert order.sentence == "Clearly better than all that follow: A. No single place 2: B or C."
    near = comparison({"A": 0.5, "B": 0.5005}, by_world=0.3)
    assert near.leaders(["A", "B"]) == ("A", "B")
    assert near.order().methods == ()


def test_what_is_relative_to_a_failure_is_no_score():
    values, reference = np.array([[1.0, np.inf], [2.0, 3.0]]), np.array([[2.0, np.inf], [4.0, 4.0]])
    with pytest.raises(BadInput, match="split_tasks"):
        relative_to(values, reference)
    for undefined in (0.0, np.nan, -1.0):
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
    assert (found.tasks, found.excluded) == (counted, excluded)
    assert np.isfinite([*headlines(found, "A", "feedback").values()]).all()
    assert (found.scores["feedback"] == 1.0).all()
    assert found.without(TASKS[0]).excluded == excluded
    with pytest.raises(BadInput, match="must be finite and above 0 in every world"):
        compare({"feedback": np.zeros((1, 2))}, "feedback", ["step"], [1, 2])


def everything(found, methods):
    levels = np.geomspace(0.1, 2.0, 7)
    each = {m: (found.mean(m), found.failures(m)) for m in methods}
    profiles = {m: [part.tolist() for part in found.profile(m, levels)] for m in methods}
    pairs = [(found.ratio(a, b), found.probability_of_improvement(a, b)) for a in methods for b in methods]
    return each, profiles, pairs, found.order()


def test_no_bit_depends_on_the_order_of_methods_tasks_and_worlds():
    methods = ["A", "B", "C"]
    scores = made({"A": 0.40, "B": 0.401, "C": 0.5}, spread=0.3, by_world=0.4)
    scores["B"][1, 3] = np.inf
    expected = everything(Comparison(scores, TASKS, WORLDS), methods)
    assert everything(Comparison(scores, TASKS, WORLDS), methods) == expected
    rng = np.random.default_rng(3)
    tasks, worlds = rng.permutation(len(TASKS)), rng.permutation(len(WORLDS))
    shuffled = {name: scores[name][np.ix_(tasks, worlds)] for name in reversed(methods)}
    found = Comparison(shuffled, [TASKS[i] for i in tasks], [WORLDS[i] for i in worlds])
    assert everything(found, methods) == expected


def test_identical_methods_differ_by_exactly_nothing():
    scores = made({"A": 0.5}, spread=0.4, by_world=0.5)
    found = Comparison({"A": scores["A"], "B": scores["A"].copy()}, TASKS, WORLDS)
    ratio, improvement = found.ratio("A", "B"), found.probability_of_improvement("A", "B")
    assert (ratio.low, ratio.value, ratio.high) == (1.0, 1.0, 1.0)
    assert (improvement.low, improvement.value, improvement.high) == (0.5, 0.5, 0.5)
    assert found.order().methods == ()


def test_worlds_are_paired_which_two_intervals_waste():
    found = comparison({"A": 0.40, "B": 0.42}, by_world=0.4)
    one, other = found.mean("A"), found.mean("B")
    assert one.low < other.value < one.high
    assert found.ratio("A", "B").high < 1.0


def test_worlds_are_clusters_which_an_interval_over_runs_denies():
    scores = made({"A": 0.4}, by_world=0.4)
    clustered, runs = Comparison(scores, TASKS, WORLDS).mean("A"), estimate(scores["A"].ravel())
    assert clustered.high - clustered.low > 2.0 * (runs.high - runs.low)


def test_the_interval_of_a_mean_without_failures_is_student_s():
    from scipy.stats import t

    scores = made({"A": 0.4}, by_world=0.4)["A"]
    value, half = estimate_ratios(scores.sum(axis=0), np.full(len(WORLDS), len(TASKS)))
    low, high = t.interval(0.95, len(WORLDS) - 1, scores.mean(), scores.mean(axis=0).std(ddof=1) / len(WORLDS) ** 0.5)
    assert (value - half, value + half) == pytest.approx((low, high))


@pytest.mark.parametrize("worlds", [5, 20])
def test_intervals_contain_the_truth_as_often_as_they_say(worlds):
    """Scores of seven tasks in worlds of different difficulty; in one task every second run fails."""
    rng, rounds, many = np.random.default_rng(5), 2000, 100_000
    levels = np.array([0.03, 0.03, 0.03, 0.04, 0.06, 0.04, 0.05])[:, None]

    def draw(count):
        hard = 0.3 * rng.standard_normal(count)
        a, b = (levels * np.exp(hard + 0.2 * rng.standard_normal((7, count))) for _ in "ab")
        a[4, rng.random(count) < 0.5] = np.inf
        return Comparison({"A": a, "B": 1.1 * b}, [*"abcdefg"], range(count))

    quantities = {
        "mean": lambda found: found.mean("A"),
        "ratio": lambda found: found.ratio("A", "B"),
        "improvement": lambda found: found.probability_of_improvement("A", "B"),
    }
    whole = draw(many)
    truth = {name: quantity(whole).value for name, quantity in quantities.items()}
    hits = dict.fromkeys(quantities, 0)
    for _ in range(rounds):
        found = draw(worlds)
        for name, quantity in quantities.items():
            interval = quantity(found)
            hits[name] += interval.low <= truth[name] <= interval.high
    least = 0.92 if worlds == 5 else 0.93  # shares of 35 runs are coarse
    assert least * rounds <= hits.pop("improvement") <= 0.97 * rounds
    assert all(0.93 * rounds <= count <= 0.97 * rounds for count in hits.values()), hits


def test_one_world_decides_nothing():
    found = Comparison({"A": np.full((2, 1), 0.1), "B": np.full((2, 1), 0.9)}, ["step", "push"], [1])
    assert (found.ratio("A", "B").low, found.ratio("A", "B").high) == (0.0, np.inf)
    assert found.order().methods == ()


def test_no_failure_at_all_still_has_wilson_s_interval():
    found = comparison({"A": 0.4}).failures("A")
    assert (found.value, found.low, found.high, found.count) == (0.0, 0.0, estimate([False] * RUNS).high, RUNS)


def test_the_probability_of_improvement_of_two_methods_is_one_together():
    scores = made({"A": 0.5, "B": 0.5}, spread=0.3)
    scores["B"][:, :10] = scores["A"][:, :10]
    scores["A"][0], scores["B"][0] = np.inf, np.nan
    found = Comparison(scores, TASKS, WORLDS)
    ab, ba = found.probability_of_improvement("A", "B"), found.probability_of_improvement("B", "A")
    assert ab.value + ba.value == pytest.approx(1.0, abs=1e-15)
    assert ab.low + ba.high == pytest.approx(1.0, abs=1e-15)
    wins = scores["A"][1:, 10:] < scores["B"][1:, 10:]
    assert ab.value == pytest.approx((wins.sum() + 0.5 * (RUNS - wins.size)) / RUNS)


def test_a_profile_is_monotone_and_ends_at_one_only_without_failures():
    scores = with_failures(made({"A": 0.5, "B": 0.5}, spread=0.5), np.arange(RUNS).reshape(8, 20) % 10 == 0)
    found = Comparison(scores, TASKS, WORLDS)
    levels = [0.0, *np.geomspace(0.05, 5.0, 50), np.inf]
    for method, end in (("A", 0.9), ("B", 1.0)):
        for part in found.profile(method, levels):
            assert (np.diff(part) >= 0.0).all()
        value, low, high = found.profile(method, levels)
        assert (low <= value).all()
        assert (value <= high).all()
        assert value[-1] == pytest.approx(end)
    assert found.profile("A", [0.5])[0] == np.mean(scores["A"] <= 0.5)


def test_figures_show_every_method_and_no_infinite_bar():
    scores = with_failures(made({"A": 0.5, "B": 0.8, "C": 2.0}), True)
    found = Comparison(scores, TASKS, WORLDS)
    profiles, intervals = profile_panel(found), interval_panel(found)
    assert [series.name for series in profiles.series] == ["A", "B", "C"]
    assert max(profiles.series[0].y) == 0.0
    assert profiles.log == "x"
    assert list(intervals.ticks) == ["A", "B", "C"]
    mean, failures = intervals.series
    assert np.isnan(mean.y).tolist() == [True, False, False]
    assert failures.y[0] == 1.0
    assert mean.low[1] < mean.y[1] < mean.high[1]
    assert len(draw([profiles, intervals]).axes) == 2


@pytest.mark.parametrize(
    ("scores", "tasks", "worlds", "message"),
    [
        ({"A": np.ones((1, 2))}, ["step"], [1, 1], "worlds=1, 1: name some, each once"),
        ({"A": np.ones((2, 1))}, ["step", "step"], [1], "tasks=step, step"),
        ({}, ["step"], [1], "methods="),
        ({"A": np.ones((2, 1))}, ["step"], [1, 2], r"scores=A: must be \(tasks, worlds\), here \(1, 2\)"),
        ({"A": -np.ones((1, 2))}, ["step"], [1, 2], "without negative values"),
    ],
)
def test_a_mistake_is_named(scores, tasks, worlds, message):
    with pytest.raises(BadInput, match=message):
        Comparison(scores, tasks, worlds)


def test_a_method_that_is_misspelt_is_suggested():
    with pytest.raises(BadInput, match="did you mean cmac"):
        comparison({"cmac": 0.5}).mean("cmacc")


def test_all_headline_numbers_of_a_benchmark_take_less_than_two_seconds():
    names = [f"method {number}" for number in range(13)]
    found = comparison({name: 0.3 + 0.02 * place for place, name in enumerate(names)}, tasks=TASKS[:7])
    found.failures(names[0])  # imports scipy
    begin = time.process_time()
    for name in names:
        headlines(found, name, names[0])
    assert found.order().methods[0] == names[0]
    assert time.process_time() - begin < 2.0
