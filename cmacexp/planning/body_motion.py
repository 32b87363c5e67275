"""How a body sways in a gait that stands on two feet at times, so that its feet can give what it needs.

A level body at a constant speed needs the force of the ground below its centre of mass. Two feet press between them
only, so that the body would turn about the line between them. It need not where it accelerates away from that line as
an inverted pendulum does (Kajita et al. 2001): with the height h the centre of pressure is c = d - (h/g) d'' for a
body that is at d, and for a periodic c there is one periodic d.
"""

import math

import numpy as np

from cmacexp.models.leg import GRAVITY
from cmacexp.planning.trajectory import Motion
from cmacexp.typing import Array

EASE = 0.1
"""Length over which feet that hardly press may keep the centre of pressure off the line of the others, m."""


def find_pressure(feet: Array, weight: Array, wanted: Array) -> Array:
    """Centre of pressure (N, 2), near the ``wanted`` one (N, 2), that feet (N, L, 2) can give, m.

    Each presses with its ``weight`` (N, L), without a unit, times a linear function of its place: with EASE = 0
    exactly about the wanted centre, if the feet span it.
    """
    away = feet - wanted[:, None]
    x = away[..., 0]
    y = away[..., 1]
    sx = (weight * x).sum(axis=1)
    sy = (weight * y).sum(axis=1)
    ease = EASE**2 * weight.sum(axis=1)
    xx = (weight * x * x).sum(axis=1) + ease
    xy = (weight * x * y).sum(axis=1)
    yy = (weight * y * y).sum(axis=1) + ease
    size = xx * yy - xy * xy
    tilt_x, tilt_y = -(yy * sx - xy * sy) / size, -(xx * sy - xy * sx) / size
    press = np.maximum(weight * (1.0 + tilt_x[:, None] * x + tilt_y[:, None] * y), 0.0)
    return wanted + (press[..., None] * away).sum(axis=1) / press.sum(axis=1)[:, None]


def _decay(root: float, values: Array) -> Array:
    """s_k = root s_k-1 + values_k (N, 2) on a ring."""
    sums, last = np.empty_like(values), np.zeros(2)
    for _ in range(2):  # the first time round from zero, then from what closes the ring
        for k, value in enumerate(values):
            last = root * last + value
            sums[k] = last
        last = last / (1.0 - root ** len(values))
    return sums


def find_sway(pressure: Array, height: float, period: float) -> Motion:
    """The periodic motion of a body whose centre of pressure (N, 2) is off its mean place by that, m.

    ``height`` is that of the centre of mass, m, ``period`` that of sampling, s.
    """
    # The periodic solution of (1 + 2 share) place_k - share (place_k+1 + place_k-1) = pressure_k.
    share = height / GRAVITY / period**2
    root = ((1.0 + 2.0 * share) - math.sqrt(1.0 + 4.0 * share)) / (2.0 * share)
    ahead, back = _decay(root, pressure), _decay(root, pressure[::-1])[::-1]
    place: Array = (ahead + back - pressure) / math.sqrt(1.0 + 4.0 * share)
    after, before = np.roll(place, -1, axis=0), np.roll(place, 1, axis=0)
    return Motion(place, (after - before) / (2.0 * period), (after - 2.0 * place + before) / period**2)
