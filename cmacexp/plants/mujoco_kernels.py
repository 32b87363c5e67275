"""Contact forces for MuJoCo, and measurements of its machine, as kernels.

The function that MuJoCo calls in every stage is a compiled generator: resuming it costs a tenth of a call of a kernel
with as many arrays; its caller keeps these alive.

MuJoCo provides positions and velocities of its bodies. Body 0 is the world; then comes the body of the machine if it
floats, then thigh and shank of every leg; the centre of mass of a shank is the foot.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.ground import Ground, damped_force, grade_at, height_at
from cmacexp.typing import Array

Vector = tuple[float, float, float]


class Touch(NamedTuple):
    """The contact of a foot with the ground."""

    ground: Ground
    friction: float
    """Largest tangential over normal force; 0: the foot slides freely."""
    stiffness: float
    """Stiffness of the spring that holds a sticking foot, N/m."""
    damping: float
    """Damping beside that spring, N s/m."""


class Bodies(NamedTuple):
    """Arrays that MuJoCo fills and reads in place; B is the number of its bodies."""

    place: Array
    """(B, 3): centres of mass in the world, m."""
    motion: Array
    """(B, 6): angular velocity, rad/s, and velocity, m/s, of the point of the body that is at ``centre``."""
    centre: Array
    """(B, 3): centre of mass of a body and its descendants, m; velocities refer to that of the first of a chain."""
    pull: Array
    """(B, 6): external force (N) and moment (N m)."""
    turn: Array
    """(B, 9): rotation matrices, row by row."""


class Measured(NamedTuple):
    """Arrays for measurements, as in :class:`cmacexp.plants.Measurement`."""

    foot: Array
    velocity: Array
    pose: Array
    pose_rate: Array
    travel: Array


@kernel
def speed(bodies: Bodies, body: int, first: int, axis: int) -> float:
    """Velocity along ``axis`` of the centre of mass of ``body``, whose chain begins with ``first``, m/s."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    at, centre, motion = bodies.place, bodies.centre, bodies.motion
    return (
        motion[body, 3 + axis]
        + motion[body, a] * (at[body, b] - centre[first, b])
        - motion[body, b] * (at[body, a] - centre[first, a])
    )


@kernel
def ground_force(touch: Touch, stiffness: float, place: Array, velocity: Vector, anchor: Array) -> Vector:
    """Force of the ground on a foot at ``place`` (3,), m, that sticks at ``anchor`` (2,), N."""
    ground, (vx, vy, vz) = touch.ground, velocity
    depression = height_at(ground.slope, ground.slope_start, place[0]) - place[2]
    rate = grade_at(ground, place[0]) * vx - vz
    normal = damped_force(stiffness, ground.damping, depression, rate)
    ahead, aside = 0.0, 0.0
    if touch.friction > 0.0:
        ahead = -touch.stiffness * (place[0] - anchor[0]) - touch.damping * vx
        aside = -touch.stiffness * (place[1] - anchor[1]) - touch.damping * vy
        size, most = math.hypot(ahead, aside), touch.friction * normal
        if size > most:
            ahead *= most / size
            aside *= most / size
    return ahead, aside, normal


@kernel
def drag(touch: Touch, place: Array, force: float, anchor: Array) -> None:
    """Move the point ``anchor`` (2,) where a foot at ``place`` (3,) sticks, if it slides or is in the air."""
    dx, dy = place[0] - anchor[0], place[1] - anchor[1]
    stretch, longest = math.hypot(dx, dy), touch.friction * force / touch.stiffness
    if stretch > longest:
        anchor[0] = place[0] - dx * longest / stretch
        anchor[1] = place[1] - dy * longest / stretch


@kernel
def press(touch: Touch, bodies: Bodies, floats: int, stiffness: Array, force: Array, anchor: Array) -> None:
    """Forces of the ground on the feet: fills ``force`` (L,), N, and ``bodies.pull``.

    Args:
        touch: parameters of the contact.
        bodies: with present positions and velocities.
        floats: 1 if the machine has a body, else 0.
        stiffness: (L,): K_n under each foot, N/m.
        force: (L,): is filled with the normal forces.
        anchor: (L, 2): where each foot sticks in the world, m.
    """
    for i in range(force.shape[0]):
        shank = floats + 2 * i + 2
        first = 1 if floats else shank - 1
        velocity = speed(bodies, shank, first, 0), speed(bodies, shank, first, 1), speed(bodies, shank, first, 2)
        pull = ground_force(touch, stiffness[i], bodies.place[shank], velocity, anchor[i])
        bodies.pull[shank, 0], bodies.pull[shank, 1], bodies.pull[shank, 2] = pull
        force[i] = bodies.pull[shank, 2]


@kernel
def stick(touch: Touch, bodies: Bodies, floats: int, force: Array, anchor: Array) -> None:
    """Move the points where feet stick, ``anchor`` (L, 2), with feet that slide or are in the air."""
    for i in range(force.shape[0]):
        drag(touch, bodies.place[floats + 2 * i + 2], force[i], anchor[i])


@kernel
def observe_stand(bodies: Bodies, hip_height: float, measured: Measured) -> None:
    """Measure the feet of legs whose hips do not move; fills ``measured``."""
    for i in range(measured.foot.shape[0]):
        thigh, shank = 2 * i + 1, 2 * i + 2
        measured.foot[i, 0], measured.foot[i, 1] = bodies.place[shank, 0], hip_height - bodies.place[shank, 2]
        measured.velocity[i, 0], measured.velocity[i, 1] = (
            speed(bodies, shank, thigh, 0),
            -speed(bodies, shank, thigh, 2),
        )


@kernel
def observe_trunk(ground: Ground, at: Array, turn: Array, velocity: Array, spin: Array, measured: Measured) -> None:
    """Measure pose, rates and travel of a body that floats; fills ``measured``.

    Args:
        ground: reference of the height of the body.
        at: (3,): its origin in the world, m.
        turn: (9,): its rotation matrix, row by row.
        velocity: (3,): of its origin in the world, m/s.
        spin: (3,): its angular velocity in its own frame, rad/s.
        measured: is filled.
    """
    pitch, roll = -math.asin(turn[6]), math.atan2(turn[7], turn[8])
    measured.pose[0] = at[2] - height_at(ground.slope, ground.slope_start, at[0])
    measured.pose[1], measured.pose[2] = pitch, roll
    measured.pose_rate[0] = velocity[2] - grade_at(ground, at[0]) * velocity[0]
    measured.pose_rate[1] = spin[1] * math.cos(roll) - spin[2] * math.sin(roll)
    measured.pose_rate[2] = spin[0] + (spin[1] * math.sin(roll) + spin[2] * math.cos(roll)) * math.tan(pitch)
    measured.travel[0], measured.travel[1], measured.travel[2] = at[0], at[1], math.atan2(turn[3], turn[0])


@kernel
def observe_body(ground: Ground, bodies: Bodies, hips: Array, torso: Array, measured: Measured) -> None:
    """Measure body and feet of a machine that floats; fills ``measured``.

    Args:
        ground: reference of the height of the body.
        bodies: with present positions and velocities.
        hips: (L, 2): in the body frame, m.
        torso: (6,): velocity of the body in the world, m/s, and its angular velocity in its own frame, rad/s.
        measured: is filled.
    """
    turn, at, w = bodies.turn[1], bodies.place[1], torso[3:]
    observe_trunk(ground, at, turn, torso[:3], w, measured)
    for i in range(hips.shape[0]):
        shank = 2 * i + 3
        dx, dy, dz = bodies.place[shank, 0] - at[0], bodies.place[shank, 1] - at[1], bodies.place[shank, 2] - at[2]
        vx = speed(bodies, shank, 1, 0) - torso[0]
        vy = speed(bodies, shank, 1, 1) - torso[1]
        vz = speed(bodies, shank, 1, 2) - torso[2]
        x = turn[0] * dx + turn[3] * dy + turn[6] * dz
        z = turn[2] * dx + turn[5] * dy + turn[8] * dz
        measured.foot[i, 0], measured.foot[i, 1] = x - hips[i, 0], -z
        # Motion of the foot in the world that stems from the rotation of the body is not motion of the leg.
        measured.velocity[i, 0] = turn[0] * vx + turn[3] * vy + turn[6] * vz - w[1] * z + w[2] * hips[i, 1]
        measured.velocity[i, 1] = -(turn[2] * vx + turn[5] * vy + turn[8] * vz - w[0] * hips[i, 1] + w[1] * x)


@program
def pressing(
    touch: Touch, bodies: Bodies, floats: int, stiffness: Array, force: Array, anchor: Array
) -> Iterator[int]:
    """:func:`press` whenever it is resumed."""
    while True:
        press(touch, bodies, floats, stiffness, force, anchor)
        yield 0


@program
def sticking(touch: Touch, bodies: Bodies, floats: int, force: Array, anchor: Array) -> Iterator[int]:
    """:func:`stick` whenever it is resumed."""
    while True:
        stick(touch, bodies, floats, force, anchor)
        yield 0


@program
def observing_stand(bodies: Bodies, hip_height: float, measured: Measured) -> Iterator[int]:
    """:func:`observe_stand` whenever it is resumed."""
    while True:
        observe_stand(bodies, hip_height, measured)
        yield 0


@program
def observing_body(ground: Ground, bodies: Bodies, hips: Array, torso: Array, measured: Measured) -> Iterator[int]:
    """:func:`observe_body` whenever it is resumed."""
    while True:
        observe_body(ground, bodies, hips, torso, measured)
        yield 0
