"""Kernels of torques and forces on a leg besides its motors: elastic ground, and joints as they are built.

A foot sticks to the ground or slides. Joints have dry friction that depends on their angle, an offset, a spring.
"""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.models.ground import Ground, damped_force, grade_at, height_at
from cmacexp.typing import Array, Counts

Vector = tuple[float, float, float]


class Touch(NamedTuple):
    """Contact of a foot with the ground."""

    ground: Ground
    friction: float = 0.0
    """Friction coefficient: largest tangential over normal force; 0: the foot slides freely."""
    stiffness: float = 0.0
    """Stiffness of the spring that holds a sticking foot, N/m."""
    damping: float = 0.0
    """Damping parallel to the spring of a sticking foot, N s/m."""


@kernel
def ground_force(touch: Touch, stiffness: float, position: Array, velocity: Vector, anchor: Array) -> Vector:
    """Compute the force (3,), N, of the ground of ``stiffness``, N/m, on a foot that sticks at ``anchor`` (2,), m.

    The foot is at ``position``, m, and moves with ``velocity``, m/s, (3,) each, in the world.
    """
    ground = touch.ground
    vx, vy, vz = velocity
    depression = height_at(ground.slope, ground.slope_start, position[0]) - position[2]
    rate = grade_at(ground, position[0]) * vx - vz
    normal = damped_force(stiffness, ground.damping, depression, rate)
    longitudinal = lateral = 0.0
    if touch.friction > 0.0:
        longitudinal = -touch.stiffness * (position[0] - anchor[0]) - touch.damping * vx
        lateral = -touch.stiffness * (position[1] - anchor[1]) - touch.damping * vy
        # Not math.hypot, whose compiled form rounds differently.
        size = math.sqrt(longitudinal * longitudinal + lateral * lateral)
        limit = touch.friction * normal
        if size > limit:
            longitudinal *= limit / size
            lateral *= limit / size
    return longitudinal, lateral, normal


@kernel
def slide_anchor(touch: Touch, position: Array, force: float, anchor: Array) -> None:
    """Move the ``anchor`` (2,), m, of a foot at ``position`` (3,), m, if it slides or is in the air.

    ``force`` is the normal one, N.
    """
    if touch.friction > 0.0:
        dx, dy = position[0] - anchor[0], position[1] - anchor[1]
        stretch = math.sqrt(dx * dx + dy * dy)
        longest = touch.friction * force / touch.stiffness
        if stretch > longest:
            anchor[0] = position[0] - dx * longest / stretch
            anchor[1] = position[1] - dy * longest / stretch


class Joints(NamedTuple):
    """Joints (L, J) with friction that depends on their angle, and torques that act in addition to the motors."""

    friction: Array
    """(nv,): dry friction in MuJoCo's model, of all degrees of freedom, N m."""
    low: Array
    """(L, J): angle of the first knot, rad."""
    high: Array
    """(L, J): angle of the last knot, rad."""
    knots: Array
    """(L, J, K): friction at K equally spaced angles, N m."""
    offset: Array
    """(L, J): torque at any angle, N m."""
    spring: Array
    """(L, J): torque at the last knot, the opposite of that at the first, N m."""


@kernel
def hold_torque(joints: Joints | None, torque: Array, q: Counts, dq: Counts, position: Array, applied: Array) -> None:
    """Hold ``torque`` (L, J), N m, and the torques of ``joints`` at their current angles; set their friction.

    Joints have the rows ``q`` (L, J) of ``position``, rad, and ``dq`` of ``applied``, N m, which this fills.
    """
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            at = dq[i, j]
            applied[at] = torque[i, j]
            if joints is not None:
                low = joints.low[i, j]
                last = joints.knots.shape[2] - 1
                unit = (position[q[i, j]] - low) / (joints.high[i, j] - low)
                unit = min(max(unit, 0.0), 1.0)
                below = min(int(unit * last), max(last - 1, 0))
                share = unit * last - below
                knot = joints.knots[i, j, below]
                joints.friction[at] = knot + share * (joints.knots[i, j, min(below + 1, last)] - knot)
                applied[at] += joints.offset[i, j] + joints.spring[i, j] * (2.0 * unit - 1.0)
