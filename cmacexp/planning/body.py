"""The body in a plan: the load that its feet carry together, and its sway in gaits that at times stand on two feet.

The force of the ground on all feet is given by its magnitude and its centre of pressure, the point of the ground
where it has no moment about a horizontal axis (Vukobratovic & Borovac 2004, the zero-moment point). The load is a
weight at the body's centre, with or without the inertia of the legs.

A level body at a constant speed needs the force of the ground below its centre of mass. Two feet press only between
them, which would turn the body about the line between them, unless the body accelerates away from that line as an
inverted pendulum does (Kajita et al. 2001): with the height h the centre of pressure is c = d - (h/g) d'' for a body
that is at d, and for a periodic c there is one periodic d.
"""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.reference import Motion, X, Y
from cmacexp.typing import Array


class BodyLoad(NamedTuple):
    """Force of the ground on all feet over a cycle of N samples."""

    force: Array
    """(N,): magnitude, N."""
    centre: Array
    """(N, 2): centre of pressure, forward and left of the body's centre, m."""

    @property
    def mean_centre(self) -> Array:
        """(2,): mean of ``centre`` over the cycle, weighted by force, m."""
        mean: Array = (self.force[:, None] * self.centre).mean(axis=0) / self.force.mean()
        return mean


def static_load(weight: float, samples: int) -> BodyLoad:
    """Return the constant load of a body of ``weight``, N, with massless legs, as in Lin & Song 1997, section 6."""
    return BodyLoad(np.full(samples, weight), np.zeros((samples, 2)))


def dynamic_load(mechanism: Mechanism, body_mass: float, desired: Motion, joints: Motion) -> BodyLoad:
    """Compute the load from gravity and inertia of a body and of the point masses of its legs along a planned motion.

    The body, ``body_mass`` kg without legs, its centre in the plane of the hips, stays level and moves at constant
    speed. Friction at the feet accelerates the legs along x, with the height of the hips as its lever arm. Jumps in
    velocity, as at both ends of one cubic, cause no force here.
    """
    legs = mechanism.planar_legs
    angle, rate, acceleration = (values[..., 0] for values in joints)
    sine, cosine = np.sin(angle), np.cos(angle)
    knee_x, knee_y = legs.length_1 * cosine, legs.length_1 * sine
    knee_ax = -legs.length_1 * (sine * acceleration + cosine * rate**2)
    knee_ay = legs.length_1 * (cosine * acceleration - sine * rate**2)
    force = np.full(len(angle), GRAVITY * body_mass)
    moment_x, moment_y = np.zeros((2, len(angle)))
    foot, foot_acceleration = (
        (values[..., X], values[..., Y]) for values in (desired.position, desired.acceleration)
    )
    for mass, x, y, ax, ay in (
        (legs.mass_1, knee_x, knee_y, knee_ax, knee_ay),
        (legs.mass_2, *foot, *foot_acceleration),
    ):
        down = mass * (GRAVITY - ay)
        force += down.sum(axis=1)
        above_ground = mechanism.hip_height - y
        moment_x += ((mechanism.hips[:, 0] + x) * down - above_ground * mass * ax).sum(axis=1)
        moment_y += (mechanism.hips[:, 1] * down).sum(axis=1)
    return BodyLoad(force, np.stack([moment_x, moment_y], axis=1) / force[:, None])


EASE = 0.1
"""Distance by which feet that hardly press may keep the centre of pressure off the line of the other feet, m."""


def find_pressure(feet: Array, weight: Array, wanted: Array) -> Array:
    """Find a centre of pressure (N, 2), m, near the ``wanted`` one (N, 2), that feet (N, L, 2), m, can give.

    Each foot presses with its ``weight`` (N, L), without a unit, times a linear function of its position: with EASE
    = 0 exactly about the wanted centre, if the feet span it.
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
    """Compute the periodic sums s_k = root s_k-1 + values_k of ``values`` (N, 2)."""
    sums = np.empty_like(values)
    last = np.zeros(2)
    for _ in range(2):  # the second pass starts from the value that makes the sums periodic
        for k, value in enumerate(values):
            last = root * last + value
            sums[k] = last
        last = last / (1.0 - root ** len(values))
    return sums


def find_sway(pressure: Array, height: float, period: float) -> Motion:
    """Find the periodic sway of a body whose centre of pressure moves by ``pressure`` (N, 2), m, about its mean.

    ``height`` is that of the centre of mass, m, ``period`` the sampling period, s. The sway has the unit of
    ``pressure``.
    """
    # The periodic solution of (1 + 2 share) position_k - share (position_k+1 + position_k-1) = pressure_k.
    share = height / GRAVITY / period**2
    root = ((1.0 + 2.0 * share) - math.sqrt(1.0 + 4.0 * share)) / (2.0 * share)
    both_ways = _decay(root, pressure) + _decay(root, pressure[::-1])[::-1]
    position: Array = (both_ways - pressure) / math.sqrt(1.0 + 4.0 * share)
    after = np.roll(position, -1, axis=0)
    before = np.roll(position, 1, axis=0)
    return Motion(position, (after - before) / (2.0 * period), (after - 2.0 * position + before) / period**2)
