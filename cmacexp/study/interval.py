"""Intervals: what a sample of runs says of a value, and how surely."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.typing import Array, Mask

CONFIDENCE = 0.95
RESAMPLES = 2000
TRIMMED_FROM = 4
"""Least number of values of which the outer quarters are left out."""
EXACT = "exact"
UNDEFINED = "undefined"


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % confidence interval; of an exact value, that value."""

    value: float
    low: float
    high: float
    count: int
    method: str
    """How the interval was computed."""


UNKNOWN = Interval(math.nan, math.nan, math.nan, 0, UNDEFINED)
"""Of what runs that failed do not define."""


class BadSample(ValueError):
    """A sample that has no interval."""


def estimate(sample: Sequence[float] | Sequence[bool] | Array | Mask) -> Interval:
    """The interval of a sample, by what the sample is.

    Of truth values: the proportion that is true, with Wilson's interval (Wilson 1927). Of numbers that differ: the
    mean, of four or more the interquartile mean, with a percentile bootstrap (Agarwal et al. 2021). Of one number,
    or equal ones: the number itself, since nothing that was varied changes it.

    Raises:
        BadSample: it is empty or contains NaN.

    >>> estimate([True] * 38 + [False] * 2).low > 0.8
    True
    >>> estimate([2.0])
    Interval(value=2.0, low=2.0, high=2.0, count=1, method='exact')
    """
    values = np.atleast_1d(np.asarray(sample))
    if not values.size:
        raise BadSample("the sample is empty")
    if values.dtype == bool:
        return _wilson(int(values.sum()), len(values))
    if np.isnan(values).any():
        raise BadSample("the sample contains NaN: say what an undefined value counts as")
    if len(set(values.tolist())) == 1:
        value = float(values[0])
        return Interval(value, value, value, len(values), EXACT)
    return bootstrap(values.astype(float))


def _wilson(successes: int, count: int) -> Interval:
    from scipy.stats import binomtest

    found = binomtest(successes, count).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(successes / count, float(found.low), float(found.high), count, "Wilson")


def compute_centre(values: Array) -> Array:
    """The mean along the last axis; from four values on without their outer quarters."""
    count = values.shape[-1]
    cut = count // 4 if count >= TRIMMED_FROM else 0
    centre: Array = np.sort(values, axis=-1)[..., cut : count - cut].mean(axis=-1)
    return centre


def resample(values: Array) -> Array:
    """Draws with replacement along the last axis, (RESAMPLES, ...); the same ones for all arrays of that length."""
    chosen = np.random.default_rng(0).integers(values.shape[-1], size=(RESAMPLES, values.shape[-1]))
    return np.moveaxis(values[..., chosen], -2, 0)


def find_ends(resampled: Array) -> tuple[Array, Array]:
    """Lower and upper end of the interval of a statistic, (RESAMPLES, ...)."""
    ordered = np.sort(resampled, axis=0)
    outside = round(RESAMPLES * (1.0 - CONFIDENCE) / 2.0)
    return ordered[outside], ordered[-1 - outside]


def bootstrap(values: Array, statistic: Callable[[Array], Array] = compute_centre) -> Interval:
    """Percentiles of a statistic, over the last axis of ``values`` (..., count).

    Not scipy's, which cannot rank the infinite value of a run that diverged. ``statistic`` takes (..., count), with
    any number of axes before the last.
    """
    low, high = find_ends(statistic(resample(values)))
    return Interval(float(statistic(values)), float(low), float(high), values.shape[-1], "bootstrap")
