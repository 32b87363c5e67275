"""Kernels of imperfect sensors: the reading of one channel, and all readings of a machine in one step."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
from cmacexp.models.mix import MASK, mix
from cmacexp.plants.kernels import PlantState
from cmacexp.protocols import Measurement, get_state, new_measurement
from cmacexp.typing import SCRATCH, Array, Counts, Role, Scratch, State

NO_FAULT, ZERO, LAST, VALUE, BIAS, NOISE = range(6)
FAULTS = {"none": NO_FAULT, "zero": ZERO, "last": LAST, "value": VALUE, "bias": BIAS, "noise": NOISE}
WITHOUT_VALUE = ("none", "zero", "last")
"""Kinds of fault without a value."""
SUMMED = 12
"""Number of uniform 16-bit numbers summed to one approximately normal number; their variances sum to 1."""

CHANNEL = np.dtype(
    [
        ("alters", np.bool_),  # False: the reading is the true value
        ("start", np.int64),  # first step in which the imperfections act
        ("noise", np.float64),  # standard deviation of added white noise
        ("noise_relative", np.float64),  # standard deviation relative to the value
        ("bias", np.float64),
        ("quantum", np.float64),  # quantisation step; 0: none
        ("delay", np.int64),  # samples
        ("lag", np.float64),  # filter gain: fraction of (input - output) added per step; 0: no filter
        ("dropout", np.float64),  # probability that a sample is lost
        ("drops_to_zero", np.bool_),  # a lost sample reads 0 instead of the last valid reading
        ("fault", np.int64),  # one of FAULTS
        ("fault_start", np.int64),  # first step of the fault
        ("fault_value", np.float64),  # stuck reading, bias, or standard deviation of the noise
    ],
    align=True,
)
"""Imperfections and fault of one channel, in the unit of its signal."""
Channels = NDArray[np.void]
"""Array (C,) of CHANNEL rows."""


class Sensing(NamedTuple):
    """Parameters and states of the C sensor channels of a machine."""

    kinematics_follow: tuple[bool, bool]
    """True if joint angles, and if joint velocities, are altered: the foot is then computed from the readings."""
    channels: Channels
    """(C,): imperfections and faults."""
    keys: Counts
    """(C, 3): integer seeds of noise, drop-out and fault."""
    delay_buffer: Annotated[Array, Role("state", ring_axis=1)]
    """(C, longest delay + 1): true values of the last steps, in the unit of each signal."""
    held: State
    """(C, 3): last valid reading, reading at the start of the fault, filter output, in the unit of each signal."""


# Counter-based random numbers give the same noise in every process, in any order, compiled or not.


@kernel
def uniform(key: int, step: int) -> float:
    """Return a pseudo-random number from 0 to 1, determined by the seed ``key`` and the ``step``."""
    return mix(mix(mix(key, step), step), 1) / MASK


@kernel
def normal(key: int, step: int) -> float:
    """Return a pseudo-random, nearly normal number of mean 0 and variance 1, determined by seed ``key`` and ``step``.

    It is the sum of twelve uniform numbers and stays within 6 standard deviations. A logarithm is avoided, because
    its last bit differs between platforms.
    """
    state = mix(mix(key, step), step)
    total = 0
    for _ in range(SUMMED // 2):
        state = mix(state, 1)
        total += (state & 0xFFFF) + (state >> 16)
    return (total - SUMMED * 0x7FFF - SUMMED // 2) / 65536.0


@kernel
def imperfect_reading(sensing: Sensing, c: int, step: int) -> float:
    """Compute the reading of channel ``c`` in ``step`` without its fault, in the unit of the signal.

    Delay, noise, bias, quantisation, lag and drop-out act in this order.
    """
    channel = sensing.channels[c]
    delayed = max(step - channel["delay"], 0)  # before the first step the machine was at rest
    value = sensing.delay_buffer[c, delayed % sensing.delay_buffer.shape[1]]
    if channel["noise"] != 0.0 or channel["noise_relative"] != 0.0:
        scale = channel["noise"] + channel["noise_relative"] * abs(value)
        value += scale * normal(int(sensing.keys[c, 0]), step)
    value += channel["bias"]
    if channel["quantum"] != 0.0:
        value = channel["quantum"] * math.floor(value / channel["quantum"] + 0.5)
    if channel["lag"] != 0.0:
        sensing.held[c, 2] += channel["lag"] * (value - sensing.held[c, 2])
        value = sensing.held[c, 2]
    if channel["dropout"] != 0.0 and step > 0 and uniform(int(sensing.keys[c, 1]), step) < channel["dropout"]:
        return 0.0 if channel["drops_to_zero"] else sensing.held[c, 0]
    return value


@kernel
def faulty_reading(kind: int, amount: float, value: float, last: float, key: int, step: int) -> float:
    """Compute the reading of a channel with a fault in ``step``, in the unit of the signal.

    ``kind`` is one of FAULTS and ``amount`` its ``fault_value``; ``value`` is the reading without the fault, ``last``
    the reading at the start of the fault, ``key`` the seed of its noise.
    """
    if kind == ZERO:
        return 0.0
    if kind == LAST:
        return last
    if kind == VALUE:
        return amount
    if kind == BIAS:
        return value + amount
    return value + amount * normal(key, step)


@kernel
def read_channel(sensing: Sensing, c: int, step: int, true: float) -> float:
    """Return the reading of channel ``c`` in ``step`` for the true value ``true``, in its unit.

    Call it once per step, with steps counted from 0.
    """
    channel = sensing.channels[c]
    if not channel["alters"]:
        return true
    sensing.delay_buffer[c, step % sensing.delay_buffer.shape[1]] = true
    if step == 0 or step < channel["start"]:
        sensing.held[c, 2] = true
    value = imperfect_reading(sensing, c, step) if step >= channel["start"] else true
    sensing.held[c, 0] = value
    if channel["fault"] == NO_FAULT or step < channel["fault_start"]:
        return value
    if step == channel["fault_start"]:
        sensing.held[c, 1] = value
    last = sensing.held[c, 1]
    return faulty_reading(channel["fault"], channel["fault_value"], value, last, int(sensing.keys[c, 2]), step)


class Observation(NamedTuple):
    """Input of the controller: the measured state and the kinematic terms of the legs.

    Fields without a description have the shape and unit of those of :class:`cmacexp.protocols.Measurement`.
    """

    q: Scratch
    dq: Scratch
    foot: Scratch
    velocity: Scratch
    force: Scratch
    body: Scratch
    body_rate: Scratch
    kinematics: Scratch
    """(L, 4) for planar legs, (L, 12) for chains, m and m/rad: foot and Jacobian terms, see
    :func:`cmacexp.models.mechanism.update_kinematics`."""
    travel: Annotated[Array | None, SCRATCH] = None
    """(3,): position, m, and yaw, rad, in the world; the array of the plant itself if the sensors do not alter it."""


def new_observation(legs: int, axes: tuple[int, ...] = PLANE) -> Observation:
    """Make an observation of zeros for ``legs`` legs whose feet move along ``axes``, without travel."""
    kinematics = np.zeros((legs, KINEMATICS_FIELDS[axes]))
    return Observation._make((*get_state(new_measurement(legs, len(axes))), kinematics, None))


@kernel
def compute_feet(
    sensing: Sensing, mechanism: Mechanism, true: Measurement | PlantState, observation: Observation
) -> None:
    """Fill foot position and velocity of ``observation``, in m and m/s, from its joint angles and velocities.

    They are copied from the state ``true`` where no sensor alters the joints. For a point mass they are the readings
    of its position and velocity.
    """
    position, velocity = sensing.kinematics_follow
    update_kinematics(mechanism, observation.q, observation.kinematics)
    for i in range(observation.force.shape[0]):
        for j in range(len(mechanism.axes)):
            is_point = mechanism.kind == POINT_MASS
            observation.foot[i, j] = observation.q[i, j] if is_point else true.foot[i, j]
            observation.velocity[i, j] = observation.dq[i, j] if is_point else true.velocity[i, j]
        if mechanism.kind != POINT_MASS:
            if position:
                compute_foot_position(mechanism, i, observation.kinematics, observation.foot)
            if position or velocity:
                compute_foot_velocity(mechanism, i, observation.kinematics, observation.dq, observation.velocity)


@kernel
def read_sensors(
    sensing: Sensing, mechanism: Mechanism, step: int, true: Measurement | PlantState, observation: Observation
) -> None:
    """Fill ``observation`` with the readings of the state ``true`` in ``step``.

    Call it once per step, with steps counted from 0.
    """
    legs = observation.force.shape[0]
    joints = len(mechanism.axes)
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
