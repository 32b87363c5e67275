"""All sensors of a machine in one step, as kernels."""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel, kernel_apart
from cmacexp.models.leg import foot_position, foot_velocity
from cmacexp.models.mechanism import POINT_MASS, Mechanism, get_leg, get_trig, trigonometries
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.protocol import Measurement, get_state, new_measurement
from cmacexp.sensors.channel import Sensing, read_channel
from cmacexp.typing import Scratch

OF_A_LEG = 5
"""Channels of each leg: contact force, two joint angles, two joint velocities."""
OF_A_BODY = 6
"""Channels of the body, after those of the legs: height, pitch, roll, and their rates."""


class Observation(NamedTuple):
    """Input of the controller: the fields of :class:`Measurement`, and the trigonometry of the joint angles."""

    q: Scratch
    dq: Scratch
    foot: Scratch
    velocity: Scratch
    force: Scratch
    body: Scratch
    body_rate: Scratch
    trig: Scratch
    """(L, 4): sines and cosines of the joint angles."""


def new_observation(legs: int) -> Observation:
    """An observation of zeros of ``legs`` legs."""
    return Observation._make((*get_state(new_measurement(legs)), np.zeros((legs, 4))))


@kernel
def compute_feet(
    sensing: Sensing, mechanism: Mechanism, true: Measurement | PlantState, observation: Observation
) -> None:
    """Foot and velocity that follow from measured joints; the true ones where no sensor alters a joint."""
    position, velocity = sensing.kinematics
    trigonometries(mechanism, observation.q, observation.trig)
    for i in range(observation.force.shape[0]):
        for j in range(2):
            observation.foot[i, j], observation.velocity[i, j] = true.foot[i, j], true.velocity[i, j]
            if mechanism.kind == POINT_MASS:
                observation.foot[i, j], observation.velocity[i, j] = observation.q[i, j], observation.dq[i, j]
        if mechanism.kind != POINT_MASS:
            leg, trig = get_leg(mechanism, i), get_trig(observation.trig, i)
            if position:
                observation.foot[i, 0], observation.foot[i, 1] = foot_position(leg, trig)
            if position or velocity:
                observation.velocity[i, 0], observation.velocity[i, 1] = foot_velocity(
                    leg, trig, observation.dq[i, 0], observation.dq[i, 1]
                )


@kernel_apart
def read_sensors(
    sensing: Sensing, mechanism: Mechanism, step: int, true: Measurement | PlantState, observation: Observation
) -> None:
    """Fill ``observation`` with the readings for the state ``true``; steps must follow each other from 0."""
    legs = observation.force.shape[0]
    for i in range(legs):
        c = OF_A_LEG * i
        observation.force[i] = read_channel(sensing, c, step, true.force[i])
        for j in range(2):
            observation.q[i, j] = read_channel(sensing, c + 1 + j, step, true.q[i, j])
            observation.dq[i, j] = read_channel(sensing, c + 3 + j, step, true.dq[i, j])
    for j in range(3):
        observation.body[j] = read_channel(sensing, OF_A_LEG * legs + j, step, true.body[j])
        observation.body_rate[j] = read_channel(sensing, OF_A_LEG * legs + 3 + j, step, true.body_rate[j])
    compute_feet(sensing, mechanism, true, observation)
