"""Comparison of methods over tasks and worlds: scores of completed runs, shares of failures, and a partial order.

A world is a set of randomised conditions, one per seed. A score is a value divided by that of a reference, e.g.
feedback only, in the same task and world; smaller is better. A failed run has an infinite score: it enters no mean,
but is counted. Two methods are compared over the runs that both complete, since a run in which one of them fails is
usually hard for the other, too. The tasks are fixed and the worlds are a sample: an interval is Student's t over
worlds, with the jackknife standard error (Efron & Stein 1981), which counts all tasks of a world as one observation.
A bootstrap of 20 worlds would cover 92 % instead of 95 %, of five worlds 82 %. No method may have been tuned in these
worlds (Eimer et al. 2023).

Sources: Dolan & Moré 2002 for profiles; Agarwal et al. 2021 for the probability of improvement; Patterson et al. 2024
on comparing several methods.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np

from cmacexp.addons.study.interval import CONFIDENCE, UNKNOWN, Interval, estimate
from cmacexp.errors import require, require_name
from cmacexp.report.figures import Panel, Series, over_setting
from cmacexp.typing import Array, Mask

REFERENCE = 1.0
"""Score of the reference method."""
JACKKNIFE = "t over worlds"
"""Method of the intervals."""


def _defined(reference: Array) -> Mask:
    return np.isfinite(reference) & (reference > 0)


def relative_to(values: Array, reference: Array) -> Array:
    """Divide values by those of the reference in the same task and world; infinite where the method failed.

    Raises:
        BadInput: a value of the reference is not finite or not above 0.
    """
    require(
        _defined(reference).all(),
        "reference",
        "undefined in some worlds",
        "leave out the tasks that split_tasks excludes",
    )
    return np.where(np.isfinite(values), values, np.inf) / reference


def split_tasks(reference: Array, tasks: Sequence[str], worlds: Sequence[Any]) -> tuple[list[str], dict[str, str]]:
    """Return the tasks whose reference is defined in every world, and the reason of exclusion of each other task.

    ``reference`` has the shape (tasks, worlds); it is defined where it is finite and above 0.
    """
    excluded = {}
    for task, values in zip(tasks, reference, strict=True):
        wrong = [f"{v:g} in {world}" for v, world, ok in zip(values, worlds, _defined(values), strict=True) if not ok]
        if wrong:
            excluded[task] = f"the reference must be finite and above 0 in every world, is {', '.join(wrong)}"
    return [task for task in tasks if task not in excluded], excluded


def estimate_ratios(parts: Array, wholes: Array) -> tuple[Array, Array]:
    """Compute ratios of sums over worlds, (...,), and the half-widths of their 95 % jackknife intervals.

    Args:
        parts: numerators, (..., worlds).
        wholes: denominators, (..., worlds), not negative; a world with a denominator of 0 does not count.
    """
    from scipy.special import stdtrit

    count = np.count_nonzero(wholes, axis=-1)
    with np.errstate(all="ignore"):
        value = parts.sum(axis=-1) / wholes.sum(axis=-1)
        without = (parts.sum(axis=-1, keepdims=True) - parts) / (wholes.sum(axis=-1, keepdims=True) - wholes)
        away = np.where(wholes > 0, without - value[..., None], 0.0)
        # Ratios that differ only by rounding must not widen the interval.
        away = np.where(np.abs(away) <= 1e-12 * np.abs(value[..., None]), 0.0, away)
        spread = np.sqrt((count - 1) / count * ((away**2).sum(axis=-1) - away.sum(axis=-1) ** 2 / count))
        half = stdtrit(count - 1.0, 0.5 + CONFIDENCE / 2.0) * spread
    return value, np.where(count > 1, half, np.inf)


def _bounded(parts: Array, wholes: Array, low: float = -math.inf, high: float = math.inf) -> Interval:
    """Estimate the ratio of two sums over worlds; the interval is clipped to ``low`` and ``high``."""
    value, half = (float(array) for array in estimate_ratios(parts, wholes))
    if math.isnan(value):
        return UNKNOWN
    return Interval(value, max(low, value - half), min(high, value + half), int(wholes.sum()), JACKKNIFE)


def _positive(parts: Array, wholes: Array, count: int) -> Interval:
    """Estimate the ratio of two sums of positive values, such as scores, with a t interval of its logarithm."""
    value, half = (float(array) for array in estimate_ratios(parts, wholes))
    if math.isnan(value) or value <= 0.0:
        return replace(UNKNOWN, count=count) if math.isnan(value) else Interval(value, 0.0, 0.0, count, JACKKNIFE)
    factor = math.exp(half / value) if half < 700.0 * value else math.inf
    return Interval(value, value / factor, value * factor, count, JACKKNIFE)


@dataclass(frozen=True)
class Order:
    """The ranking of methods on which all metrics agree, with all tasks and with any one task left out."""

    methods: tuple[str, ...]
    """Methods from the best on, up to the first disputed rank."""
    sentence: str
    """Summary: the clear ranking, the tasks or metrics that dispute the next rank, failures of the named methods."""


@dataclass(frozen=True)
class Comparison:
    """Scores of methods. Tasks and worlds are sorted by name, so that no result depends on their original order.

    Raises:
        BadInput: names are missing or repeated, an array is not (tasks, worlds), or a score is negative.
    """

    scores: Mapping[str, Array]
    """Scores (tasks, worlds) by method; infinity and NaN are failures."""
    tasks: Sequence[str]
    worlds: Sequence[Any]
    excluded: Mapping[str, str] = field(default_factory=dict)
    """Reason of exclusion by excluded task."""

    def __post_init__(self) -> None:
        for name, values in (("tasks", self.tasks), ("worlds", self.worlds), ("methods", self.scores)):
            labels = list(map(str, values))
            is_unique = 0 < len(labels) == len(set(labels))
            require(is_unique, name, ", ".join(labels), f"name some, each once; excluded: {self.excluded}")
        shape = (len(self.tasks), len(self.worlds))
        scores = {}
        tasks, worlds = (np.argsort([str(name) for name in names]) for names in (self.tasks, self.worlds))
        for method, array in self.scores.items():
            fits = np.shape(array) == shape and not np.any(np.asarray(array) < 0)
            require(fits, "scores", method, f"must be (tasks, worlds), here {shape}, without negative values")
            scores[method] = np.where(np.isnan(array), np.inf, array)[np.ix_(tasks, worlds)]
        object.__setattr__(self, "scores", scores)
        object.__setattr__(self, "tasks", [self.tasks[i] for i in tasks])
        object.__setattr__(self, "worlds", [self.worlds[i] for i in worlds])

    def _of(self, method: str) -> Array:
        require_name("method", method, self.scores)
        return self.scores[method]

    def completed(self, method: str) -> Mask:
        """Return a mask (tasks, worlds) of the runs that did not fail."""
        return np.asarray(np.isfinite(self._of(method)))

    def mean(self, method: str) -> Interval:
        """Estimate the mean score of the completed runs; undefined if none completed."""
        done = self.completed(method)
        return _positive(np.where(done, self._of(method), 0.0).sum(axis=0), done.sum(axis=0), int(done.sum()))

    def failures(self, method: str) -> Interval:
        """Estimate the share of failed runs: Wilson's interval, widened if the interval over worlds is wider.

        It is wider if failures are concentrated in few worlds.
        """
        failed = ~self.completed(method)
        runs = estimate(failed.ravel())
        by_world = _bounded(failed.sum(axis=0), self._runs, 0.0, 1.0)
        return replace(runs, low=min(runs.low, by_world.low), high=max(runs.high, by_world.high))

    @property
    def _runs(self) -> Array:
        """Number of runs of a method in each world, (worlds,)."""
        return np.full(len(self.worlds), len(self.tasks))

    def sums(self, a: str, b: str) -> Array:
        """Sum the scores of ``a`` and of ``b`` over the tasks that both complete in a world, (2, worlds)."""
        both = self.completed(a) & self.completed(b)
        return np.stack([np.where(both, self._of(name), 0.0).sum(axis=0) for name in (a, b)])

    def ratio(self, a: str, b: str) -> Interval:
        """Estimate the mean score of ``a`` over that of ``b`` in the runs that both complete.

        It is below 1 if ``a`` is better.
        """
        numerators, denominators = self.sums(a, b)
        return _positive(numerators, denominators, int((self.completed(a) & self.completed(b)).sum()))

    def probability_of_improvement(self, a: str, b: str) -> Interval:
        """Estimate the share of tasks and worlds in which ``a`` has a smaller score than ``b``; a tie counts half."""
        first, second = self._of(a), self._of(b)
        return _bounded(((first < second) + 0.5 * (first == second)).sum(axis=0), self._runs, 0.0, 1.0)

    def profile(self, method: str, levels: Sequence[float] | Array) -> tuple[Array, Array, Array]:
        """Compute the share of runs with a score up to each level, and the lower and upper ends of its interval.

        A failed run reaches no level. The three arrays have the shape (levels,); the intervals are pointwise.
        """
        scores = self._of(method)
        reached = (np.isfinite(scores) & (scores <= np.asarray(levels)[:, None, None])).sum(axis=1)
        share, half = estimate_ratios(reached, np.broadcast_to(self._runs, reached.shape))
        return share, np.fmax(share - half, 0.0), np.fmin(share + half, 1.0)

    def beats(self, a: str, b: str) -> bool:
        """Return true if ``a`` clearly fails less often, or if neither does and ``a`` has clearly smaller scores.

        A difference is clear if its 95 % interval excludes zero, a ratio if its interval excludes 1. The scores are
        those of the runs that both methods complete.
        """
        more = (self.completed(b).astype(int) - self.completed(a)).sum(axis=0)
        failing, half = estimate_ratios(more, self._runs)
        if abs(failing) > half:
            return bool(failing < 0.0)
        return self.ratio(a, b).high < 1.0

    def leaders(self, methods: Sequence[str]) -> tuple[str, ...]:
        """List the methods that may be the best, sorted by name: those that no unbeaten method beats."""
        beaten = {name: [other for other in methods if other != name and self.beats(other, name)] for name in methods}
        best = {name for name in methods if not beaten[name]}
        return tuple(sorted(name for name in methods if not best & set(beaten[name])))

    def without(self, task: str) -> "Comparison":
        """Return the comparison without one task."""
        index = self.tasks.index(task)
        scores = {method: np.delete(values, index, axis=0) for method, values in self.scores.items()}
        return replace(self, scores=scores, tasks=[*self.tasks[:index], *self.tasks[index + 1 :]])

    def order(self) -> Order:
        """Rank the methods as far as the ranking is clear with all tasks and with any one task left out."""
        return find_order({"": self})


def compare(values: Mapping[str, Array], reference: str, tasks: Sequence[str], worlds: Sequence[Any]) -> Comparison:
    """Compare methods by their values (tasks, worlds) relative to those of the method ``reference``.

    Tasks in which the reference is undefined in some world are excluded, see :func:`split_tasks`.
    """
    counted, excluded = split_tasks(values[reference], tasks, worlds)
    kept = [task in counted for task in tasks]
    scores = {name: relative_to(array[kept], values[reference][kept]) for name, array in values.items()}
    return Comparison(scores, counted, worlds, excluded)


def find_order(comparisons: Mapping[str, Comparison]) -> Order:
    """Rank the same methods by several metrics, as far as all comparisons agree; see :meth:`Comparison.order`.

    ``comparisons`` holds one comparison per name of a metric; the name may be empty.
    """
    views = {
        metric: {"": whole} | {task: whole.without(task) for task in whole.tasks if len(whole.tasks) > 1}
        for metric, whole in comparisons.items()
    }
    left = sorted(next(iter(comparisons.values())).scores)
    agreed: list[str] = []
    text: list[str] = []
    while left:
        leaders = {
            metric: {task: comparison.leaders(left) for task, comparison in view.items()}
            for metric, view in views.items()
        }
        candidates = {methods for by_task in leaders.values() for methods in by_task.values()}
        if len(candidates) > 1 or len(min(candidates)) > 1:
            text = [f"No single place {len(agreed) + 1}: {_explain(leaders)}."]
            break
        left.remove(min(candidates)[0])
        agreed += min(candidates)
    if agreed:
        text = [f"Clearly better than all that follow: {', then '.join(agreed)}.", *text]
    named = {*agreed, *(name for methods in candidates for name in methods)}
    for whole in comparisons.values():
        failed = {name: int((~whole.completed(name)).sum()) for name in sorted(named)}
        text += [f"{name} failed in {n} of {whole.completed(name).size} runs." for name, n in failed.items() if n]
    return Order(tuple(agreed), " ".join(dict.fromkeys(text)))


def _explain(leaders: Mapping[str, Mapping[str, tuple[str, ...]]]) -> str:
    """Describe which methods lead by which metrics, and which lead instead if a task is left out.

    ``leaders`` holds, by metric and by the task left out (empty: none), the methods that may have the rank.
    """
    titles: dict[str, list[str]] = {}
    for metric, by_task in leaders.items():
        best = {task: " or ".join(methods) for task, methods in by_task.items()}
        deviating = {
            name: [task for task in best if best[task] == name] for name in best.values() if name != best[""]
        }
        changed = "".join(f", but {name} without {' or '.join(tasks)}" for name, tasks in deviating.items())
        titles.setdefault(best[""] + "{}" + changed, []).append(metric)
    return "; ".join(
        text.format(f" by {' and '.join(metrics)}" if metrics[0] else "") for text, metrics in titles.items()
    )


def profile_panel(comparison: Comparison, title: str = "runs that score at most so much") -> Panel:
    """Make a panel of the performance profile of each method with its band, over a logarithmic score axis.

    A dotted line marks the score of the reference.
    """
    finite = np.array([score for scores in comparison.scores.values() for score in scores.flat if 0 < score < np.inf])
    levels = np.geomspace(finite.min(initial=REFERENCE), finite.max(initial=REFERENCE), 100)
    series = [Series(name, levels, *comparison.profile(name, levels)) for name in comparison.scores]
    return Panel(title, "score", "share of runs", series, log="x", x_limits=(REFERENCE,), y_range=(0.0, 1.0))


def interval_panel(comparison: Comparison, title: str = "scores and failures") -> Panel:
    """Make a panel of bars, per method: mean score of completed runs and share of failures, with intervals."""
    groups = {
        name: {method: np.array(astuple(compute(method))[:3]) for method in comparison.scores}
        for name, compute in {"mean score": comparison.mean, "failures": comparison.failures}.items()
    }
    return over_setting(groups, "", "score, share", lambda bounds: tuple(bounds), kind="bars", title=title)
