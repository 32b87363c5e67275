"""Measures of step responses over the samples of a mask; undefined values are NaN, never 0.

Samples run along the last axis: (cycles, L, N) gives (cycles, L). Times are multiples of the sampling period, without
interpolation.
"""

import numpy as np

from cmacexp.typing import Array, Mask

BAND = 0.02
"""Tolerance band of the settling time, as a fraction of the settled value (Ogata 2010, section 5-3)."""


def _or_nan(value: Array, mask: Mask) -> Array:
    """Return ``value`` (...) where ``mask`` has at least one sample, else NaN."""
    return np.where(mask.any(axis=-1), value, np.nan)


def mean(value: Array, mask: Mask) -> Array:
    """Compute the mean over the samples of ``mask``."""
    count = mask.sum(axis=-1, dtype=np.int32)  # in half the time of 64 bits
    return np.where(mask, value, 0.0).sum(axis=-1) / np.where(count == 0, np.nan, count)


def rms(value: Array, mask: Mask) -> Array:
    """Compute the root mean square over the samples of ``mask``."""
    return np.sqrt(mean(value**2, mask))


def largest(value: Array, mask: Mask) -> Array:
    """Compute the largest value over the samples of ``mask``."""
    return _or_nan(np.where(mask, value, -np.inf).max(axis=-1), mask)


def ripple(value: Array, mask: Mask) -> Array:
    """Compute the standard deviation over the samples of ``mask``."""
    return rms(value - mean(value, mask)[..., None], mask)


def integrate(value: Array, mask: Mask, step: float) -> Array:
    """Integrate over the samples of ``mask``, each held for the sampling period ``step``, s."""
    return _or_nan(np.where(mask, value, 0.0).sum(axis=-1) * step, mask)


def divide(value: Array, by: Array) -> Array:
    """Divide ``value`` by ``by``; NaN where the divisor is 0."""
    return value / np.where(by == 0.0, np.nan, by)


def settling_time(elapsed: Array, value: Array, settled: Array, mask: Mask, step: float) -> Array:
    """Compute the time until a response that starts at 0 stays within :data:`BAND` of ``settled`` (...), s.

    ``elapsed`` is the time since the step, s; ``step`` the sampling period, s. NaN where the response never settles,
    or settles at 0.
    """
    deviation = np.abs(divide(value - settled[..., None], settled[..., None]))
    outside = mask & ~(deviation <= BAND)
    last_outside = np.where(outside, elapsed, -step).max(axis=-1)
    return np.where(last_outside < largest(elapsed, mask), last_outside + step, np.nan)
