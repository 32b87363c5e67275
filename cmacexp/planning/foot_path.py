"""Foot paths: a quintic and a cubic in the transfer phase, a straight line in support (Lin & Song 1997, section 5).

A path is sampled at ``s`` in [0, 1), the progress within its phase, and returned as position, velocity and
acceleration, each of the shape of ``s``; ``duration`` of the phase is in s.
"""

import numpy as np

from cmacexp.planning.reference import Motion
from cmacexp.typing import Array


def _sample(coefficients: Array, s: Array, duration: float) -> Motion:
    """Evaluate a polynomial in ``s`` and its first two derivatives in time, over a phase of ``duration``, s.

    Its ``coefficients`` begin with the constant.
    """
    first = coefficients[1:] * np.arange(1.0, len(coefficients))  # np.polyder takes longer than the rest of a path
    second = first[1:] * np.arange(1.0, len(first))
    position, rate, change = (np.polyval(polynomial[::-1], s) for polynomial in (coefficients, first, second))
    return Motion(position, rate / duration, change / duration**2)


def line(start: float, end: float, s: Array, duration: float) -> Motion:
    """Sample a path of constant velocity from ``start`` to ``end``, m, at progress ``s`` (N,)."""
    return _sample(np.array([start, end - start, 0.0]), s, duration)


def quintic(start: float, end: float, velocity: float, s: Array, duration: float) -> Motion:
    """Sample a quintic from ``start`` to ``end``, m, with ``velocity``, m/s, and no acceleration at both ends.

    ``s`` is (N,).
    """
    speed = velocity * duration
    gap = end - start - speed
    return _sample(np.array([start, speed, 0.0, 10.0 * gap, -15.0 * gap, 6.0 * gap]), s, duration)


def cubic(start: float, end: float, lift: float, s: Array, duration: float) -> Motion:
    """Sample a cubic from ``start`` to ``end``, m, with its apex ``lift``, m, above ``start`` (y down) at s = 1/2.

    With equal ends it is start - 4 lift s (1 - s): its velocity jumps by 4 lift/duration against rest. ``s`` is
    (N,).
    """
    gap = end - start
    return _sample(np.array([start, gap - 4.0 * lift, 4.0 * (lift - gap), 4.0 * gap]), s, duration)


def two_cubics(start: float, end: float, lift: float, s: Array, duration: float) -> Motion:
    """Sample one cubic up and another down, m, at rest at both ends and at the apex at s = 1/2.

    The apex is ``lift``, m, above ``start`` (y down); ``s`` is (N,).
    """
    apex = start - lift
    rising = s < 0.5
    half = np.where(rising, 2.0 * s, 2.0 * s - 1.0)
    up = _sample(np.array([start, 0.0, 3.0, -2.0]) * [1.0, 0.0, apex - start, apex - start], half, duration / 2.0)
    down = _sample(np.array([apex, 0.0, 3.0, -2.0]) * [1.0, 0.0, end - apex, end - apex], half, duration / 2.0)
    return Motion(*(np.where(rising, a, b) for a, b in zip(up, down, strict=True)))


VERTICAL = {"cubic": cubic, "two_cubics": two_cubics}
