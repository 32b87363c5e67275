"""Elastic ground."""

import math
from typing import NamedTuple

from cmacexp.arrays import Array
from cmacexp.compile import kernel
from cmacexp.models.mix import MASK, mix


class Ground(NamedTuple):
    """Flat ground, of one stiffness or in square patches of different stiffness."""

    stiffness: float
    """K_n, N/m."""
    patch_size: float
    """Side of a patch, m."""
    patch_spread: float
    """A patch has K_n times a factor between 1 - spread and 1 + spread."""
    patch_seed: int


@kernel
def stiffness_at(ground: Ground, x: float, y: float) -> float:
    """K_n at (x, y) in the world, N/m."""
    if ground.patch_spread == 0.0:
        return ground.stiffness
    column = math.floor(x / ground.patch_size) & MASK
    row = math.floor(y / ground.patch_size) & MASK
    drawn = mix(mix(mix(ground.patch_seed, column), row), 0) / MASK
    return ground.stiffness * (1.0 + ground.patch_spread * (2.0 * drawn - 1.0))


@kernel
def contact_force(stiffness: float, depression: float) -> float:
    """F = K_n D_a for D_a >= 0, N (Lin & Song 1997, eq. 1).

    Args:
        stiffness: K_n, N/m.
        depression: D_a, m, positive into the ground.
    """
    return stiffness * depression if depression > 0.0 else 0.0


def depression_for(stiffness: float, force: Array) -> Array:
    """D_a = F / K_n, m: the depression at which the ground carries ``force`` N (eq. 1)."""
    return force / stiffness
