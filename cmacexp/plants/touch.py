"""The contact of a foot with elastic ground on which it sticks or slides, as kernels."""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.models.ground import Ground, damped_force, grade_at, height_at
from cmacexp.typing import Array

Vector = tuple[float, float, float]


class Touch(NamedTuple):
    """The contact of a foot with the ground."""

    ground: Ground
    friction: float = 0.0
    """Largest tangential over normal force; 0: the foot slides freely."""
    stiffness: float = 0.0
    """Stiffness of the spring that holds a sticking foot, N/m."""
    damping: float = 0.0
    """Damping beside that spring, N s/m."""


@kernel
def ground_force(touch: Touch, stiffness: float, place: Array, velocity: Vector, anchor: Array) -> Vector:
    """Force (3,), N, of the ground of ``stiffness``, N/m, on a foot that sticks at ``anchor`` (2,), m.

    It is at ``place``, m, and moves with ``velocity``, m/s, (3,) each, in the world.
    """
    ground, (vx, vy, vz) = touch.ground, velocity
    depression = height_at(ground.slope, ground.slope_start, place[0]) - place[2]
    rate = grade_at(ground, place[0]) * vx - vz
    normal = damped_force(stiffness, ground.damping, depression, rate)
    longitudinal, lateral = 0.0, 0.0
    if touch.friction > 0.0:
        longitudinal = -touch.stiffness * (place[0] - anchor[0]) - touch.damping * vx
        lateral = -touch.stiffness * (place[1] - anchor[1]) - touch.damping * vy
        # Not math.hypot, whose compiled form rounds otherwise.
        size, most = math.sqrt(longitudinal * longitudinal + lateral * lateral), touch.friction * normal
        if size > most:
            longitudinal *= most / size
            lateral *= most / size
    return longitudinal, lateral, normal


@kernel
def slide_anchor(touch: Touch, place: Array, force: float, anchor: Array) -> None:
    """Move the point ``anchor`` (2,), m, where a foot at ``place`` (3,), m, sticks, if it slides or is in the air.

    ``force`` is the normal one, N.
    """
    if touch.friction > 0.0:
        dx, dy = place[0] - anchor[0], place[1] - anchor[1]
        stretch, longest = math.sqrt(dx * dx + dy * dy), touch.friction * force / touch.stiffness
        if stretch > longest:
            anchor[0] = place[0] - dx * longest / stretch
            anchor[1] = place[1] - dy * longest / stretch
