"""Joint torques besides those of rigid bodies, linear in their parameters: regressors for identification."""

import numpy as np

from cmacexp.typing import Array

OWN = 4
"""Number of parameters of a joint before its Coulomb friction: rotor inertia, viscous friction, offset, spring."""
SLOW = 0.05
"""Velocity over its RMS below which dry friction is taken as proportional to velocity."""


def make_regressors(motion: tuple[Array, Array, Array], ranges: Array, knots: int, slow: Array) -> Array:
    """Compute the torque of joints per unit of each of their parameters along a ``motion``: (..., 4 + knots), N m.

    The parameters are rotor inertia, kg m^2, viscous friction, N m s/rad, an offset, a spring, whose torque goes
    from -1 to 1 over the range, and Coulomb friction at ``knots`` equally spaced angles over ``ranges`` (2, ...),
    rad, the last three in N m. Angles, rad, velocities, rad/s, and accelerations, rad/s^2, are (..., J) of J joints;
    ``slow`` (..., J) are velocities, rad/s, below which dry friction is taken as proportional to velocity.
    """
    angle, velocity, acceleration = motion
    low, high = ranges
    unit = np.divide(angle - low, high - low, out=np.full_like(angle, 0.5), where=high > low)
    shares = np.maximum(0.0, 1.0 - np.abs(np.clip(unit, 0.0, 1.0)[..., None] * (knots - 1) - np.arange(knots)))
    side = np.tanh(velocity / slow)
    columns = np.stack([acceleration, velocity, np.ones_like(angle), 2.0 * unit - 1.0], axis=-1)
    return np.concatenate([columns, side[..., None] * shares], axis=-1)
