"""A robot keeps its course: supporting feet walk along a stroke that turns the body back and moves it aside.

After a push, feet touch down where they catch the body.

A body that moves with (v + dv, v_y) and turns with w moves its supporting feet by -(v + dv) + w y_hip along x and by
-v_y - w x_hip along z. The planned x of a foot falls by v: scaled, it is the path of all of these, in transfer too.
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

MOST, MOST_STATIC = 0.1, 0.02
"""Largest command, over the planned speed; a statically stable gait has margins of some millimetres."""
PUSHED = 0.2
"""Speed aside from which on feet are placed, m/s: where they always are, walks sway, and learning fails."""
EASE = 0.03
"""Time in which a foot takes to another place, s."""
LONGITUDINAL, LATERAL, TURN = range(3)
"""Parts of the command: dv / v, v_y / v, and the arc of the farthest hip, w r / v."""


class Steering(NamedTuple):
    """Feedback of place and heading."""

    course_gain: float
    """Speed towards the planned place over the distance from it, 1/s."""
    heading_gain: float
    """Rate towards the planned heading over the angle from it, 1/s."""
    speed: float
    """Planned, v, m/s."""
    period: float
    """Sampling period, s."""
    radius: float
    """Distance r of the farthest hip from the body's centre, m."""
    sway: Array
    """(N, 2): planned place of the body beside its constant speed, m."""
    most: float
    command: Scratch
    """(3,): LONGITUDINAL, LATERAL and TURN, without a unit."""
    capture: float
    """How far aside feet touch down over the speed aside, s; 0: as planned."""
    farthest: float
    """How far aside they do at most, m."""
    lateral: Scratch
    """(1,): distance of the body from its course in the step before, m."""
    offset: Scratch
    """(L,): of every foot from its planned place, to the left, m."""


def new_steering(setup: Setup) -> Steering | None:
    """Steering of a robot; None where nothing is steered."""
    config = setup.config
    hips = setup.mechanism.hips
    place = setup.plan.sway.position
    posture, speed = config.posture, config.body_speed
    gains = posture.course_gain, posture.heading_gain
    if not isinstance(config.machine, RobotMachine) or speed == 0.0 or not any(gains):
        return None
    place = np.ascontiguousarray(place - place[0])  # the body starts at its place of the first sample
    dynamic = PATTERNS[config.gait.pattern].is_dynamic
    height = setup.mechanism.hip_height
    radius = np.hypot(*hips.T)
    # The body passes its foot for half the support, and falls like an inverted pendulum (Raibert 1986; Pratt 2006).
    capture = config.gait.duty_factor * config.gait.cycle_time / 2.0 + math.sqrt(height / GRAVITY) if dynamic else 0.0
    return Steering(
        course_gain=posture.course_gain,
        heading_gain=posture.heading_gain,
        speed=speed,
        period=config.sampling_period,
        radius=float(radius.max()),
        sway=place,
        most=MOST if dynamic else MOST_STATIC,
        command=np.zeros(3),
        capture=capture,
        farthest=height,
        lateral=np.zeros(1),
        offset=np.zeros(len(hips)),
    )


@kernel
def place_feet(steering: Steering, support: Mask, lateral: float) -> None:
    """Feet not in ``support`` (L,) go to where they catch a body that leaves its course, ``lateral`` m from it."""
    rate, share = (lateral - steering.lateral[0]) / steering.period, min(1.0, steering.period / EASE)
    place = min(max(steering.capture * rate, -steering.farthest), steering.farthest) if abs(rate) > PUSHED else 0.0
    steering.lateral[0] = lateral
    for i in range(support.shape[0]):
        if not support[i]:
            steering.offset[i] += share * (place - steering.offset[i])


@kernel
def steer(steering: Steering | None, travel: Array | None, step: int, sample: int, support: Mask) -> None:
    """Set the command and the places of feet of a ``step``, the ``sample`` of its cycle.

    The body is at ``travel`` (3,): x, y (m) and heading (rad).
    """
    if steering is not None and travel is not None:
        command = steering.command
        gain = steering.course_gain
        speed = steering.speed
        longitudinal = step * steering.period * speed + steering.sway[sample, 0] - travel[0]
        command[LONGITUDINAL] = gain * longitudinal / speed
        lateral = travel[1] - steering.sway[sample, 1]
        place_feet(steering, support, lateral)
        command[LATERAL] = -gain * lateral / speed
        command[TURN] = -steering.heading_gain * travel[2] * steering.radius / speed
        for n in range(3):
            command[n] = min(max(command[n], -steering.most), steering.most)


@kernel
def steer_longitudinal(
    steering: Steering | None, hips: Array, i: int, reference: ControlReference
) -> tuple[float, float]:
    """x, m, and vx, m/s, of foot ``i`` in the ``reference`` of a step; ``hips`` (L, 2), m."""
    scale = 1.0
    if steering is not None:
        scale = 1.0 + steering.command[LONGITUDINAL] - steering.command[TURN] * hips[i, 1] / steering.radius
    return scale * reference.position[i, X], scale * reference.velocity[i, X]


@kernel
def steer_lateral(steering: Steering | None, hips: Array, i: int, reference: ControlReference) -> tuple[float, float]:
    """z, m, and vz, m/s, of foot ``i`` likewise, where feet move in space; ``hips`` (L, 2), m.

    A share of the planned x is added to z.
    """
    scale = offset = 0.0
    if steering is not None:
        scale = steering.command[LATERAL] + steering.command[TURN] * hips[i, 0] / steering.radius
        offset = steering.offset[i]
    return (
        reference.position[i, Z] + scale * reference.position[i, X] + offset,
        reference.velocity[i, Z] + scale * reference.velocity[i, X],
    )
