"""All sensors of a machine in one step, as kernels."""

from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.mechanism import (
    KINEMATICS_FIELDS,
    PLANE,
    POINT_MASS,
    Mechanism,
    compute_foot_position,
    compute_foot_velocity,
    update_kinematics,
)
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.protocol import Measurement, get_state, new_measurement
from cmacexp.sensors.channel import Sensing, read_channel
from cmacexp.typing import SCRATCH, Array, Scratch


class Observation(NamedTuple):
    """Input of the controller: the fields of :class:`Measurement`, and what the Jacobians follow from.

    Shapes and units of the former are those of a measurement.
    """

    q: Scratch
    dq: Scratch
    foot: Scratch
    velocity: Scratch
    force: Scratch
    body: Scratch
    body_rate: Scratch
    kinematics: Scratch
    """(L, 4) of planar legs, (L, 12), m and m/rad, of chains: :func:`cmacexp.models.mechanism.update_kinematics`."""
    travel: Annotated[Array | None, SCRATCH] = None
    """(3,): m and rad, as of a Measurement; the array of the plant itself where the sensors do not alter it."""


def new_observation(legs: int, axes: tuple[int, ...] = PLANE) -> Observation:
    """An observation of zeros of ``legs`` legs."""
    kinematics = np.zeros((legs, KINEMATICS_FIELDS[axes]))
    return Observation._make((*get_state(new_measurement(legs, len(axes))), kinematics, None))


@kernel
def compute_feet(
    sensing: Sensing, mechanism: Mechanism, true: Measurement | PlantState, observation: Observation
) -> None:
    """Foot and velocity that follow from measured joints; the true ones where no sensor alters a joint."""
    position, velocity = sensing.kinematics_follow
    update_kinematics(mechanism, observation.q, observation.kinematics)
    for i in range(observation.force.shape[0]):
        for j in range(len(mechanism.axes)):
            observation.foot[i, j], observation.velocity[i, j] = true.foot[i, j], true.velocity[i, j]
            if mechanism.kind == POINT_MASS:
                observation.foot[i, j], observation.velocity[i, j] = observation.q[i, j], observation.dq[i, j]
        if mechanism.kind != POINT_MASS:
            if position:
                compute_foot_position(mechanism, i, observation.kinematics, observation.foot)
            if position or velocity:
                compute_foot_velocity(mechanism, i, observation.kinematics, observation.dq, observation.velocity)


@kernel(inline=False)
def read_sensors(
    sensing: Sensing, mechanism: Mechanism, step: int, true: Measurement | PlantState, observation: Observation
) -> None:
    """Fill ``observation`` with the readings for the state ``true``; steps must follow each other from 0."""
    legs, joints = observation.force.shape[0], len(mechanism.axes)
    of_a_leg = 1 + 2 * joints  # channels: contact force, joint angles, joint velocities
    for i in range(legs):
        c = of_a_leg * i
        observation.force[i] = read_channel(sensing, c, step, true.force[i])
        for j in range(joints):
            observation.q[i, j] = read_channel(sensing, c + 1 + j, step, true.q[i, j])
            observation.dq[i, j] = read_channel(sensing, c + 1 + joints + j, step, true.dq[i, j])
    c = of_a_leg * legs
    for j in range(3):
        observation.body[j] = read_channel(sensing, c + j, step, true.body[j])
        observation.body_rate[j] = read_channel(sensing, c + 3 + j, step, true.body_rate[j])
    compute_feet(sensing, mechanism, true, observation)
