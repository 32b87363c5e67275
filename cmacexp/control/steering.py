"""Course feedback of a robot: the strokes of the feet are changed to correct position and heading of the body.

After a lateral push, feet touch down where they catch the body.

A body with velocity (v + dv, v_y) and yaw rate w moves its supporting feet with -(v + dv) + w y_hip along x and
-v_y - w x_hip along z, relative to the body. The planned x of a foot in support decreases at v, so scaling it gives
both paths, in transfer too.
"""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.config.gait import PATTERNS
from cmacexp.config.machine import RobotMachine
from cmacexp.jit.compiler import kernel
from cmacexp.models.leg import GRAVITY
from cmacexp.planning.plan import Setup
from cmacexp.planning.reference import ControlReference, X, Z
from cmacexp.typing import Array, Mask, Scratch

LARGEST_COMMAND = 0.1
"""Largest steering command, relative to the planned speed."""
LARGEST_STATIC_COMMAND = 0.02
"""Largest steering command in a statically stable gait, whose stability margin is only some millimetres."""
PUSHED = 0.2
"""Lateral speed above which foot placement acts, m/s: if it always acts, the body sways and learning fails."""
EASE = 0.03
"""Time constant with which a foot in transfer moves to its new target, s."""
LONGITUDINAL, LATERAL, TURN = range(3)
"""Indices of the command: dv / v, v_y / v, and yaw as the speed of the farthest hip, w r / v."""


class Steering(NamedTuple):
    """Parameters and state of the course feedback of a robot with L legs."""

    course_gain: float
    """Gain from position error to velocity command, 1/s."""
    heading_gain: float
    """Gain from heading error to yaw rate command, 1/s."""
    speed: float
    """Planned speed v, m/s."""
    period: float
    """Sampling period, s."""
    radius: float
    """Distance r of the farthest hip from the body centre, m."""
    sway: Array
    """(N, 2): planned body position relative to motion at constant speed, m."""
    most: float
    """Largest command, relative to the planned speed."""
    command: Scratch
    """(3,): LONGITUDINAL, LATERAL and TURN command, relative to the planned speed."""
    capture: float
    """Gain from lateral speed to lateral foot offset, s; 0: no foot placement."""
    farthest: float
    """Largest lateral foot offset, m."""
    lateral: Scratch
    """(1,): lateral position error of the body in the last step, m."""
    offset: Scratch
    """(L,): lateral offset of every foot from its planned position, to the left, m."""


def new_steering(setup: Setup) -> Steering | None:
    """Make the course feedback of a robot; return None without speed or gains, or for another machine."""
    config = setup.config
    hips = setup.mechanism.hips
    speed = config.body_speed
    course_gain = config.posture.course_gain
    heading_gain = config.posture.heading_gain
    if not isinstance(config.machine, RobotMachine) or speed == 0.0 or not (course_gain or heading_gain):
        return None
    sway = setup.plan.sway.position
    dynamic = PATTERNS[config.gait.pattern].is_dynamic
    height = setup.mechanism.hip_height
    # Half the support and the time constant of the inverted pendulum (Raibert 1986; Pratt 2006).
    capture = config.gait.duty_factor * config.gait.cycle_time / 2.0 + math.sqrt(height / GRAVITY) if dynamic else 0.0
    return Steering(
        course_gain=course_gain,
        heading_gain=heading_gain,
        speed=speed,
        period=config.sampling_period,
        radius=float(np.hypot(*hips.T).max()),
        sway=np.ascontiguousarray(sway - sway[0]),  # the body starts at its position of the first sample
        most=LARGEST_COMMAND if dynamic else LARGEST_STATIC_COMMAND,
        command=np.zeros(3),
        capture=capture,
        farthest=height,
        lateral=np.zeros(1),
        offset=np.zeros(len(hips)),
    )


@kernel
def place_feet(steering: Steering, support: Mask, lateral: float) -> None:
    """Move feet that are not in ``support`` (L,) sideways to where they catch a pushed body.

    ``lateral`` is the lateral position error of the body, m; its rate determines the foot offset.
    """
    rate = (lateral - steering.lateral[0]) / steering.period
    target = min(max(steering.capture * rate, -steering.farthest), steering.farthest) if abs(rate) > PUSHED else 0.0
    steering.lateral[0] = lateral
    for i in range(support.shape[0]):
        if not support[i]:
            steering.offset[i] += min(1.0, steering.period / EASE) * (target - steering.offset[i])


@kernel
def steer(steering: Steering | None, travel: Array | None, step: int, sample: int, support: Mask) -> None:
    """Compute the steering command and the foot offsets of a ``step``, at ``sample`` of its cycle.

    ``travel`` (3,) is the measured body position x, y, m, and heading, rad. Does nothing without steering or travel.
    """
    if steering is not None and travel is not None:
        command = steering.command
        speed = steering.speed
        longitudinal = step * steering.period * speed + steering.sway[sample, 0] - travel[0]
        command[LONGITUDINAL] = steering.course_gain * longitudinal / speed
        lateral = travel[1] - steering.sway[sample, 1]
        place_feet(steering, support, lateral)
        command[LATERAL] = -steering.course_gain * lateral / speed
        command[TURN] = -steering.heading_gain * travel[2] * steering.radius / speed
        for n in range(3):
            command[n] = min(max(command[n], -steering.most), steering.most)


@kernel
def steer_longitudinal(
    steering: Steering | None, hips: Array, i: int, reference: ControlReference
) -> tuple[float, float]:
    """Return the steered reference x, m, and vx, m/s, of foot ``i``; ``hips`` (L, 2), m, are in the body frame."""
    scale = 1.0
    if steering is not None:
        scale = 1.0 + steering.command[LONGITUDINAL] - steering.command[TURN] * hips[i, 1] / steering.radius
    return scale * reference.position[i, X], scale * reference.velocity[i, X]


@kernel
def steer_lateral(steering: Steering | None, hips: Array, i: int, reference: ControlReference) -> tuple[float, float]:
    """Return the steered reference z, m, and vz, m/s, of foot ``i``; ``hips`` (L, 2), m, are in the body frame.

    A fraction of the planned x is added to z. Only for machines whose feet move in three dimensions.
    """
    scale = offset = 0.0
    if steering is not None:
        scale = steering.command[LATERAL] + steering.command[TURN] * hips[i, 0] / steering.radius
        offset = steering.offset[i]
    return (
        reference.position[i, Z] + scale * reference.position[i, X] + offset,
        reference.velocity[i, Z] + scale * reference.velocity[i, X],
    )
