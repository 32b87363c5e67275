"""Claims of a paper and findings of a study: statements that an interval decides, and that can come out otherwise."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from cmacexp.addons.study.interval import (
    EXACT,
    NO_REFERENCE,
    ONE_SEED,
    UNDEFINED,
    UNKNOWN,
    BadSample,
    Interval,
    estimate,
)
from cmacexp.addons.study.results import NoSuchRuns, Results
from cmacexp.addons.study.samples import Sample, relative, require_sample
from cmacexp.errors import BadInput, require
from cmacexp.metrics.registry import format_number
from cmacexp.typing import Array, Mask, Status

REPRODUCED, IN_PART, NOT_REPRODUCED = "reproduced", "reproduced in part", "not reproduced"
CONTRADICTED, INCONCLUSIVE = "contradicted", "inconclusive"
VERDICTS = {
    REPRODUCED: "every interval lies within the limit at which the claim holds",
    IN_PART: "some criteria of the claim are reproduced, others are not",
    NOT_REPRODUCED: "no interval reaches the limit at which the claim holds",
    CONTRADICTED: "every interval lies within the limit at which the opposite holds",
    INCONCLUSIVE: "an interval contains the limit at which the claim holds, a run failed, or there is one seed",
}
"""What each verdict means."""
YES, NO, UNCLEAR = "yes", "no", "unclear"
OUTCOMES = {REPRODUCED: YES, NOT_REPRODUCED: NO, CONTRADICTED: NO, INCONCLUSIVE: UNCLEAR}
"""What the verdict on a criterion means for a finding."""
MEASURED = ("values", "intervals", "counts", "verdicts")
"""What readers see of a statement that was judged, with an entry for each criterion."""
INFINITE = format_number(math.inf)
UNDECIDED = "Undecided, since an interval contains the limit: {}"
WORDS = {YES: YES, NO: NO, UNCLEAR: "undecided"}
"""Outcomes in a generated sentence."""
MOST_SHOWN = 5
"""Values of a quantity that a generated sentence shows; of more it gives the number."""


def _format_range(low: float, high: float, unit: str) -> str:
    """Both ends, and their unit once."""
    return f"{format_number(low)} to {format_number(high, unit)}"


@dataclass(frozen=True)
class Limit:
    """The values from ``low`` to ``high``."""

    low: float = -math.inf
    high: float = math.inf

    def contains(self, interval: Interval) -> bool:
        """Whether the whole interval lies within."""
        return self.low <= interval.low and interval.reach <= self.high

    def touches(self, interval: Interval) -> bool:
        """Whether a part of the interval lies within."""
        return self.low <= interval.reach and interval.low <= self.high

    def describe(self, scale: float, unit: str) -> str:
        """E.g. ``at most 5 %``; nothing of ``ANY``."""
        low, high = scale * self.low, scale * self.high
        if math.isinf(low):
            return "" if math.isinf(high) else f"at most {format_number(high, unit)}"
        return f"at least {format_number(low, unit)}" if math.isinf(high) else _format_range(low, high, unit)


ANY = Limit()
"""The limit of a criterion whose value only stands beside others: it decides nothing."""


def at_most(value: float) -> Limit:
    """Values up to ``value``."""
    return Limit(high=value)


def at_least(value: float) -> Limit:
    """Values from ``value`` on."""
    return Limit(low=value)


def between(low: float, high: float) -> Limit:
    """Values from ``low`` to ``high``."""
    return Limit(low, high)


@dataclass(frozen=True)
class Criterion:
    """A measured quantity and the limits that decide what it says."""

    quantity: str
    """What is measured, as readers see it; criteria that differ only in their case share it."""
    sample: Sample
    """A value for each run, pair or case; truth values for a proportion. What a failed run counts as is said here."""
    holds: Limit
    """Where the statement holds."""
    fails: Limit | None = None
    """Where its opposite holds; None: nowhere, the statement can only not be reproduced."""
    unit: str = ""
    scale: float = 1.0
    """Factor from the sample's unit to ``unit``; limits are in the sample's."""
    of: Mapping[str, Any] = field(default_factory=dict)
    """The settings of the runs that the sample is taken from; all runs if empty."""
    case: str = ""
    """Where it is measured, e.g. the machine."""
    infinite: str = "a run ended early"
    """What an infinite value means."""
    over: Mapping[str, Any] | None = None
    """Settings that differ in the runs which the sample is divided by, each run by that of the same seed."""

    def __post_init__(self) -> None:
        require_sample("quantity", self.sample)

    def take(self, results: Results) -> Sequence[float] | Sequence[bool] | Array | Mask:
        """The sample of selected runs."""
        own = results.select(self.of)
        if self.over is None:
            return self.sample(own)
        return relative(own, results.select({**self.of, **self.over}), self.sample)

    def format_limit(self, limit: Limit) -> str:
        """E.g. ``at most 5 %``."""
        return limit.describe(self.scale, self.unit)

    def __getstate__(self) -> dict[str, Any]:
        """Judged statements travel between processes; a function without a name, as samples often are, cannot."""
        return {**self.__dict__, "sample": None}


@dataclass(frozen=True)
class CriterionResult:
    """A criterion, and what the runs gave."""

    criterion: Criterion
    interval: Interval
    runs: Sequence[str]
    """Folders of the runs behind it."""

    @property
    def verdict(self) -> str:
        """One of ``VERDICTS``, but for ``reproduced in part``."""
        holds, fails = self.criterion.holds, self.criterion.fails
        if holds == ANY:
            return REPRODUCED
        if self.interval.method in (UNDEFINED, NO_REFERENCE, ONE_SEED):
            return INCONCLUSIVE
        if holds.contains(self.interval):
            return REPRODUCED
        if fails is not None and fails.contains(self.interval):
            return CONTRADICTED
        return INCONCLUSIVE if holds.touches(self.interval) else NOT_REPRODUCED

    @property
    def value(self) -> str:
        """The estimate with its unit; of ratios without a reference, why there is none."""
        if self.interval.method == NO_REFERENCE:
            return NO_REFERENCE
        return format_number(self.criterion.scale * self.interval.value, self.criterion.unit)

    @property
    def spread(self) -> str:
        """The ends of the interval with their unit; of a value without one, what it is."""
        if self.interval.method in (EXACT, UNDEFINED, NO_REFERENCE, ONE_SEED):
            return self.interval.method
        scale, unit = self.criterion.scale, self.criterion.unit
        return _format_range(scale * self.interval.low, scale * self.interval.high, unit)


def _measure(criterion: Criterion, results: Results) -> CriterionResult:
    try:
        chosen = results.select(criterion.of)
        others = results.select({**criterion.of, **criterion.over}).rows if criterion.over is not None else ()
        interval = estimate(criterion.take(results), criterion.unit in ("", "%"))
        chosen = Results([*chosen.rows, *others], results.computed)
        if chosen.has_one_seed:
            interval = replace(interval, method=ONE_SEED)
    except (NoSuchRuns, BadSample) as error:
        if isinstance(error, NoSuchRuns) or all(row.run.outcome.status != Status.FAILED for row in chosen.rows):
            raise BadInput("quantity", criterion.quantity, str(error)) from error
        interval = replace(UNKNOWN, count=len(chosen))
    return CriterionResult(criterion, interval, [str(row.run.folder) for row in chosen.rows])


class Statement:
    """A statement of a study, which its criteria decide.

    Raises:
        BadInput: there are none.
    """

    criteria: Sequence[Criterion]
    verdicts: ClassVar[Mapping[str, str]] = dict(zip(VERDICTS, VERDICTS, strict=True))
    """What the verdict on a criterion is called beside it."""

    def __post_init__(self) -> None:
        require(self.criteria, type(self).__name__.lower(), self, "has no criteria: nothing would decide it")

    def judge(self, results: Results) -> "StatementResult":
        """Measure every criterion."""
        own: Any = self  # a claim or a finding
        return StatementResult(own, [_measure(criterion, results) for criterion in self.criteria])


@dataclass(frozen=True)
class Claim(Statement):
    """A claim of a paper, in its words, and the criteria that decide it, at least one."""

    words: str
    where: str
    """Section, figure or equation of the paper."""
    criteria: Sequence[Criterion]

    def decide(self, found: Collection[str]) -> str:
        """One of ``VERDICTS``, from the different ones on criteria that are not beside others."""
        if len(found) == 1:
            return next(iter(found))
        return INCONCLUSIVE if INCONCLUSIVE in found else IN_PART if REPRODUCED in found else NOT_REPRODUCED

    def sentence(self, verdict: str, *_: Sequence[str]) -> str:
        """E.g. ``“it is small” (section 1): reproduced.``"""
        return f"“{self.words}” ({self.where}): {verdict}."


def fill(part: str, text: str, words: Mapping[str, Any]) -> str:
    """A text of a ``part`` of a study with its names in braces replaced; raises BadInput for one that is no word."""
    try:
        return text.format(**words)
    except (LookupError, ValueError, AttributeError, TypeError) as error:
        names = ", ".join(
            f"{name}[0] to {name}[{len(each) - 1}]" if isinstance(each, list) else name
            for name, each in words.items()
            if name.isidentifier()
        )
        raise BadInput(part, text, f"may have {names or 'no name'} in braces, or {{{{ and }}}}") from error


@dataclass(frozen=True)
class Finding(Statement):
    """A statement of the study itself, and the criteria that decide it, at least one.

    In sentences of its own ``{value}`` stands for the first criterion's estimate, ``{values[1]}`` for the second's.

    Raises:
        BadInput: there are no criteria, none has a limit and sentences are generated, or a sentence has a name in
            braces that is none of the values.
    """

    criteria: Sequence[Criterion]
    yes: str = ""
    """Its sentence if every interval lies within its limit; if empty, sentences are generated."""
    no: str = ""
    """Its sentence if some interval lies outside."""
    unclear: str = ""
    """Its sentence otherwise; if empty, it says that ``yes`` is undecided."""
    says: str = ""
    """What a generated sentence says ``yes`` or ``no`` to; if empty, the quantity."""
    verdicts = OUTCOMES

    def __post_init__(self) -> None:
        super().__post_init__()
        decides = self.yes or any(each.holds != ANY for each in self.criteria)
        require(decides, "finding", self.says, "has no criterion with a limit: nothing would decide it")
        for wording in (self.yes, self.no, self.unclear):  # also those of outcomes that rarely occur
            fill("finding", wording, {"value": "", "values": [""] * len(self.criteria)})

    def decide(self, found: Collection[str]) -> str:
        """``yes``, ``no`` or ``unclear``, from the different verdicts on criteria that are not beside others."""
        outcomes = {OUTCOMES[verdict] for verdict in found}
        return NO if NO in outcomes else UNCLEAR if UNCLEAR in outcomes else YES

    def sentence(self, verdict: str, values: Sequence[str], spreads: Sequence[str], sizes: Sequence[str]) -> str:
        """E.g. ``error in cycle 5 over cycle 1: 15.5 % [14.9 to 16.2 %], n = 20; limit at most 10 %: no.``

        Value, interval and n are of each criterion; of an infinite value it says why.
        """
        if self.yes:
            wordings = {YES: self.yes, NO: self.no, UNCLEAR: self.unclear or UNDECIDED.format(self.yes)}
            pairs = zip(self.criteria, values, strict=True)
            shown = [f"{v} ({each.infinite})" if v == INFINITE else v for each, v in pairs]
            return fill("finding", wordings[verdict], {"value": shown[0], "values": shown})
        quantities: dict[tuple[str, str], list[str]] = {}
        for each, value, spread, size in zip(self.criteria, values, spreads, sizes, strict=True):
            if each.holds != ANY:
                reason = f" ({each.infinite})" if value == INFINITE else ""
                measured = f"{each.case}{': ' if each.case else ''}{value}{reason} [{spread}], n = {size}"
                quantities.setdefault((each.quantity, each.format_limit(each.holds)), []).append(measured)
        parts = []
        for (quantity, limit), found in quantities.items():
            listed = "; ".join(found) if len(found) <= MOST_SHOWN else f"{len(found)} values"
            named = "" if self.says and len(quantities) == 1 else f"{quantity}: "
            parts.append(f"{named}{listed}; limit {limit}")
        if self.says:
            return f"{self.says}: {WORDS[verdict]} ({'. '.join(parts)})."
        return f"{'. '.join(parts)}: {WORDS[verdict]}."


@dataclass(frozen=True)
class StatementResult:
    """A statement, and what the runs say of it."""

    statement: Claim | Finding
    measured: Sequence[CriterionResult]

    @property
    def verdict(self) -> str:
        """Verdict of a claim, one of ``VERDICTS``, or of a finding: ``yes``, ``no`` or ``unclear``."""
        return self.statement.decide({each.verdict for each in self.measured if each.criterion.holds != ANY})

    @property
    def columns(self) -> dict[str, Sequence[str]]:
        """Value, interval, n and verdict of each criterion, as readers see them: by the names ``MEASURED``."""
        return {
            "values": [each.value for each in self.measured],
            "intervals": [each.spread for each in self.measured],
            "counts": [each.interval.size for each in self.measured],
            "verdicts": [self.statement.verdicts[each.verdict] for each in self.measured],
        }

    @property
    def sentence(self) -> str:
        """It and its verdict as a sentence."""
        return self.statement.sentence(self.verdict, *list(self.columns.values())[:-1])
