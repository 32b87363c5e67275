"""Sine and cosine together, as plain arithmetic that the compiler can inline into loops.

A step of one leg takes eight of these pairs, and calling the C library for them costs more than all the rest of its
plant. Both are within 1.5 units of the last place, near their zeros within 1e-26 times the angle.
Six of the eight belong to angles close to one whose pair is known, where :func:`rotate` costs less.
"""

import math
from typing import Any

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array

FURTHEST = 1e6
"""Largest angle, rad, with a sine here: beyond it quarter turns cannot be subtracted without loss of precision."""
QUARTERS = 2.0 / math.pi
"""Quarter turns per rad."""
TO_INTEGER = 1.5 * 2.0**52
"""Doubles of this size are whole numbers: adding and subtracting it rounds."""
QUARTER_HEAD = 1.57079632673412561417
"""The first 33 bits of a quarter turn, rad: times a whole number below 2^20 it is exact."""
QUARTER_TAIL = 6.07710050650619224932e-11
"""A quarter turn less its head, rad."""
LARGEST_ROTATION = 0.0625
"""Largest rotation, rad, for which the power series of :func:`rotate` are long enough."""
S3, S5, S7, S9, S11, S13, S15 = ((-1) ** (n // 2) / math.factorial(n) for n in range(3, 16, 2))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** (n // 2) / math.factorial(n) for n in range(4, 17, 2))


@kernel
def split_quarters(angle: Any) -> tuple[Any, Any, Any]:
    """Return the number of quarter turns in an angle, rad, or an array of them, and sine and cosine of the remainder.

    The remainder is at most pi/4, where the power series can end after x^16. Its terms are added in pairs, which the
    processor computes in parallel.
    """
    quarters = (angle * QUARTERS + TO_INTEGER) - TO_INTEGER
    x = (angle - quarters * QUARTER_HEAD) - quarters * QUARTER_TAIL
    x2 = x * x
    x4 = x2 * x2
    x8 = x4 * x4
    s = x + x * x2 * (((S3 + x2 * S5) + x4 * (S7 + x2 * S9)) + x8 * ((S11 + x2 * S13) + x4 * S15))
    c = 1.0 - (0.5 * x2 - x4 * (((C4 + x2 * C6) + x4 * (C8 + x2 * C10)) + x8 * ((C12 + x2 * C14) + x4 * C16)))
    return quarters, s, c


@kernel
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine of an angle in rad; NaN beyond :data:`FURTHEST` and where it is not finite."""
    if not abs(angle) < FURTHEST:
        return math.nan, math.nan
    quarters, s, c = split_quarters(angle)
    turned = int(quarters)
    if turned & 1:
        s, c = c, -s
    if turned & 2:
        s, c = -s, -c
    return s, c


def sines_cosines(angles: Array) -> tuple[Array, Array]:
    """Return sines and cosines of an array of angles, rad, in its shape and with the bits of :func:`sine_cosine`."""
    quarters, s, c = split_quarters(np.where(np.abs(angles) < FURTHEST, angles, math.nan))
    odd = quarters % 2.0 == 1.0
    half = quarters % 4.0 >= 2.0
    s, c = np.where(odd, c, s), np.where(odd, -s, c)
    return np.where(half, -s, s), np.where(half, -c, c)


@kernel
def rotate(sine: float, cosine: float, by: float) -> tuple[float, float]:
    """Rotate the sine and cosine of an angle by an increment ``by`` of at most :data:`LARGEST_ROTATION`, rad.

    Each is within 2e-16 of the exact rotation of ``sine`` and ``cosine``. The series leave out by^9/9! and
    by^10/10!, at most 4e-17 and 2.5e-19. The last addition rounds by 1.1e-16 at most; the term it adds is at most
    1/16, with an error of some 3e-17. All of this is relative to the length of the pair, 1: near its zero a sine has
    fewer digits than that of :func:`sine_cosine`. Errors of successive rotations add up.
    """
    x2 = by * by
    s = by + by * x2 * (S3 + x2 * (S5 + x2 * S7))
    lost = x2 * (0.5 - x2 * (C4 + x2 * (C6 + x2 * C8)))  # 1 - cosine, which keeps the digits that 1 would hide
    return sine + (cosine * s - sine * lost), cosine - (sine * s + cosine * lost)
