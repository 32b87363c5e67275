"""Methods compared over tasks and worlds: scores of completed runs, failures apart, and an order of what is clear.

A score is a value over that of a reference, e.g. feedback only, in the same task and world; the smaller the better.
A run that failed scores infinity: it enters no mean, and is counted. Two methods are compared over the runs that both
complete, since what one of them fails in is as a rule hard. The tasks are given, the worlds a sample: an interval is
Student's t over worlds, with the standard error of the jackknife (Efron & Stein 1981), which counts all tasks of a
world as one. A bootstrap of 20 worlds would cover 92 % instead of 95 %, one of five 82 %. No method may have been
tuned in these worlds (Eimer et al. 2023).

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
"""The score of the reference."""
JACKKNIFE = "t over worlds"


def _defined(reference: Array) -> Mask:
    return np.isfinite(reference) & (reference > 0)


def relative_to(values: Array, reference: Array) -> Array:
    """Values over those of the reference in the same task and world; infinite where not finite: the method failed.

    Raises:
        BadInput: a value of the reference is not finite or not above 0: nothing is relative to it.
    """
    require(
        _defined(reference).all(),
        "reference",
        "undefined in some worlds",
        "leave out the tasks that split_tasks excludes",
    )
    return np.where(np.isfinite(values), values, np.inf) / reference


def split_tasks(reference: Array, tasks: Sequence[str], worlds: Sequence[Any]) -> tuple[list[str], dict[str, str]]:
    """Tasks that count, as the reference, (tasks, worlds), is defined in every world; and why the others do not."""
    excluded = {}
    for task, values in zip(tasks, reference, strict=True):
        wrong = [f"{v:g} in {world}" for v, world, ok in zip(values, worlds, _defined(values), strict=True) if not ok]
        if wrong:
            excluded[task] = f"the reference must be finite and above 0 in every world, is {', '.join(wrong)}"
    return [task for task in tasks if task not in excluded], excluded


def estimate_ratios(parts: Array, wholes: Array) -> tuple[Array, Array]:
    """Ratios of sums over worlds, (...,), and half the widths of their intervals.

    Args:
        parts: (..., worlds).
        wholes: likewise, not negative; a world where it is 0 does not count.
    """
    from scipy.special import stdtrit

    count = np.count_nonzero(wholes, axis=-1)
    with np.errstate(all="ignore"):
        value = parts.sum(axis=-1) / wholes.sum(axis=-1)
        without = (parts.sum(axis=-1, keepdims=True) - parts) / (wholes.sum(axis=-1, keepdims=True) - wholes)
        away = np.where(wholes > 0, without - value[..., None], 0.0)
        # Shares that differ only by rounding are the same.
        away = np.where(np.abs(away) <= 1e-12 * np.abs(value[..., None]), 0.0, away)
        spread = np.sqrt((count - 1) / count * ((away**2).sum(axis=-1) - away.sum(axis=-1) ** 2 / count))
        half = stdtrit(count - 1.0, 0.5 + CONFIDENCE / 2.0) * spread
    return value, np.where(count > 1, half, np.inf)


def _bounded(parts: Array, wholes: Array, low: float = -math.inf, high: float = math.inf) -> Interval:
    """The ratio of two sums over worlds that lies between ``low`` and ``high``."""
    value, half = (float(each) for each in estimate_ratios(parts, wholes))
    if math.isnan(value):
        return UNKNOWN
    return Interval(value, max(low, value - half), min(high, value + half), int(wholes.sum()), JACKKNIFE)


def _positive(parts: Array, wholes: Array, count: int) -> Interval:
    """The ratio of two sums of what is above 0, such as scores: the t interval is that of its logarithm."""
    value, half = (float(each) for each in estimate_ratios(parts, wholes))
    if math.isnan(value) or value <= 0.0:
        return replace(UNKNOWN, count=count) if math.isnan(value) else Interval(value, 0.0, 0.0, count, JACKKNIFE)
    factor = math.exp(half / value) if half < 700.0 * value else math.inf
    return Interval(value, value / factor, value * factor, count, JACKKNIFE)


@dataclass(frozen=True)
class Order:
    """An order of methods, as far as all metrics agree on it, with all tasks and without any one of them."""

    methods: tuple[str, ...]
    """The methods from the best on, up to the first place that is disputed."""
    sentence: str
    """Who is clearly better; which task or metric disputes the next place; failures of those named."""


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
            labels = list(map(str, values))
            is_unique = 0 < len(labels) == len(set(labels))
            require(is_unique, name, ", ".join(labels), f"name some, each once; excluded: {self.excluded}")
        shape, scores = (len(self.tasks), len(self.worlds)), {}
        tasks, worlds = (np.argsort([str(name) for name in names]) for names in (self.tasks, self.worlds))
        for method, given in self.scores.items():
            fits = np.shape(given) == shape and not np.any(np.asarray(given) < 0)
            require(fits, "scores", method, f"must be (tasks, worlds), here {shape}, without negative values")
            scores[method] = np.where(np.isnan(given), np.inf, given)[np.ix_(tasks, worlds)]
        object.__setattr__(self, "scores", scores)
        object.__setattr__(self, "tasks", [self.tasks[i] for i in tasks])
        object.__setattr__(self, "worlds", [self.worlds[i] for i in worlds])

    def _of(self, method: str) -> Array:
        require_name("method", method, self.scores)
        return self.scores[method]

    def completed(self, method: str) -> Mask:
        """(tasks, worlds): the runs that did not fail."""
        return np.asarray(np.isfinite(self._of(method)))

    def mean(self, method: str) -> Interval:
        """Mean score of the runs that completed; undefined if none did."""
        done = self.completed(method)
        return _positive(np.where(done, self._of(method), 0.0).sum(axis=0), done.sum(axis=0), int(done.sum()))

    def failures(self, method: str) -> Interval:
        """Share of runs that failed: Wilson's interval, widened to that over worlds if failures share worlds."""
        failed = ~self.completed(method)
        runs, by_world = estimate(failed.ravel()), _bounded(failed.sum(axis=0), self._runs, 0.0, 1.0)
        return replace(runs, low=min(runs.low, by_world.low), high=max(runs.high, by_world.high))

    @property
    def _runs(self) -> Array:
        return np.full(len(self.worlds), len(self.tasks))

    def sums(self, a: str, b: str) -> Array:
        """(2, worlds): sums of the scores of ``a`` and of ``b`` over the tasks that both complete in a world."""
        both = self.completed(a) & self.completed(b)
        return np.stack([np.where(both, self._of(name), 0.0).sum(axis=0) for name in (a, b)])

    def ratio(self, a: str, b: str) -> Interval:
        """Mean score of ``a`` over that of ``b``, in the runs that both complete: below 1 where ``a`` is better."""
        mine, other = self.sums(a, b)
        return _positive(mine, other, int((self.completed(a) & self.completed(b)).sum()))

    def probability_of_improvement(self, a: str, b: str) -> Interval:
        """Share of runs in which ``a`` is better than ``b`` in the same task and world; a tie counts half."""
        mine, other = self._of(a), self._of(b)
        return _bounded(((mine < other) + 0.5 * (mine == other)).sum(axis=0), self._runs, 0.0, 1.0)

    def profile(self, method: str, levels: Sequence[float] | Array) -> tuple[Array, Array, Array]:
        """Share of runs that score at most each level, never a failure; and the pointwise ends of its interval."""
        scores = self._of(method)
        reached = (np.isfinite(scores) & (scores <= np.asarray(levels)[:, None, None])).sum(axis=1)
        share, half = estimate_ratios(reached, np.broadcast_to(self._runs, reached.shape))
        return share, np.fmax(share - half, 0.0), np.fmin(share + half, 1.0)

    def beats(self, a: str, b: str) -> bool:
        """Whether ``a`` is clearly better: it clearly fails less, or neither does and it clearly has smaller scores.

        The scores are those of the runs that both complete; an interval decides what is clear.
        """
        more = (self.completed(b).astype(int) - self.completed(a)).sum(axis=0)
        failing, half = estimate_ratios(more, self._runs)
        if abs(failing) > half:
            return bool(failing < 0.0)
        return self.ratio(a, b).high < 1.0

    def leaders(self, methods: Sequence[str]) -> tuple[str, ...]:
        """The methods that may be the best: no method that none beats beats them; sorted by name."""
        beaten = {name: [other for other in methods if other != name and self.beats(other, name)] for name in methods}
        best = {name for name in methods if not beaten[name]}
        return tuple(sorted(name for name in methods if not best & set(beaten[name])))

    def without(self, task: str) -> "Comparison":
        """The comparison over the other tasks."""
        place = self.tasks.index(task)
        scores = {method: np.delete(values, place, axis=0) for method, values in self.scores.items()}
        return replace(self, scores=scores, tasks=[*self.tasks[:place], *self.tasks[place + 1 :]])

    def order(self) -> Order:
        """The order with all tasks on which each of them, left out, leaves all agreed."""
        return find_order({"": self})


def compare(values: Mapping[str, Array], reference: str, tasks: Sequence[str], worlds: Sequence[Any]) -> Comparison:
    """Values (tasks, worlds) of methods relative to those of one, the ``reference``, over the tasks that count."""
    counted, excluded = split_tasks(values[reference], tasks, worlds)
    kept = [task in counted for task in tasks]
    scores = {name: relative_to(given[kept], values[reference][kept]) for name, given in values.items()}
    return Comparison(scores, counted, worlds, excluded)


def find_order(comparisons: Mapping[str, Comparison]) -> Order:
    """As :meth:`Comparison.order`, but comparisons of the same methods by several metrics must agree, too."""
    views = {
        metric: {"": whole} | {task: whole.without(task) for task in whole.tasks if len(whole.tasks) > 1}
        for metric, whole in comparisons.items()
    }
    left = sorted(next(iter(comparisons.values())).scores)
    agreed: list[str] = []
    text: list[str] = []
    while left:
        found = {name: {task: part.leaders(left) for task, part in view.items()} for name, view in views.items()}
        places = {place for view in found.values() for place in view.values()}
        if len(places) > 1 or len(min(places)) > 1:
            text = [f"No single place {len(agreed) + 1}: {_explain(found)}."]
            break
        left.remove(min(places)[0])
        agreed += min(places)
    if agreed:
        text = [f"Clearly better than all that follow: {', then '.join(agreed)}.", *text]
    named = {*agreed, *(name for place in places for name in place)}
    for whole in comparisons.values():
        failed = {name: int((~whole.completed(name)).sum()) for name in sorted(named)}
        text += [f"{name} failed in {n} of {whole.completed(name).size} runs." for name, n in failed.items() if n]
    return Order(tuple(agreed), " ".join(dict.fromkeys(text)))


def _explain(found: Mapping[str, Mapping[str, tuple[str, ...]]]) -> str:
    """Who may have a place by which metrics, and who without which tasks."""
    titles: dict[str, list[str]] = {}
    for metric, view in found.items():
        best = {task: " or ".join(place) for task, place in view.items()}
        others = {name: [task for task in best if best[task] == name] for name in best.values() if name != best[""]}
        changed = "".join(f", but {name} without {' or '.join(tasks)}" for name, tasks in others.items())
        titles.setdefault(best[""] + "{}" + changed, []).append(metric)
    return "; ".join(
        text.format(f" by {' and '.join(metrics)}" if metrics[0] else "") for text, metrics in titles.items()
    )


def profile_panel(comparison: Comparison, title: str = "runs that score at most so much") -> Panel:
    """The profile of each method with its band, over the logarithm of the score; dotted: the reference."""
    known = np.array([score for scores in comparison.scores.values() for score in scores.flat if 0 < score < np.inf])
    levels = np.geomspace(known.min(initial=REFERENCE), known.max(initial=REFERENCE), 100)
    series = [Series(name, levels, *comparison.profile(name, levels)) for name in comparison.scores]
    return Panel(title, "score", "share of runs", series, log="x", x_limits=(REFERENCE,), y_range=(0.0, 1.0))


def interval_panel(comparison: Comparison, title: str = "scores and failures") -> Panel:
    """Bars of the mean of completed runs and of the share of failures with their intervals, for each method."""
    groups = {
        name: {method: np.array(astuple(compute(method))[:3]) for method in comparison.scores}
        for name, compute in {"mean score": comparison.mean, "failures": comparison.failures}.items()
    }
    return over_setting(groups, "", "score, share", lambda found: tuple(found), kind="bars", title=title)
