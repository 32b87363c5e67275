"""Methods compared over tasks and worlds: what naive statistics get wrong, and laws of all results."""

import time

import numpy as np
import pytest

from cmacexp.errors import BadInput
from cmacexp.report.figures import draw
from cmacexp.study import Comparison, compare
from cmacexp.study.comparison import (
    STATISTICS,
    cap,
    find_order,
    interval_panel,
    profile_panel,
    relative_to,
    split_tasks,
)
from cmacexp.study.interval import estimate, find_ends, resample

TASKS, WORLDS = [f"task {number}" for number in range(8)], range(20)
RUNS = len(TASKS) * len(WORLDS)
STATISTIC, CAPPED = STATISTICS


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
        "interquartile mean": found.interquartile_mean(method).value,
        "capped mean": found.capped_mean(method).value,
        "failures": found.failures(method).value,
        "profile at 1": float(at_one[0][0]),
        "probability of improvement": found.probability_of_improvement(method, other).value,
        "difference": found.difference(method, other).value,
    }


def test_an_interquartile_mean_hides_a_quarter_of_failures_and_the_order_says_so():
    scores = made({"A": 0.4, "B": 0.5})
    worst = scores["A"] >= np.sort(scores["A"].ravel())[-RUNS // 4]
    whole, failing = (Comparison(each, TASKS, WORLDS) for each in (scores, with_failures(scores, worst)))
    assert failing.interquartile_mean("A").value == whole.interquartile_mean("A").value
    assert failing.failures("A").value == 0.25
    assert failing.capped_mean("A").value > whole.capped_mean("A").value + 0.1
    assert whole.order().methods == ("A", "B")
    order = failing.order()
    assert order.methods == ()
    assert "A by the interquartile mean" in order.sentence
    assert "B by the capped mean" in order.sentence
    assert "A failed in 25.0% of 160 runs." in order.sentence


def test_failures_of_a_method_that_stays_first_are_in_the_sentence():
    scores = made({"A": 0.2, "B": 0.9})
    order = Comparison(with_failures(scores, np.arange(RUNS).reshape(8, 20) % 20 == 3), TASKS, WORLDS).order()
    assert order.methods == ("A", "B")
    assert "A failed in 5.0% of 160 runs." in order.sentence


def test_a_quarter_of_failures_anywhere_moves_every_headline_number():
    scores = made({"A": 0.4, "B": 0.5})
    anywhere = np.random.default_rng(2).permutation(RUNS).reshape(len(TASKS), len(WORLDS)) < RUNS // 4
    before = headlines(Comparison(scores, TASKS, WORLDS))
    after = headlines(Comparison(with_failures(scores, anywhere), TASKS, WORLDS))
    worse = {name: after[name] - before[name] for name in before}
    assert worse["failures"] == 0.25
    assert worse["profile at 1"] == -0.25
    assert worse["probability of improvement"] < -0.2
    assert worse["capped mean"] > 0.1
    assert worse["difference"] > 0.1
    assert worse["interquartile mean"] > 0.005


def test_an_infinite_mean_is_an_end_of_an_interval_and_never_nan():
    scores = with_failures(made({"A": 0.4, "B": 0.5}), np.arange(RUNS).reshape(8, 20) % 20 < 5)
    found = Comparison(scores, TASKS, WORLDS).interquartile_mean("A")
    assert np.isfinite([found.value, found.low]).all()
    assert found.high == np.inf
    allfailed = Comparison(with_failures(scores, True), TASKS, WORLDS)
    assert allfailed.interquartile_mean("A").low == np.inf
    assert not np.isnan([*headlines(allfailed).values()]).any()


def one_task_decides():
    """A is far better in one task and slightly worse in the others."""
    scores = made({"A": 0.55, "B": 0.53}, spread=0.03)
    scores["A"][0], scores["B"][0] = 0.02, 0.9
    return Comparison(scores, TASKS, WORLDS)


def test_one_task_that_decides_leaves_no_single_rank_and_is_named():
    found = one_task_decides()
    assert found.first_places(CAPPED)["A"] == 1.0
    rest = found.without(TASKS[0])
    assert rest.first_places(CAPPED)["B"] > 0.9
    assert rest.tasks == TASKS[1:]
    order = found.order()
    assert order.methods == ()
    assert f"but B without {TASKS[0]}" in order.sentence
    assert not [task for task in TASKS[1:] if f"without {task}" in order.sentence]


def test_where_the_metric_decides_a_sentence_says_which():
    last, worst = (comparison(levels) for levels in ({"A": 0.3, "B": 0.4}, {"A": 0.8, "B": 0.6}))
    assert last.order().methods == ("A", "B")
    assert worst.order().methods == ("B", "A")
    both = find_order({"the last cycle": last, "the worst cycle": worst})
    assert both.methods == ()
    assert both.sentence == (
        "No single place 1: "
        "A by the interquartile mean of the last cycle and the capped mean of the last cycle; "
        "B by the interquartile mean of the worst cycle and the capped mean of the worst cycle."
    )
    assert find_order({"one": last, "again": last}).methods == ("A", "B")


def test_an_order_goes_as_far_as_all_agree_and_says_how_sure_it_is():
    levels = {"A": 0.2, "B": 0.5, "C": 0.5, "D": 0.9}
    scores = made(levels)
    scores["C"] = scores["B"]
    order = Comparison(scores, TASKS, WORLDS).order()
    assert order.methods == ("A",)
    assert "All agree on A; A is first in at least 100% of resamples." in order.sentence
    assert "No single place 2: B and C by the interquartile mean and the capped mean." in order.sentence
    near = comparison({"A": 0.5, "B": 0.5005}, by_world=0.3)
    shares = near.first_places(STATISTIC)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["A"] < 0.999


def test_what_is_relative_to_a_failure_is_no_score():
    values, reference = np.array([[1.0, np.inf], [2.0, 3.0]]), np.array([[2.0, np.inf], [4.0, 4.0]])
    with pytest.raises(BadInput, match="split_tasks"):
        relative_to(values, reference)
    for undefined in (0.0, np.nan, -1.0):
        with pytest.raises(BadInput):
            relative_to(np.ones(2), np.array([1.0, undefined]))
    assert relative_to(np.array([1.0, np.nan, np.inf]), np.full(3, 2.0)).tolist() == [0.5, np.inf, np.inf]
    assert cap(np.array([0.5, 2.0, np.inf, np.nan])).tolist() == [0.5, 1.0, 1.0, 1.0]


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
    each = {m: (found.interquartile_mean(m), found.capped_mean(m), found.failures(m)) for m in methods}
    profiles = {m: [part.tolist() for part in found.profile(m, levels)] for m in methods}
    pairs = [(found.difference(a, b), found.probability_of_improvement(a, b)) for a in methods for b in methods]
    first = [[found.first_places(name)[m] for m in methods] for name in STATISTICS]
    return each, profiles, pairs, first, found.order()


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
    difference = found.difference("A", "B")
    assert (difference.low, difference.value, difference.high) == (0.0, 0.0, 0.0)
    improvement = found.probability_of_improvement("A", "B")
    assert (improvement.low, improvement.value, improvement.high) == (0.5, 0.5, 0.5)
    assert found.first_places(STATISTIC) == {"A": 0.5, "B": 0.5}
    assert found.order().methods == ()


def test_worlds_are_paired_which_an_unpaired_bootstrap_wastes():
    scores = made({"A": 0.40, "B": 0.42}, by_world=0.4)
    paired = Comparison(scores, TASKS, WORLDS).difference("A", "B")
    other = scores["B"][:, np.random.default_rng(4).permutation(len(WORLDS))]
    a, b = (resample(cap(each)).mean(axis=(1, 2)) for each in (scores["A"], other))
    low, high = find_ends(a - b)
    assert high - low > 4.0 * (paired.high - paired.low)
    assert low < 0.0 < high
    assert paired.high < 0.0


def test_worlds_are_clusters_which_a_bootstrap_of_runs_denies():
    scores = made({"A": 0.4}, by_world=0.4)
    clustered, runs = Comparison(scores, TASKS, WORLDS).interquartile_mean("A"), estimate(scores["A"].ravel())
    assert clustered.value == runs.value
    assert clustered.high - clustered.low > 2.0 * (runs.high - runs.low)


def test_intervals_contain_the_truth_as_often_as_they_say():
    hits = {"mean": 0, "failures": 0}
    rng, rounds, truth = np.random.default_rng(5), 200, 0.2
    for _ in range(rounds):
        world = rng.random(len(WORLDS))
        failed = np.broadcast_to(world < truth, (len(TASKS), len(WORLDS)))
        found = Comparison({"A": np.where(failed, np.inf, world)}, TASKS, WORLDS)
        failures, mean = found.failures("A"), found.capped_mean("A")
        hits["failures"] += failures.low <= truth <= failures.high
        expected = truth + (1.0 - truth**2) / 2.0
        hits["mean"] += mean.low <= expected <= mean.high
    assert min(hits.values()) > 0.87 * rounds


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
    middle, capped, failures = intervals.series
    assert np.isnan(middle.y).tolist() == [True, False, False]
    assert (capped.y[0], failures.y[0]) == (1.0, 1.0)
    assert middle.low[1] < middle.y[1] < middle.high[1]
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
        comparison({"cmac": 0.5}).capped_mean("cmacc")


def test_all_headline_numbers_of_a_benchmark_take_less_than_two_seconds():
    names = [f"method {number}" for number in range(13)]
    found = comparison({name: 0.3 + 0.02 * place for place, name in enumerate(names)}, tasks=TASKS[:7])
    found.failures(names[0])  # imports scipy
    begin = time.process_time()
    for name in names:
        headlines(found, name, names[0])
    for statistic in STATISTICS:
        found.first_places(statistic)
    assert found.order().methods[0] == names[0]
    assert time.process_time() - begin < 2.0
