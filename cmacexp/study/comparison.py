"""Methods compared over tasks and worlds: aggregates with intervals, and an order only where all of them agree.

A score is a value over that of a reference, e.g. feedback alone, in the same task and world; the smaller the better.
A run that failed scores infinity: it ranks last. Capped scores end at 1: a failure then counts as the reference, and
is counted separately. The tasks are given, the worlds a sample: intervals resample worlds, the same ones for all
methods and tasks, since all meet the same worlds. No method may have been tuned in these (Eimer et al. 2023).

Sources: Agarwal et al. 2021 for the interquartile mean over all runs, profiles (first: Dolan & Moré 2002) and the
probability of improvement; Patterson et al. 2024 on comparing several methods.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, suggest
from cmacexp.report import curves
from cmacexp.report.figures import Panel, Series
from cmacexp.study.interval import Interval, bootstrap, compute_centre, estimate, find_ends, resample
from cmacexp.typing import Array, Mask

CAP = 1.0  # the score of the reference


def _defined(reference: Array) -> Mask:
    return np.isfinite(reference) & (reference > 0)


def relative_to(values: Array, reference: Array) -> Array:
    """Values over those of the reference in the same task and world; infinite where not finite: the method failed.

    Raises:
        BadInput: a value of the reference is not finite or not above 0: nothing is relative to it.
    """
    if not _defined(reference).all():
        raise BadInput("reference", "undefined in some worlds", "leave out the tasks that split_tasks excludes")
    return np.where(np.isfinite(values), values, np.inf) / reference


def cap(scores: Array) -> Array:
    """Scores of at most 1, which a failure counts as."""
    return np.fmin(scores, CAP)


def split_tasks(reference: Array, tasks: Sequence[str], worlds: Sequence[Any]) -> tuple[list[str], dict[str, str]]:
    """Tasks that count, as the reference, (tasks, worlds), is defined in every world; and why the others do not."""
    excluded = {}
    for task, values in zip(tasks, reference, strict=True):
        wrong = [f"{v:g} in {world}" for v, world, ok in zip(values, worlds, _defined(values), strict=True) if not ok]
        if wrong:
            excluded[task] = f"the reference must be finite and above 0 in every world, is {', '.join(wrong)}"
    return [task for task in tasks if task not in excluded], excluded


def _mean(values: Array) -> Array:
    return values.mean(axis=(-2, -1))


STATISTICS: dict[str, Callable[[Array], Array]] = {
    "interquartile mean": lambda scores: compute_centre(scores.reshape(*scores.shape[:-2], -1)),
    "capped mean": lambda scores: _mean(cap(scores)),
}
"""Of scores (..., tasks, worlds). The first leaves out the worst quarter of the runs; the second counts failures."""


@dataclass(frozen=True)
class Order:
    """An order of methods, as far as everything that could decide it agrees."""

    methods: tuple[str, ...]
    """From the best on, up to the first place that is disputed."""
    sentence: str
    """How sure the first place is; which statistic, task or metric disputes a place; failures of those named."""


@dataclass(frozen=True)
class Comparison:
    """Scores of methods. Tasks and worlds are sorted by name, so that no result depends on the order they came in.

    Raises:
        BadInput: names are missing or occur twice, an array is not (tasks, worlds), or a score is negative.
    """

    scores: Mapping[str, Array]
    """(tasks, worlds) of each method; NaN is a failure, too."""
    tasks: Sequence[str]
    worlds: Sequence[Any]
    excluded: Mapping[str, str] = field(default_factory=dict)
    """Tasks that do not count, and why."""

    def __post_init__(self) -> None:
        for name, values in (("tasks", self.tasks), ("worlds", self.worlds), ("methods", self.scores)):
            if not len(values) or len(set(map(str, values))) < len(values):
                raise BadInput(name, ", ".join(map(str, values)), f"name some, each once; excluded: {self.excluded}")
        shape, scores = (len(self.tasks), len(self.worlds)), {}
        tasks, worlds = (np.argsort([str(name) for name in names]) for names in (self.tasks, self.worlds))
        for method, given in self.scores.items():
            if np.shape(given) != shape or np.any(np.asarray(given) < 0):
                raise BadInput("scores", method, f"must be (tasks, worlds), here {shape}, without negative values")
            scores[method] = np.where(np.isnan(given), np.inf, given)[np.ix_(tasks, worlds)]
        object.__setattr__(self, "scores", scores)
        object.__setattr__(self, "tasks", [self.tasks[i] for i in tasks])
        object.__setattr__(self, "worlds", [self.worlds[i] for i in worlds])

    def _of(self, method: str) -> Array:
        if method not in self.scores:
            raise BadInput("method", method, f"choose from {', '.join(self.scores)}{suggest(method, self.scores)}")
        return self.scores[method]

    def interquartile_mean(self, method: str) -> Interval:
        """Mean of the middle half of all runs; infinite if a failure is among these."""
        return bootstrap(self._of(method), STATISTICS["interquartile mean"])

    def capped_mean(self, method: str) -> Interval:
        """Mean of the capped scores of all runs."""
        return bootstrap(self._of(method), STATISTICS["capped mean"])

    def failures(self, method: str) -> Interval:
        """Share of runs that failed: Wilson's interval, widened to that over worlds if failures share worlds."""
        failed = np.isinf(self._of(method))
        runs, by_world = estimate(failed.ravel()), bootstrap(failed.astype(float), _mean)
        return replace(runs, low=min(runs.low, by_world.low), high=max(runs.high, by_world.high))

    def difference(self, a: str, b: str) -> Interval:
        """Capped mean of ``a`` less that of ``b``, in the same worlds: below 0 where ``a`` is better."""
        return bootstrap(cap(self._of(a)) - cap(self._of(b)), _mean)

    def probability_of_improvement(self, a: str, b: str) -> Interval:
        """Share of runs in which ``a`` is better than ``b`` in the same task and world; a tie counts half."""
        mine, other = self._of(a), self._of(b)
        return bootstrap((mine < other) + 0.5 * (mine == other), _mean)

    def profile(self, method: str, levels: Sequence[float] | Array) -> tuple[Array, Array, Array]:
        """Share of runs that score at most each level, never a failure; and the pointwise ends of its interval."""
        scores = self._of(method)
        reached = (np.isfinite(scores) & (scores <= np.asarray(levels)[:, None, None])).mean(axis=1)
        return reached.mean(axis=-1), *find_ends(resample(reached).mean(axis=-1))

    def places(self, statistic: str) -> list[tuple[str, ...]]:
        """Methods by one of ``STATISTICS``, from the best on; equal ones share a place."""
        values = {name: float(STATISTICS[statistic](scores)) for name, scores in self.scores.items()}
        ordered = sorted(values, key=lambda name: (values[name], name))
        return [tuple(equal) for _, equal in groupby(ordered, lambda name: values[name])]

    def first_places(self, statistic: str) -> dict[str, float]:
        """Share of resamples in which each method is first by one of ``STATISTICS``; equal ones share it."""
        resampled = np.stack([STATISTICS[statistic](resample(scores)) for scores in self.scores.values()])
        best = resampled == resampled.min(axis=0)
        return dict(zip(self.scores, (best / best.sum(axis=0)).mean(axis=1).tolist(), strict=True))

    def without(self, task: str) -> "Comparison":
        """The comparison over the other tasks."""
        place = self.tasks.index(task)
        scores = {method: np.delete(values, place, axis=0) for method, values in self.scores.items()}
        return replace(self, scores=scores, tasks=[*self.tasks[:place], *self.tasks[place + 1 :]])

    def order(self) -> Order:
        """The order on which both statistics agree, with all tasks and without any one of them."""
        return find_order({"": self})


def compare(values: Mapping[str, Array], reference: str, tasks: Sequence[str], worlds: Sequence[Any]) -> Comparison:
    """Values (tasks, worlds) of methods relative to those of one, the ``reference``, over the tasks that count."""
    counted, excluded = split_tasks(values[reference], tasks, worlds)
    kept = [task in counted for task in tasks]
    scores = {name: relative_to(given[kept], values[reference][kept]) for name, given in values.items()}
    return Comparison(scores, counted, worlds, excluded)


def find_order(comparisons: Mapping[str, Comparison]) -> Order:
    """As :meth:`Comparison.order`, but comparisons of the same methods by several metrics must agree, too."""
    views: dict[str, dict[str, list[tuple[str, ...]]]] = {}
    for metric, whole in comparisons.items():
        parts = {"": whole} | {task: whole.without(task) for task in whole.tasks if len(whole.tasks) > 1}
        for name in STATISTICS:
            title = f"the {name} of {metric}".removesuffix(" of ")
            views[title] = {task: part.places(name) for task, part in parts.items()}
    at_place = [*zip(*(places for view in views.values() for places in view.values()), strict=False)]
    agreed = [len(set(best)) == 1 == len(best[0]) for best in at_place] + [False]
    count, text = agreed.index(False), []
    methods = tuple(best[0][0] for best in at_place[:count])
    if methods:
        sure = min(each.first_places(name)[methods[0]] for each in comparisons.values() for name in STATISTICS)
        text += [f"All agree on {', '.join(methods)}; {methods[0]} is first in at least {sure:.0%} of resamples."]
    if count < len(at_place):
        text += [f"No single place {count + 1}: {_explain(views, count)}."]
    named = sorted({*methods, *(name for best in at_place[count : count + 1] for equal in best for name in equal)})
    failed = [(name, whole.failures(name)) for whole in comparisons.values() for name in named]
    text += [f"{name} failed in {share.value:.1%} of {share.count} runs." for name, share in failed if share.value]
    return Order(methods, " ".join(dict.fromkeys(text)))


def _explain(views: Mapping[str, Mapping[str, list[tuple[str, ...]]]], place: int) -> str:
    """Who has a place by which statistics, and who has it without which tasks."""
    titles: dict[tuple[str, str], list[str]] = {}
    for title, view in views.items():
        best = {task: " and ".join(places[place]) for task, places in view.items()}
        others = {name: [task for task in best if best[task] == name] for name in best.values() if name != best[""]}
        changed = "".join(f", but {name} without {' or '.join(tasks)}" for name, tasks in others.items())
        titles.setdefault((best[""], changed), []).append(title)
    return "; ".join(f"{best} by {' and '.join(by)}{changed}" for (best, changed), by in titles.items())


def profile_panel(comparison: Comparison, title: str = "runs that score at most so much") -> Panel:
    """The profile of each method with its band, over the logarithm of the score; dotted: the reference."""
    known = np.array([score for scores in comparison.scores.values() for score in scores.flat if 0 < score < np.inf])
    levels = np.geomspace(known.min(initial=CAP), known.max(initial=CAP), 100)
    series = [Series(name, levels, *comparison.profile(name, levels)) for name in comparison.scores]
    return Panel(title, "score", "share of runs", series, log="x", x_limits=(CAP,), y_range=(0.0, 1.0))


def interval_panel(comparison: Comparison, title: str = "scores and failures") -> Panel:
    """Bars of both means and of the share of failures with their intervals, for each method; none where infinite."""
    compute = (comparison.interquartile_mean, comparison.capped_mean, comparison.failures)
    groups = {
        name: {method: np.array(astuple(interval(method))[:3]) for method in comparison.scores}
        for name, interval in zip((*STATISTICS, "failures"), compute, strict=True)
    }
    return curves.over_setting(groups, "", "score, share", lambda found: tuple(found), kind="bars", title=title)
