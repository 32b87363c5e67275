"""What acts on a leg beside its motors, as kernels: elastic ground, and joints as they are built.

A foot sticks to the ground or slides. Joints have dry friction over their angle, an offset, a spring.
"""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.models.ground import Ground, damped_force, grade_at, height_at
from cmacexp.typing import Array, Counts

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


class Joints(NamedTuple):
    """Joints (L, J) whose friction depends on their angle, and what else turns them."""

    friction: Array
    """(nv,): dry friction of all that moves, in MuJoCo's model, N m."""
    low: Array
    """(L, J): angle of the first knot, rad."""
    high: Array
    """(L, J): angle of the last, rad."""
    knots: Array
    """(L, J, K) friction at equal distances, N m."""
    offset: Array
    """(L, J): torque at any angle, N m."""
    spring: Array
    """(L, J): torque at the last knot, and its opposite at the first, N m."""


@kernel
def hold_torque(joints: Joints | None, torque: Array, q: Counts, dq: Counts, position: Array, applied: Array) -> None:
    """Hold ``torque`` (L, J), N m, and what ``joints`` add to it at their present angles; sets their friction.

    Joints have the rows ``q`` (L, J) of ``position``, rad, and ``dq`` of ``applied``, N m, which this fills.
    """
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            at = dq[i, j]
            applied[at] = torque[i, j]
            if joints is not None:
                low, last = joints.low[i, j], joints.knots.shape[2] - 1
                unit = (position[q[i, j]] - low) / (joints.high[i, j] - low)
                unit = min(max(unit, 0.0), 1.0)
                below = min(int(unit * last), max(last - 1, 0))
                share = unit * last - below
                knot, above = joints.knots[i, j, below], joints.knots[i, j, min(below + 1, last)]
                joints.friction[at] = knot + share * (above - knot)
                applied[at] += joints.offset[i, j] + joints.spring[i, j] * (2.0 * unit - 1.0)
