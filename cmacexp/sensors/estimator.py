"""What a robot can know of itself, as kernels: height, place, speed and contact forces from its own signals.

Signals pass channels with their imperfections; attitude and heading are those of the inertial unit. Forces follow
from the torques of the motors, less what holds the links and what changes the momentum of their joints (De Luca &
Mattone 2003); contact from the planned phase and the force; height and place from
:mod:`cmacexp.sensors.place_filter`. Only what the designer believes of robot and ground is used.
"""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import called_kernel, kernel
from cmacexp.models.chain import Turn, Vector, cross, dot, hinge_axis, kinematics_at, rotate
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism, compute_foot_position, compute_foot_velocity, update_kinematics
from cmacexp.models.sine import sine_cosine
from cmacexp.protocols import RobotSignals
from cmacexp.sensors.kernels import Observation, Sensing, read_channel, uniform
from cmacexp.sensors.place_filter import PLACE, SPEED, PlaceFilter, locate, start_filter
from cmacexp.typing import Array, Mask, Scratch, State

FULL_TRUST = 0.15
"""Force over the weight of the robot from which on a foot that should stand is trusted to stand."""
LEAST_CONTACT = 0.15
"""Force over the weight below which a foot that should be in the air is not in contact."""
OF_A_JOINT = ("position", "velocity", "torque")
"""Channels of each joint, in this order."""
VELOCITY, TORQUE = 1, 2
OF_A_BODY = ("tilt", "tilt", "heading", *["gyroscope"] * 3, *["accelerometer"] * 3)
"""Channels after those of the joints."""
TILT, HEADING, GYROSCOPE, ACCELEROMETER = 0, 2, 3, 6
"""Where those of the body begin."""
OWN = -1
"""Step from whose random number the constant error of a channel follows."""
Turns = tuple[Turn, Turn, Turn]
STILL = (0.0, 1.0)


class Errors(NamedTuple):
    """Errors of sensors that stay, or change slowly; those of one run follow from its seed."""

    encoder_offset: float
    """Largest offset of a joint angle, rad."""
    torque_gain: float
    """Largest error of a torque, over its value."""
    tilt_bias: float
    """Amplitude, of pitch and roll, rad."""
    tilt_rate: float
    """Its angular frequency, rad/s."""
    heading_drift: float
    """Rate of the error of the heading, rad/s."""
    accelerometer_bias: float
    """Largest bias of the accelerometer, m/s^2."""


class Estimator(NamedTuple):
    """Parameters and states of the estimator of a robot of L legs with three joints each."""

    period: float
    """Sampling period, s."""
    weight: float
    """Weight of the robot, N."""
    stiffness: float
    """K_n of the ground that the designer assumes, N/m."""
    radius: float
    """Radius of feet that roll, m; 0: they stick at their centres."""
    hips: Array
    """(L, 2): m, as of a Mechanism."""
    links: Array
    """(3, L, 21): m, chains whose feet are the centres of mass of hip, thigh and calf."""
    link_masses: Array
    """(3, L): of these links, kg."""
    force_share: float
    """Part of its difference from the measurement by which a force changes in a step; 1: not filtered."""
    inertia: Array
    """(L, 3, 3): of the joints at home, with their rotors, kg m^2; 0: their momentum does not count."""
    momentum: State
    """(L, 3): of the joints, through the filter of the forces, N m s."""
    errors: Errors
    places: PlaceFilter
    force: State
    """(L,): filtered contact force before the decision on contact, N."""
    torque: Scratch
    """(L, J): as measured, N m."""
    depth: Scratch
    """(L,): of the feet in the ground, m."""


class Proprioception(NamedTuple):
    """Sensors of a robot and the estimator on them, which know the true state no better than a robot does."""

    sensing: Sensing
    estimator: Estimator


@kernel
def own_constant(sensing: Sensing, c: int, largest: float) -> float:
    """The constant error of channel ``c`` of this run, at most ``largest``, of its unit."""
    return largest * (2.0 * uniform(int(sensing.keys[c, 1]), OWN) - 1.0)


@kernel
def read_joints(
    estimator: Estimator, sensing: Sensing, signals: RobotSignals, step: int, observation: Observation
) -> None:
    """Read encoders and torques of a ``step``; fills joints of ``observation`` and the torques of ``estimator``."""
    joints = signals.q.shape[1]
    for i in range(signals.q.shape[0]):
        for j in range(joints):
            c = 3 * joints * i + j
            offset = own_constant(sensing, c, estimator.errors.encoder_offset)
            observation.q[i, j] = read_channel(sensing, c, step, signals.q[i, j] + offset)
            observation.dq[i, j] = read_channel(sensing, c + joints * VELOCITY, step, signals.dq[i, j])
            c += joints * TORQUE
            gain = 1.0 + own_constant(sensing, c, estimator.errors.torque_gain)
            estimator.torque[i, j] = read_channel(sensing, c, step, gain * signals.torque[i, j])


@kernel
def read_attitude(
    errors: Errors, period: float, sensing: Sensing, signals: RobotSignals, step: int, pose: Array
) -> float:
    """The heading in a ``step``, rad; fills pitch and roll, rad, of the ``pose`` (3,)."""
    first = len(OF_A_JOINT) * signals.q.size + TILT
    for k in range(2):
        phase = math.pi * own_constant(sensing, first + k, 1.0)
        bias = errors.tilt_bias * sine_cosine(errors.tilt_rate * step * period + phase)[0]
        pose[1 + k] = read_channel(sensing, first + k, step, signals.attitude[k] + bias)
    drift = errors.heading_drift * step * period
    return read_channel(sensing, first + HEADING, step, signals.attitude[2] + drift)


@kernel
def read_vector(sensing: Sensing, first: int, step: int, values: Array, bias: float) -> Vector:
    """Three channels from ``first`` on, which read ``values`` (3,) with errors of at most ``bias``, of any unit."""
    x = read_channel(sensing, first, step, values[0] + own_constant(sensing, first, bias))
    y = read_channel(sensing, first + 1, step, values[1] + own_constant(sensing, first + 1, bias))
    z = read_channel(sensing, first + 2, step, values[2] + own_constant(sensing, first + 2, bias))
    return x, y, z


@kernel
def turn_world(attitude: Turns, vector: Vector) -> Vector:
    """``vector`` (3,), of any unit, of the body's frame in the world.

    ``attitude`` are sines and cosines of roll, pitch and yaw.
    """
    (sr, cr), (sp, cp), (sy, cy) = attitude
    x, y, z = vector
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, cp * z - sp * x
    return cy * x - sy * y, sy * x + cy * y, z


@kernel
def link_torque(estimator: Estimator, i: int, turns: Turns, up: Vector) -> Vector:
    """Torques (3,), N m, that hold the links of leg ``i`` against gravity.

    ``turns`` are sines and cosines of its joint angles; ``up`` (3,), of length 1, is in the frame of the hip.
    """
    total = (0.0, 0.0, 0.0)
    for m in range(3):
        second = turns[1] if m > 0 else STILL
        third = turns[2] if m > 1 else STILL
        at = kinematics_at(estimator.links[m, i], turns[0], second, third)
        weight = GRAVITY * estimator.link_masses[m, i]
        total = (
            total[0] + weight * dot(at.hip, up),
            total[1] + (weight * dot(at.thigh, up) if m > 0 else 0.0),
            total[2] + (weight * dot(at.calf, up) if m > 1 else 0.0),
        )
    return total


@kernel
def change_momentum(estimator: Estimator, i: int, rates: Array, begins: bool) -> Vector:
    """Torque (3,), N m, by which the momentum of leg ``i``, whose joints turn at ``rates`` (3,), rad/s, grows.

    It is filtered as forces are.
    """
    inertia, momentum = estimator.inertia[i], estimator.momentum[i]
    share = 1.0 if begins else estimator.force_share
    x, y, z = momentum[0], momentum[1], momentum[2]
    for j in range(3):
        now = inertia[j, 0] * rates[0] + inertia[j, 1] * rates[1] + inertia[j, 2] * rates[2]
        momentum[j] += share * (now - momentum[j])
    if begins:
        return 0.0, 0.0, 0.0
    period = estimator.period
    return (momentum[0] - x) / period, (momentum[1] - y) / period, (momentum[2] - z) / period


@kernel
def press_down(kinematics: Array, i: int, torque: Vector, up: Vector) -> float:
    """Force down of foot ``i`` on the ground, N, by ``torque`` (3,), N m: J^-T tau.

    ``kinematics`` (L, 12) has foot and Jacobian, m and m/rad; ``up`` (3,) is as of :func:`link_torque`.
    """
    row = kinematics[i]
    hip, thigh, calf = (row[3], row[4], row[5]), (row[6], row[7], row[8]), (row[9], row[10], row[11])
    across = cross(thigh, calf)
    lever = (
        torque[0] * dot(across, up) + torque[1] * dot(cross(calf, hip), up) + torque[2] * dot(cross(hip, thigh), up)
    )
    return -lever / dot(hip, across)


@kernel
def estimate_leg(
    estimator: Estimator,
    mechanism: Mechanism,
    i: int,
    stands: bool,
    begins: bool,
    attitude: Turns,
    spin: Vector,
    observation: Observation,
) -> None:
    """Force, place and velocity of foot ``i``, which by the plan ``stands`` or not; fills all of ``estimator``.

    ``attitude`` are sines and cosines of roll, pitch and yaw; ``spin`` (3,) is the angular velocity of the body along
    its own axes, rad/s. Fills the force of ``observation``, N, whose joints and feet are those of this step.
    """
    q, dq = observation.q[i], observation.dq[i]
    turns = (sine_cosine(q[0]), sine_cosine(q[1]), sine_cosine(q[2]))
    (sr, cr), (sp, cp), _ = attitude
    up = (-sp, cp * sr, cp * cr)
    up_of_hip = (up[0], -up[2], up[1])
    held = link_torque(estimator, i, turns, up_of_hip)
    torque = estimator.torque[i]
    left = (torque[0] - held[0], torque[1] - held[1], torque[2] - held[2])
    down = press_down(observation.kinematics, i, left, up_of_hip)
    if begins:
        estimator.force[i] = down
    estimator.force[i] += estimator.force_share * (down - estimator.force[i])
    grows = change_momentum(estimator, i, dq, begins)
    force = max(estimator.force[i] - press_down(observation.kinematics, i, grows, up_of_hip), 0.0)
    if not stands and force < LEAST_CONTACT * estimator.weight:
        force = 0.0
    observation.force[i] = force
    estimator.depth[i] = force / estimator.stiffness
    places = estimator.places
    places.trust[i] = min(1.0, force / (FULL_TRUST * estimator.weight)) if stands else 0.0
    foot, velocity = observation.foot[i], observation.velocity[i]
    place = (estimator.hips[i, 0] + foot[0], estimator.hips[i, 1] + foot[2], -foot[1])
    moved = cross(spin, place)
    passing = (velocity[0] + moved[0], velocity[2] + moved[1], moved[2] - velocity[1])
    places.passing[i, 0], places.passing[i, 1], places.passing[i, 2] = turn_world(attitude, passing)
    if estimator.radius > 0.0:
        r = estimator.radius
        rolling = cross(turn_of_calf(mechanism, i, turns, dq, spin), (r * up[0], r * up[1], r * up[2]))
        places.rolling[i, 0], places.rolling[i, 1], places.rolling[i, 2] = turn_world(attitude, rolling)
    places.reach[i, 0], places.reach[i, 1], places.reach[i, 2] = turn_world(attitude, place)


@kernel
def turn_of_calf(mechanism: Mechanism, i: int, turns: Turns, dq: Array, spin: Vector) -> Vector:
    """Angular velocity (3,), rad/s, of calf ``i`` in the frame of the body, which turns with ``spin`` (3,), rad/s.

    Its joints turn at ``dq`` (3,), rad/s.
    """
    if mechanism.chains is None:
        return spin
    chain = mechanism.chains[i]
    first = hinge_axis(chain, 0)
    second = rotate(hinge_axis(chain, 1), first, turns[0][0], turns[0][1])
    third = rotate(hinge_axis(chain, 2), hinge_axis(chain, 1), turns[1][0], turns[1][1])
    third = rotate(third, first, turns[0][0], turns[0][1])
    x = first[0] * dq[0] + second[0] * dq[1] + third[0] * dq[2]
    y = first[1] * dq[0] + second[1] * dq[1] + third[1] * dq[2]
    z = first[2] * dq[0] + second[2] * dq[1] + third[2] * dq[2]
    return spin[0] + x, spin[1] + z, spin[2] - y


@called_kernel
def estimate(
    estimator: Estimator,
    sensing: Sensing,
    mechanism: Mechanism,
    signals: RobotSignals,
    step: int,
    support: Mask,
    observation: Observation,
) -> None:
    """Fill ``observation`` with what the ``signals`` of a ``step`` say; steps must follow each other from 0.

    ``support`` (L,) are the feet that the plan has on the ground.
    """
    read_joints(estimator, sensing, signals, step, observation)
    pose, rate = observation.body, observation.body_rate
    heading = read_attitude(estimator.errors, estimator.period, sensing, signals, step, pose)
    first = len(OF_A_JOINT) * signals.q.size
    spin = read_vector(sensing, first + GYROSCOPE, step, signals.gyroscope, 0.0)
    pushed = read_vector(
        sensing, first + ACCELEROMETER, step, signals.accelerometer, estimator.errors.accelerometer_bias
    )
    attitude = (sine_cosine(pose[2]), sine_cosine(pose[1]), sine_cosine(heading))
    (sr, cr), (sp, cp), _ = attitude
    update_kinematics(mechanism, observation.q, observation.kinematics)
    for i in range(support.shape[0]):
        compute_foot_position(mechanism, i, observation.kinematics, observation.foot)
        compute_foot_velocity(mechanism, i, observation.kinematics, observation.dq, observation.velocity)
        estimate_leg(
            estimator,
            mechanism,
            i,
            stands=support[i],
            begins=step == 0,
            attitude=attitude,
            spin=spin,
            observation=observation,
        )
    places = estimator.places
    if step == 0:
        start_filter(places)
    x, y, z = turn_world(attitude, pushed)
    locate(places, estimator.period, (x, y, z - GRAVITY), estimator.depth)
    pose[0] = places.state[2, PLACE]
    rate[0] = places.state[2, SPEED]
    rate[1] = spin[1] * cr - spin[2] * sr
    rate[2] = spin[0] + (spin[1] * sr + spin[2] * cr) * sp / cp
    set_travel(observation.travel, places.state[0, PLACE], places.state[1, PLACE], heading)


@kernel
def set_travel(travel: Array | None, x: float, y: float, heading: float) -> None:
    """Fill ``travel`` (3,) with a place, m, and a heading, rad."""
    if travel is not None:
        travel[0], travel[1], travel[2] = x, y, heading
