"""All sensors of a machine in one step, as a compiled kernel."""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel, kernel_apart
from cmacexp.models.leg import foot_position, foot_velocity
from cmacexp.models.mechanism import POINT_MASS, Mechanism, leg_of, trig_of, trigonometries
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.channel import CHANNEL, Sensing, read_channel
from cmacexp.typing import Scratch

OF_A_LEG = 5
"""Channels of each leg: contact force, two joint angles, two joint velocities."""
OF_A_BODY = 6
"""Channels of the body, after those of the legs: height, pitch, roll, and their rates."""


class Seen(NamedTuple):
    """What the controller sees, in the fields of :class:`Measurement`; then what follows from the joint angles."""

    q: Scratch
    dq: Scratch
    foot: Scratch
    velocity: Scratch
    force: Scratch
    body: Scratch
    body_rate: Scratch
    trig: Scratch
    """(L, 4): sines and cosines of the joint angles."""


def new_seen(legs: int) -> Seen:
    """Room for what is seen of ``legs`` legs."""
    q, dq, foot, velocity = (np.zeros((legs, 2)) for _ in range(4))
    return Seen(q, dq, foot, velocity, np.zeros(legs), np.zeros(3), np.zeros(3), np.zeros((legs, 4)))


def no_sensing() -> Sensing:
    """Of sensors that alter nothing."""
    return Sensing(
        False,
        (False, False),
        np.zeros(0, CHANNEL),
        np.zeros((0, 3), dtype=np.int64),
        np.zeros((0, 1)),
        np.zeros((0, 2)),
    )


@kernel
def see_feet(sensing: Sensing, mechanism: Mechanism, true: Measurement | PlantState, seen: Seen) -> None:
    """Foot and velocity as they follow from measured joints; the true ones where no joint sensor alters anything."""
    position, velocity = sensing.kinematics
    trigonometries(mechanism, seen.q, seen.trig)
    for i in range(seen.force.shape[0]):
        for j in range(2):
            seen.foot[i, j], seen.velocity[i, j] = true.foot[i, j], true.velocity[i, j]
            if mechanism.kind == POINT_MASS:
                seen.foot[i, j], seen.velocity[i, j] = seen.q[i, j], seen.dq[i, j]
        if mechanism.kind != POINT_MASS:
            leg, trig = leg_of(mechanism, i), trig_of(seen.trig, i)
            if position:
                seen.foot[i, 0], seen.foot[i, 1] = foot_position(leg, trig)
            if position or velocity:
                seen.velocity[i, 0], seen.velocity[i, 1] = foot_velocity(leg, trig, seen.dq[i, 0], seen.dq[i, 1])


@kernel_apart
def sense(sensing: Sensing, mechanism: Mechanism, step: int, true: Measurement | PlantState, seen: Seen) -> None:
    """Fill ``seen`` with what the sensors tell of ``true``; steps come one after the other, from 0."""
    legs = seen.force.shape[0]
    for i in range(legs):
        c = OF_A_LEG * i
        seen.force[i] = read_channel(sensing, c, step, true.force[i])
        for j in range(2):
            seen.q[i, j] = read_channel(sensing, c + 1 + j, step, true.q[i, j])
            seen.dq[i, j] = read_channel(sensing, c + 3 + j, step, true.dq[i, j])
    for j in range(3):
        seen.body[j] = read_channel(sensing, OF_A_LEG * legs + j, step, true.body[j])
        seen.body_rate[j] = read_channel(sensing, OF_A_LEG * legs + 3 + j, step, true.body_rate[j])
    see_feet(sensing, mechanism, true, seen)
