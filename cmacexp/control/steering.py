"""A robot keeps its course: supporting feet walk along a stroke that turns the body back and moves it aside.

A body that moves with (v + dv, v_y) and turns with w moves its supporting feet by -(v + dv) + w y_hip along x and by
-v_y - w x_hip along z. The planned x of a foot falls by v: scaled, it is the path of all of these, in transfer too.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.config.gait import PATTERNS
from cmacexp.config.machine import RobotMachine
from cmacexp.jit.compiler import kernel
from cmacexp.planning.setup import Setup
from cmacexp.typing import Array, Scratch

MOST, MOST_STATIC = 0.1, 0.02
"""Largest command, over the planned speed; a statically stable gait has margins of some millimetres."""
AHEAD, ASIDE, TURN = range(3)
"""Of the command: dv / v, v_y / v, and the arc of the farthest hip, w r / v."""


class Steering(NamedTuple):
    """Feedback of place and heading."""

    course_gain: float
    """Speed towards the planned place over the distance from it, 1/s."""
    heading_gain: float
    """Rate towards the planned heading over the angle from it, 1/s."""
    speed: float
    """Planned, v, m/s."""
    period: float
    """Of sampling, s."""
    radius: float
    """Distance r of the farthest hip from the body's centre, m."""
    sway: Array
    """(N, 2): planned place of the body beside its constant speed, m."""
    most: float
    """Largest command."""
    command: Scratch
    """(3,)"""


def new_steering(setup: Setup) -> Steering | None:
    """Steering of a robot; None where nothing is steered."""
    config, hips, place = setup.config, setup.mechanism.hips, setup.plan.sway.place
    posture, speed = config.posture, config.body_speed
    gains = posture.course_gain, posture.heading_gain
    if not isinstance(config.machine, RobotMachine) or speed == 0.0 or not any(gains):
        return None
    place = np.ascontiguousarray(place - place[0])  # the body starts at its place of the first sample
    most, radius = MOST if PATTERNS[config.gait.pattern].is_dynamic else MOST_STATIC, float(np.hypot(*hips.T).max())
    return Steering(*gains, speed, config.sampling_period, radius, place, most, np.zeros(3))


@kernel
def steer(steering: Steering | None, travel: Array | None, step: int, sample: int) -> None:
    """Set the command of a ``step``, the ``sample`` of its cycle.

    The body is at ``travel`` (3,): x, y (m) and heading (rad).
    """
    if steering is not None and travel is not None:
        command, gain, speed = steering.command, steering.course_gain, steering.speed
        ahead = step * steering.period * speed + steering.sway[sample, 0] - travel[0]
        command[AHEAD] = gain * ahead / speed
        command[ASIDE] = gain * (steering.sway[sample, 1] - travel[1]) / speed
        command[TURN] = -steering.heading_gain * travel[2] * steering.radius / speed
        for n in range(3):
            command[n] = min(max(command[n], -steering.most), steering.most)


@kernel
def scale_ahead(steering: Steering | None, hips: Array, i: int) -> float:
    """What the planned x of foot ``i`` is multiplied by."""
    if steering is None:
        return 1.0
    return 1.0 + steering.command[AHEAD] - steering.command[TURN] * hips[i, 1] / steering.radius


@kernel
def scale_aside(steering: Steering | None, hips: Array, i: int) -> float:
    """Part of its planned x that is added to its planned z."""
    if steering is None:
        return 0.0
    return steering.command[ASIDE] + steering.command[TURN] * hips[i, 0] / steering.radius
