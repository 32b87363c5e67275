"""Estimates of values from samples of runs, with 95 % confidence intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.typing import Array, Mask

CONFIDENCE = 0.95
RESAMPLES = 2000
FEW = 10
"""Sample size below which intervals are Student's t: for three values a percentile bootstrap covers only 76 %."""
TRIMMED_FROM = 4
"""Sample size from which a bootstrapped mean leaves out the outer quarters of the values."""
UNPAIRED = -math.inf
"""Value in a sample of ratios for a pair whose reference failed; the pair is left out."""
EXACT = "deterministic"
"""Method of a value that no seed and no case changes; it has no interval."""
UNDEFINED = "undefined"
"""Method of a value that cannot be computed since runs failed."""
RANGE = "min and max"
"""Method of a median with the smallest and the largest value: conditions chosen by hand are no random sample."""
NO_REFERENCE = "n/a: the reference fell"
"""Method of a ratio whose references all failed."""
ONE_SEED = "undecided: one seed"
"""Method of a value from runs with one seed, which decide nothing."""


@dataclass(frozen=True)
class Interval:
    """An estimate from completed runs with its 95 % confidence interval, of zero width for an exact value."""

    value: float
    low: float
    high: float
    count: int
    """Number of values in the estimate."""
    method: str
    """Method of the interval, such as ``bootstrap``, or the reason why there is none."""
    failed: int = 0
    """Number of runs without a finite value: not in the estimate, and beyond every limit in a verdict."""
    unpaired: int = 0
    """Number of runs that are left out since their reference failed."""

    @property
    def reach(self) -> float:
        """Upper end for a verdict: infinite if a run failed, since no limit holds for it."""
        return math.inf if self.failed else self.high

    @property
    def size(self) -> str:
        """Sample size for readers, e.g. ``5``; ``18 of 20`` for a proportion, or if runs failed or were left out."""
        if self.method == WILSON:
            return f"{round(self.value * self.count)} of {self.count}"
        total = self.count + self.failed + self.unpaired
        return f"{self.count} of {total}" if total > self.count else f"{total}"


WILSON = "Wilson"
UNKNOWN = Interval(math.nan, math.nan, math.nan, 0, UNDEFINED)
"""Interval of a value that cannot be computed since runs failed."""


class BadSample(ValueError):
    """Error of a sample that has no interval."""


def estimate(
    sample: Sequence[float] | Sequence[bool] | Array | Mask, picked: bool = False, signed: bool = False
) -> Interval:
    """Estimate a value and its 95 % confidence interval from a sample, by a method that depends on the sample.

    - Boolean values: the proportion of true values, with Wilson's interval (Wilson 1927).
    - One number or equal numbers: that number, since nothing that was varied changes it.
    - Numbers of ``picked`` conditions, chosen by hand: the median, with the smallest and the largest number.
    - Fewer than ``FEW`` positive numbers: the geometric mean, with Student's t of the logarithms.
    - As few numbers, some of them 0 and none negative: as of picked conditions.
    - As few numbers, some of them negative or of a ``signed`` quantity: the mean, with Student's t.
    - More numbers: the interquartile mean, with a percentile bootstrap (Agarwal et al. 2021).

    So no interval of a quantity that cannot be negative reaches below 0.

    An infinite value stands for a failed run, ``UNPAIRED`` for a run whose reference failed: both are counted, but do
    not enter the estimate.

    Raises:
        BadSample: the sample is empty or contains NaN.

    >>> estimate([True] * 38 + [False] * 2).low > 0.8
    True
    >>> estimate([2.0]).method
    'deterministic'
    >>> estimate([0.5, 2.0]).value
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
    interval = _estimate_finite(finite, picked, signed) if finite.size else endless
    if not paired.size:
        interval = replace(UNKNOWN, method=NO_REFERENCE)
    return replace(interval, failed=len(paired) - len(finite), unpaired=len(values) - len(paired))


def _estimate_finite(values: Array, picked: bool, signed: bool) -> Interval:
    least = float(values.min())
    if len(set(values.tolist())) == 1:
        return Interval(least, least, least, len(values), EXACT)
    signed = signed or least < 0.0
    if picked or (len(values) < FEW and least == 0.0 and not signed):
        return Interval(float(np.median(values)), least, float(values.max()), len(values), RANGE)
    if len(values) >= FEW:
        return _bootstrap(values)
    if signed:
        return student(values)
    logarithmic = student(np.log(values))
    with np.errstate(over="ignore"):
        value, low, high = np.exp([logarithmic.value, logarithmic.low, logarithmic.high]).tolist()
    return Interval(value, low, high, len(values), f"{logarithmic.method} of logarithms")


def student(values: Array) -> Interval:
    """Estimate the mean of at least two values (count,), with Student's t interval."""
    from scipy.special import stdtrit

    count = len(values)
    value = float(values.mean())
    quantile = float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0))
    reach = quantile * float(values.std(ddof=1)) / math.sqrt(count)
    return Interval(value, value - reach, value + reach, count, "Student's t")


def _wilson(successes: int, count: int) -> Interval:
    from scipy.stats import binomtest

    bounds = binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / count, float(bounds.low), float(bounds.high), count, WILSON)


def _compute_centre(values: Array) -> Array:
    """Compute the mean along the last axis, without the outer quarters of at least ``TRIMMED_FROM`` values."""
    count = values.shape[-1]
    cut = count // 4 if count >= TRIMMED_FROM else 0
    return np.asarray(np.sort(values, axis=-1)[..., cut : count - cut].mean(axis=-1))


def _bootstrap(values: Array) -> Interval:
    """Estimate the trimmed mean of values (count,), with a percentile bootstrap.

    All samples of the same size use the same random draws.
    """
    count = len(values)
    outside = round(RESAMPLES * (1.0 - CONFIDENCE) / 2.0)
    drawn = values[np.random.default_rng(0).integers(count, size=(RESAMPLES, count))]
    low, high = np.sort(_compute_centre(drawn))[[outside, -1 - outside]].tolist()
    return Interval(float(_compute_centre(values)), low, high, count, "bootstrap")
