"""Measures of responses over the samples of a mask; undefined values are NaN, never 0.

Samples run along the last axis: (cycles, L, N) gives (cycles, L).
Times are whole samples, without interpolation.
"""

import numpy as np

from cmacexp.typing import Array, Mask

BAND = 0.02
"""A response has settled within this fraction of its settled value (Ogata 2010, section 5-3)."""


def _or_nan(value: Array, mask: Mask) -> Array:
    """``value`` (...) where ``mask`` has at least one sample, else NaN."""
    return np.where(mask.any(axis=-1), value, np.nan)


def mean(value: Array, mask: Mask) -> Array:
    """Mean over the samples of ``mask``."""
    count = mask.sum(axis=-1, dtype=np.int32)  # which takes half the time of 64 bits
    return np.where(mask, value, 0.0).sum(axis=-1) / np.where(count == 0, np.nan, count)


def rms(value: Array, mask: Mask) -> Array:
    """Root mean square over the samples of ``mask``."""
    return np.sqrt(mean(value**2, mask))


def largest(value: Array, mask: Mask) -> Array:
    """Largest value over the samples of ``mask``."""
    return _or_nan(np.where(mask, value, -np.inf).max(axis=-1), mask)


def ripple(value: Array, mask: Mask) -> Array:
    """Standard deviation over the samples of ``mask``."""
    return rms(value - mean(value, mask)[..., None], mask)


def integrate(value: Array, mask: Mask, step: float) -> Array:
    """Sum over the samples of ``mask`` times the sampling period ``step``, s: each sample holds for one period."""
    return _or_nan(np.where(mask, value, 0.0).sum(axis=-1) * step, mask)


def divide(value: Array, by: Array) -> Array:
    """``value`` / ``by``, NaN where that is 0."""
    return value / np.where(by == 0.0, np.nan, by)


def settling_time(elapsed: Array, value: Array, settled: Array, mask: Mask, step: float) -> Array:
    """Time until a response from 0 stays within :data:`BAND` around ``settled`` (...), s.

    NaN where it never does, or settles at 0.
    """
    away = np.abs(divide(value - settled[..., None], settled[..., None]))
    outside = mask & ~(away <= BAND)
    last_outside = np.where(outside, elapsed, -step).max(axis=-1)
    return np.where(last_outside < largest(elapsed, mask), last_outside + step, np.nan)
