"""Torque of joints beyond rigid bodies, linear in their parameters: what identification of joints regresses on."""

import numpy as np

from cmacexp.typing import Array

OWN = 4
"""Parameters of a joint before its Coulomb friction: rotor inertia, viscous friction, offset, spring."""
SLOW = 0.05
"""Velocity over its RMS below which dry friction counts as proportional to it."""


def make_regressors(motion: tuple[Array, Array, Array], ranges: Array, knots: int, slow: Array) -> Array:
    """Torque (..., 4 + knots) of joints for each unit of their parameters along a ``motion``, N m.

    These are rotor inertia, kg m^2, viscous friction, N m s/rad, an offset, a spring, which goes from -1 to 1, and
    Coulomb friction at ``knots`` angles at equal distances over ``ranges`` (2, ...), rad, all N m. Angles, rad,
    velocities, rad/s, and accelerations, rad/s^2, are (..., J) of J joints; ``slow`` (..., J) are velocities, rad/s,
    below which dry friction counts as proportional to them.
    """
    angle, velocity, acceleration = motion
    low, high = ranges
    unit = np.divide(angle - low, high - low, out=np.full_like(angle, 0.5), where=high > low)
    shares = np.maximum(0.0, 1.0 - np.abs(np.clip(unit, 0.0, 1.0)[..., None] * (knots - 1) - np.arange(knots)))
    side = np.tanh(velocity / slow)
    own = np.stack([acceleration, velocity, np.ones_like(angle), 2.0 * unit - 1.0], axis=-1)
    return np.concatenate([own, side[..., None] * shares], axis=-1)
