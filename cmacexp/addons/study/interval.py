"""Intervals: what a sample of runs says of a value, and how surely."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.typing import Array, Mask

CONFIDENCE = 0.95
RESAMPLES = 2000
FEW = 10
"""Number of values below which intervals are Student's t: of three, a percentile bootstrap covers 76 %, not 95 %."""
TRIMMED_FROM = 4
"""Least number of values of which a bootstrapped mean leaves out the outer quarters."""
UNPAIRED = -math.inf
"""Value in a sample of ratios whose reference failed, so that the pair says nothing."""
EXACT, UNDEFINED = "deterministic", "undefined"
"""Methods without an interval: no seed changes the value; a run failed before it had one."""
NO_REFERENCE, ONE_SEED = "n/a: the reference fell", "undecided: one seed"
"""Methods without an interval: there is nothing to compare with; nothing follows from one seed."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % confidence interval, of the runs that completed; of an exact value, that value."""

    value: float
    low: float
    high: float
    count: int
    """Values that it rests on."""
    method: str
    """How the interval was computed."""
    failed: int = 0
    """Runs without a finite value: counted apart, and beyond every limit for a verdict."""
    unpaired: int = 0
    """Runs that are left out since the run that they are compared with failed."""

    @property
    def reach(self) -> float:
        """Upper end for a verdict: no limit holds for a run that failed."""
        return math.inf if self.failed else self.high

    @property
    def size(self) -> str:
        """E.g. ``5``; ``18 of 20`` where runs failed, were left out, or are a share of others."""
        if self.method == WILSON:
            return f"{round(self.value * self.count)} of {self.count}"
        total = self.count + self.failed + self.unpaired
        return f"{self.count} of {total}" if total > self.count else f"{total}"


WILSON = "Wilson"
UNKNOWN = Interval(math.nan, math.nan, math.nan, 0, UNDEFINED)
"""The interval of a value that runs which failed do not define."""


class BadSample(ValueError):
    """A sample that has no interval."""


def estimate(sample: Sequence[float] | Sequence[bool] | Array | Mask, dimensionless: bool = False) -> Interval:
    """The interval of a sample, by what the sample is.

    Of truth values: the proportion that is true, with Wilson's interval (Wilson 1927). Of fewer than ``FEW`` numbers
    that differ: the mean, with Student's t; of ``dimensionless`` ones, which are ratios if they are positive, the
    geometric mean, with Student's t of the logarithms. Of more: the interquartile mean, with a percentile bootstrap
    (Agarwal et al. 2021). Of one number, or equal ones: the number itself, since nothing that was varied changes it.
    An infinite value is that of a run that failed, ``UNPAIRED`` that of one whose reference failed: both are counted
    apart.

    Raises:
        BadSample: it is empty or contains NaN.

    >>> estimate([True] * 38 + [False] * 2).low > 0.8
    True
    >>> estimate([2.0]).method
    'deterministic'
    >>> estimate([0.5, 2.0], dimensionless=True).value
    1.0
    """
    values = np.atleast_1d(np.asarray(sample))
    if not values.size:
        raise BadSample("the sample is empty")
    if values.dtype == bool:
        return _wilson(int(values.sum()), len(values))
    if np.isnan(values).any():
        raise BadSample("the sample contains NaN: say what an undefined value counts as")
    paired = values[values != UNPAIRED].astype(float)
    finite = paired[np.isfinite(paired)]
    endless = Interval(math.inf, math.inf, math.inf, 0, EXACT)
    found = _estimate_finite(finite, dimensionless) if finite.size else endless
    if not paired.size:
        found = replace(UNKNOWN, method=NO_REFERENCE)
    return replace(found, failed=len(paired) - len(finite), unpaired=len(values) - len(paired))


def _estimate_finite(values: Array, dimensionless: bool) -> Interval:
    if len(set(values.tolist())) == 1:
        value = float(values[0])
        return Interval(value, value, value, len(values), EXACT)
    if len(values) >= FEW:
        return _bootstrap(values)
    if dimensionless and values.min() > 0.0:
        logarithmic = student(np.log(values))
        value, low, high = np.exp([logarithmic.value, logarithmic.low, logarithmic.high]).tolist()
        return Interval(value, low, high, len(values), f"{logarithmic.method} of logarithms")
    return student(values)


def student(values: Array) -> Interval:
    """The mean of two values or more, (count,), with Student's t."""
    from scipy.special import stdtrit

    count, value = len(values), float(values.mean())
    quantile = float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0))
    reach = quantile * float(values.std(ddof=1)) / math.sqrt(count)
    return Interval(value, value - reach, value + reach, count, "Student's t")


def _wilson(successes: int, count: int) -> Interval:
    from scipy.stats import binomtest

    found = binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / count, float(found.low), float(found.high), count, WILSON)


def _compute_centre(values: Array) -> Array:
    """The mean along the last axis; from four values on without their outer quarters."""
    count = values.shape[-1]
    cut = count // 4 if count >= TRIMMED_FROM else 0
    return np.asarray(np.sort(values, axis=-1)[..., cut : count - cut].mean(axis=-1))


def _bootstrap(values: Array) -> Interval:
    """The centre of values (count,), with the percentiles of the centres of draws with replacement from them.

    The draws are the same for all samples of a size.
    """
    count, outside = len(values), round(RESAMPLES * (1.0 - CONFIDENCE) / 2.0)
    drawn = values[np.random.default_rng(0).integers(count, size=(RESAMPLES, count))]
    low, high = np.sort(_compute_centre(drawn))[[outside, -1 - outside]].tolist()
    return Interval(float(_compute_centre(values)), low, high, count, "bootstrap")
