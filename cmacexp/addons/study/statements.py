"""Claims of a paper and findings of a study: statements that intervals confirm, refute or leave undecided."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from cmacexp.addons.study.interval import (
    EXACT,
    NO_REFERENCE,
    ONE_SEED,
    RANGE,
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

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
NOT_REPRODUCED = "not reproduced"
CONTRADICTED = "contradicted"
INCONCLUSIVE = "inconclusive"
VERDICTS = {
    REPRODUCED: "every interval lies within the limit at which the claim holds",
    IN_PART: "some criteria of the claim are reproduced, others are not",
    NOT_REPRODUCED: "no interval reaches the limit at which the claim holds",
    CONTRADICTED: "every interval lies within the limit at which the opposite holds",
    INCONCLUSIVE: "an interval contains the limit at which the claim holds, a run failed, or there is one seed",
}
"""Meaning of each verdict."""
YES, NO, UNCLEAR = "yes", "no", "unclear"
OUTCOMES = {REPRODUCED: YES, NOT_REPRODUCED: NO, CONTRADICTED: NO, INCONCLUSIVE: UNCLEAR}
"""Outcome of a finding by the verdict on a criterion."""
MEASURED = ("values", "intervals", "counts", "verdicts")
"""Columns that readers see of a judged statement, with one entry per criterion."""
INFINITE = format_number(math.inf)
UNDECIDED = "Undecided, since an interval contains the limit: {}"
WORDS = {YES: YES, NO: NO, UNCLEAR: "undecided"}
"""Outcomes in a generated sentence."""
MOST_SHOWN = 5
"""Maximum number of values of a quantity in a generated sentence; of more it gives only the number."""


def _format_range(low: float, high: float, unit: str) -> str:
    """Format both ends of a range, with the unit once."""
    return f"{format_number(low)} to {format_number(high, unit)}"


@dataclass(frozen=True)
class Limit:
    """Range of allowed values from ``low`` to ``high``, both included."""

    low: float = -math.inf
    high: float = math.inf

    def contains(self, interval: Interval) -> bool:
        """Return true if the whole interval lies within the limit."""
        return self.low <= interval.low and interval.reach <= self.high

    def touches(self, interval: Interval) -> bool:
        """Return true if the interval and the limit overlap."""
        return self.low <= interval.reach and interval.low <= self.high

    def describe(self, scale: float, unit: str) -> str:
        """Format the limit times ``scale``, e.g. ``at most 5 %``; an empty text for ``ANY``."""
        low, high = scale * self.low, scale * self.high
        if math.isinf(low):
            return "" if math.isinf(high) else f"at most {format_number(high, unit)}"
        return f"at least {format_number(low, unit)}" if math.isinf(high) else _format_range(low, high, unit)


ANY = Limit()
"""Limit of a criterion that is only shown and decides nothing."""


def at_most(value: float) -> Limit:
    """Make the limit of values up to ``value``."""
    return Limit(high=value)


def at_least(value: float) -> Limit:
    """Make the limit of values from ``value`` on."""
    return Limit(low=value)


def between(low: float, high: float) -> Limit:
    """Make the limit of values from ``low`` to ``high``."""
    return Limit(low, high)


@dataclass(frozen=True)
class Criterion:
    """A measured quantity and the limits that decide about a statement."""

    quantity: str
    """Name of the quantity for readers; criteria that differ only in their case share it."""
    sample: Sample
    """Function that computes one value per run, pair or case; Boolean values for a proportion.

    It also defines the value of a failed run.
    """
    holds: Limit
    """Range in which the statement holds."""
    fails: Limit | None = None
    """Range in which the opposite holds; None: nowhere, the statement cannot be contradicted."""
    unit: str = ""
    scale: float = 1.0
    """Factor from the unit of the sample to ``unit``; limits are in the unit of the sample."""
    of: Mapping[str, Any] = field(default_factory=dict)
    """Settings that select the runs of the sample; all runs if empty."""
    case: str = ""
    """Condition of the measurement, e.g. the machine."""
    infinite: str = "a run ended early"
    """Meaning of an infinite value."""
    over: Mapping[str, Any] | None = None
    """Settings that differ in the reference runs; each run is divided by the reference with the same seed."""

    def __post_init__(self) -> None:
        require_sample("quantity", self.sample)

    def take(self, results: Results) -> Sequence[float] | Sequence[bool] | Array | Mask:
        """Compute the sample of the selected runs, divided by their references if ``over`` names any."""
        runs = results.select(self.of)
        if self.over is None:
            return self.sample(runs)
        return relative(runs, results.select({**self.of, **self.over}), self.sample)

    @property
    def is_signed(self) -> bool:
        """True if a limit at 0 or below shows that the quantity may be negative."""
        limits = (self.holds, self.fails or ANY)
        return any(-math.inf < end <= 0.0 for limit in limits for end in (limit.low, limit.high))

    def format_limit(self, limit: Limit) -> str:
        """Format a limit in the unit of the criterion, e.g. ``at most 5 %``."""
        return limit.describe(self.scale, self.unit)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the sample: criteria are sent between processes, but samples are often lambda functions."""
        return {**self.__dict__, "sample": None}


@dataclass(frozen=True)
class CriterionResult:
    """A criterion and its measured interval."""

    criterion: Criterion
    interval: Interval
    runs: Sequence[str]
    """Folders of the runs in the sample."""

    @property
    def verdict(self) -> str:
        """Verdict on the criterion: one of ``VERDICTS`` except ``reproduced in part``."""
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
        """Estimate with its unit, or the reason why a ratio has no reference."""
        if self.interval.method == NO_REFERENCE:
            return NO_REFERENCE
        return format_number(self.criterion.scale * self.interval.value, self.criterion.unit)

    @property
    def spread(self) -> str:
        """Ends of the interval with their unit, or the reason why there is no interval."""
        if self.interval.method in (EXACT, UNDEFINED, NO_REFERENCE, ONE_SEED):
            return self.interval.method
        scale = self.criterion.scale
        ends = _format_range(scale * self.interval.low, scale * self.interval.high, self.criterion.unit)
        return f"{ends} (min, max)" if self.interval.method == RANGE else ends


def _measure(criterion: Criterion, results: Results) -> CriterionResult:
    try:
        chosen = results.select(criterion.of)
        references = results.select({**criterion.of, **criterion.over}).rows if criterion.over is not None else ()
        interval = estimate(criterion.take(results), chosen.has_picked_conditions, criterion.is_signed)
        chosen = Results([*chosen.rows, *references], results.computed)
        if chosen.has_one_seed:
            interval = replace(interval, method=ONE_SEED)
    except (NoSuchRuns, BadSample) as error:
        if isinstance(error, NoSuchRuns) or all(row.run.outcome.status != Status.FAILED for row in chosen.rows):
            raise BadInput("quantity", criterion.quantity, str(error)) from error
        interval = replace(UNKNOWN, count=len(chosen))
    return CriterionResult(criterion, interval, [str(row.run.folder) for row in chosen.rows])


class Statement:
    """A statement of a study that its criteria decide.

    Raises:
        BadInput: there are no criteria.
    """

    criteria: Sequence[Criterion]
    verdicts: ClassVar[Mapping[str, str]] = dict(zip(VERDICTS, VERDICTS, strict=True))
    """Name for readers of each verdict on a criterion."""

    def __post_init__(self) -> None:
        require(self.criteria, type(self).__name__.lower(), self, "has no criteria: nothing would decide it")

    def judge(self, results: Results) -> "StatementResult":
        """Measure every criterion on the results."""
        statement: Any = self  # a claim or a finding
        return StatementResult(statement, [_measure(criterion, results) for criterion in self.criteria])


@dataclass(frozen=True)
class Claim(Statement):
    """A claim of a paper, in the words of the paper, and the criteria that decide it, at least one."""

    words: str
    where: str
    """Section, figure or equation of the paper."""
    criteria: Sequence[Criterion]

    def decide(self, verdicts: Collection[str]) -> str:
        """Return the verdict, one of ``VERDICTS``, from the distinct verdicts on the criteria with a limit."""
        if len(verdicts) == 1:
            return next(iter(verdicts))
        return INCONCLUSIVE if INCONCLUSIVE in verdicts else IN_PART if REPRODUCED in verdicts else NOT_REPRODUCED

    def sentence(self, verdict: str, *_: Sequence[str]) -> str:
        """Return the claim and its verdict as a sentence, e.g. ``“it is small” (section 1): reproduced``."""
        return f"“{self.words}” ({self.where}): {verdict}."


def fill_names(key: str, text: str, words: Mapping[str, Any]) -> str:
    """Replace the names in braces of a text by the values in ``words``.

    Raises:
        BadInput: a name is not in ``words``, or the braces are malformed; it names ``key``, the source of the text.
    """
    try:
        return text.format(**words)
    except (LookupError, ValueError, AttributeError, TypeError) as error:
        names = ", ".join(
            f"{name}[0] to {name}[{len(word) - 1}]" if isinstance(word, list) else name
            for name, word in words.items()
            if name.isidentifier()
        )
        raise BadInput(key, text, f"may have {names or 'no name'} in braces, or {{{{ and }}}}") from error


@dataclass(frozen=True)
class Finding(Statement):
    """A statement of the study itself and the criteria that decide it, at least one.

    In the sentences below ``{value}`` stands for the estimate of the first criterion, ``{values[1]}`` for that of the
    second.

    Raises:
        BadInput: there are no criteria, none has a limit although sentences are generated, or a sentence contains
            another name in braces.
    """

    criteria: Sequence[Criterion]
    yes: str = ""
    """Sentence if every interval lies within its limit; if empty, all sentences are generated."""
    no: str = ""
    """Sentence if at least one interval lies outside its limit."""
    unclear: str = ""
    """Sentence in all other cases; if empty, it says that ``yes`` is undecided."""
    says: str = ""
    """Statement that a generated sentence answers with ``yes`` or ``no``; if empty, the quantity."""
    verdicts = OUTCOMES

    def __post_init__(self) -> None:
        super().__post_init__()
        decides = self.yes or any(criterion.holds != ANY for criterion in self.criteria)
        require(decides, "finding", self.says, "has no criterion with a limit: nothing would decide it")
        for wording in (self.yes, self.no, self.unclear):  # before any run: some outcomes rarely occur
            fill_names("finding", wording, {"value": "", "values": [""] * len(self.criteria)})

    def decide(self, verdicts: Collection[str]) -> str:
        """Return ``yes``, ``no`` or ``unclear`` from the distinct verdicts on the criteria with a limit."""
        outcomes = {OUTCOMES[verdict] for verdict in verdicts}
        return NO if NO in outcomes else UNCLEAR if UNCLEAR in outcomes else YES

    def sentence(self, verdict: str, values: Sequence[str], spreads: Sequence[str], sizes: Sequence[str]) -> str:
        """Return the finding, its evidence and its outcome as a sentence.

        For example ``error in cycle 5 over cycle 1: 15.5 % [14.9 to 16.2 %], n = 20; limit at most 10 %: no.``
        ``values``, ``spreads`` and ``sizes`` hold value, interval and n per criterion; the sentence gives the meaning
        of infinite values.
        """
        if self.yes:
            wordings = {YES: self.yes, NO: self.no, UNCLEAR: self.unclear or UNDECIDED.format(self.yes)}
            pairs = zip(self.criteria, values, strict=True)
            words = [f"{value} ({criterion.infinite})" if value == INFINITE else value for criterion, value in pairs]
            return fill_names("finding", wordings[verdict], {"value": words[0], "values": words})
        quantities: dict[tuple[str, str], list[str]] = {}
        for criterion, value, spread, size in zip(self.criteria, values, spreads, sizes, strict=True):
            if criterion.holds != ANY:
                reason = f" ({criterion.infinite})" if value == INFINITE else ""
                case = f"{criterion.case}: " if criterion.case else ""
                measured = f"{case}{value}{reason} [{spread}], n = {size}"
                limit = criterion.format_limit(criterion.holds)
                quantities.setdefault((criterion.quantity, limit), []).append(measured)
        parts = []
        for (quantity, limit), cases in quantities.items():
            listed = "; ".join(cases) if len(cases) <= MOST_SHOWN else f"{len(cases)} values"
            named = "" if self.says and len(quantities) == 1 else f"{quantity}: "
            parts.append(f"{named}{listed}; limit {limit}")
        if self.says:
            return f"{self.says}: {WORDS[verdict]} ({'. '.join(parts)})."
        return f"{'. '.join(parts)}: {WORDS[verdict]}."


@dataclass(frozen=True)
class StatementResult:
    """A statement and the measured results of its criteria."""

    statement: Claim | Finding
    measured: Sequence[CriterionResult]

    @property
    def verdict(self) -> str:
        """Verdict of a claim, one of ``VERDICTS``, or of a finding: ``yes``, ``no`` or ``unclear``."""
        return self.statement.decide({result.verdict for result in self.measured if result.criterion.holds != ANY})

    @property
    def columns(self) -> dict[str, Sequence[str]]:
        """Value, interval, n and verdict per criterion for readers, by the names in ``MEASURED``."""
        return {
            "values": [result.value for result in self.measured],
            "intervals": [result.spread for result in self.measured],
            "counts": [result.interval.size for result in self.measured],
            "verdicts": [self.statement.verdicts[result.verdict] for result in self.measured],
        }

    @property
    def sentence(self) -> str:
        """Statement and verdict as a sentence."""
        return self.statement.sentence(self.verdict, *list(self.columns.values())[:-1])
