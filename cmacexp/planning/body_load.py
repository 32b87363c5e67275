"""The load that the feet carry together: a weight at the body's centre, or also the inertia of the legs.

The force of the ground on all feet is given by its magnitude and its centre of pressure, the point of the ground
where it has no moment about a horizontal axis (Vukobratovic & Borovac 2004, the zero-moment point).
"""

from typing import NamedTuple

import numpy as np

from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.trajectory import Motion, X, Y
from cmacexp.typing import Array


class BodyLoad(NamedTuple):
    """Force of the ground over a cycle of N samples."""

    force: Array
    """(N,): N."""
    centre: Array
    """(N, 2): centre of pressure, forward and left of the body's centre, m."""

    @property
    def mean_centre(self) -> Array:
        """(2,): its mean over the cycle, weighted by force, m."""
        mean: Array = (self.force[:, None] * self.centre).mean(axis=0) / self.force.mean()
        return mean


def static_load(weight: float, samples: int) -> BodyLoad:
    """The weight (N) of a body whose legs do not count, as in Lin & Song 1997, section 6."""
    return BodyLoad(np.full(samples, weight), np.zeros((samples, 2)))


def dynamic_load(mechanism: Mechanism, body_mass: float, desired: Motion, joints: Motion) -> BodyLoad:
    """Gravity and inertia of a body and of the point masses of its legs, whose feet and joints move as planned.

    The body, ``body_mass`` kg without legs, its centre in the plane of the hips, stays level and moves at constant
    speed. What accelerates the legs along x is friction at the feet, whose lever arm is the height of the hips. Jumps
    in velocity, as at both ends of one cubic, cause no force here.
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
