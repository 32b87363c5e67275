"""Kernels of the state estimator of a robot: height, position, velocity and contact forces from onboard signals.

Every signal passes a channel with its imperfections; attitude and heading are read from the inertial unit. Contact
forces are computed from the motor torques, minus those that hold the links against gravity and those that change the
momentum of the joints (De Luca & Mattone 2003). Contact is decided by planned phase and force; height and position
come from :mod:`cmacexp.sensors.place_filter`. The estimator uses nominal parameters of robot and ground only.
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
from cmacexp.sensors.place_filter import POSITION, SPEED, PlaceFilter, start_filter, step_filters
from cmacexp.typing import Array, Mask, Scratch, State

FULL_TRUST = 0.15
"""Contact force, relative to the robot weight, above which a foot planned in support is fully trusted to stand."""
LEAST_CONTACT = 0.15
"""Contact force, relative to the robot weight, below which a foot planned in transfer is not in contact."""
JOINT_CHANNELS = ("position", "velocity", "torque")
"""Channels of each joint, in this order."""
VELOCITY, TORQUE = (JOINT_CHANNELS.index(name) for name in ("velocity", "torque"))
BODY_CHANNELS = ("tilt", "tilt", "heading", *["gyroscope"] * 3, *["accelerometer"] * 3)
"""Channels of the inertial unit, after those of all joints."""
TILT, HEADING, GYROSCOPE, ACCELEROMETER = map(BODY_CHANNELS.index, ("tilt", "heading", "gyroscope", "accelerometer"))
"""First channel of each signal of the inertial unit."""
BEFORE_START = -1
"""Step whose random number determines the constant error of a channel."""
Turns = tuple[Turn, Turn, Turn]
"""Sines and cosines of three angles."""
STILL = (0.0, 1.0)
"""Sine and cosine of the angle 0."""


class Errors(NamedTuple):
    """Amplitudes of constant and slow sensor errors; the seed of a run determines their values."""

    encoder_offset: float
    """Largest offset of a joint angle, rad."""
    torque_gain: float
    """Largest relative error of a torque."""
    tilt_bias: float
    """Amplitude of the slow error of pitch and roll, rad."""
    tilt_rate: float
    """Angular frequency of that error, rad/s."""
    heading_drift: float
    """Drift rate of the heading, rad/s."""
    accelerometer_bias: float
    """Largest bias of the accelerometer, m/s^2."""


class Estimator(NamedTuple):
    """Parameters and states of the estimator of a robot of L legs with three joints each."""

    period: float
    """Sampling period, s."""
    weight: float
    """Weight of the robot, N."""
    stiffness: float
    """Nominal ground stiffness K_n, N/m."""
    radius: float
    """Radius of spherical feet that roll, m; 0: feet stick at their centres."""
    hips: Array
    """(L, 2): hip positions in the body frame, x forward and y left, m."""
    links: Array
    """(3, L, 21): chains that end at the centres of mass of hip, thigh and calf, m."""
    link_masses: Array
    """(3, L): masses of hip, thigh and calf, kg."""
    force_share: float
    """Gain of the force filter: fraction of (measured - filtered) added per step; 1: not filtered."""
    inertia: Array
    """(L, 3, 3): joint inertia in the home pose, with rotors, kg m^2; 0: the momentum is neglected."""
    momentum: State
    """(L, 3): joint momentum after the force filter, N m s."""
    errors: Errors
    places: PlaceFilter
    force: State
    """(L,): filtered contact force before the contact decision, N."""
    torque: Scratch
    """(L, J): measured motor torque, N m."""
    depth: Scratch
    """(L,): depth of the feet in the ground, m."""


class Proprioception(NamedTuple):
    """Onboard sensors of a robot and the state estimator that uses their readings."""

    sensing: Sensing
    estimator: Estimator


@kernel
def constant_error(sensing: Sensing, c: int, largest: float) -> float:
    """Return the constant error of channel ``c`` in this run: between -``largest`` and ``largest``, in its unit."""
    return largest * (2.0 * uniform(int(sensing.keys[c, 1]), BEFORE_START) - 1.0)


@kernel
def read_joints(
    estimator: Estimator, sensing: Sensing, signals: RobotSignals, step: int, observation: Observation
) -> None:
    """Read joint angles and velocities into ``observation``, motor torques into ``estimator``, in a ``step``."""
    joints = signals.q.shape[1]
    for i in range(signals.q.shape[0]):
        for j in range(joints):
            c = 3 * joints * i + j
            offset = constant_error(sensing, c, estimator.errors.encoder_offset)
            observation.q[i, j] = read_channel(sensing, c, step, signals.q[i, j] + offset)
            observation.dq[i, j] = read_channel(sensing, c + joints * VELOCITY, step, signals.dq[i, j])
            c += joints * TORQUE
            gain = 1.0 + constant_error(sensing, c, estimator.errors.torque_gain)
            estimator.torque[i, j] = read_channel(sensing, c, step, gain * signals.torque[i, j])


@kernel
def read_attitude(
    errors: Errors, period: float, sensing: Sensing, signals: RobotSignals, step: int, pose: Array
) -> float:
    """Read the inertial unit in a ``step``: fill pitch and roll of the ``pose`` (3,), return the heading; all rad.

    ``period`` is the sampling period, s.
    """
    first = len(JOINT_CHANNELS) * signals.q.size + TILT
    for k in range(2):
        phase = math.pi * constant_error(sensing, first + k, 1.0)
        bias = errors.tilt_bias * sine_cosine(errors.tilt_rate * step * period + phase)[0]
        pose[1 + k] = read_channel(sensing, first + k, step, signals.attitude[k] + bias)
    heading = signals.attitude[2] + errors.heading_drift * step * period
    return read_channel(sensing, first + HEADING, step, heading)


@kernel
def read_vector(sensing: Sensing, first: int, step: int, values: Array, bias: float) -> Vector:
    """Read the vector ``values`` (3,), in any unit, by three channels from ``first`` on.

    Each has a constant error of at most ``bias``, in the same unit.
    """
    return (
        read_channel(sensing, first, step, values[0] + constant_error(sensing, first, bias)),
        read_channel(sensing, first + 1, step, values[1] + constant_error(sensing, first + 1, bias)),
        read_channel(sensing, first + 2, step, values[2] + constant_error(sensing, first + 2, bias)),
    )


@kernel
def rotate_to_world(attitude: Turns, vector: Vector) -> Vector:
    """Rotate a ``vector`` (3,), in any unit, from the body frame to the world frame.

    ``attitude`` holds sine and cosine of roll, pitch and yaw.
    """
    (sr, cr), (sp, cp), (sy, cy) = attitude
    x, y, z = vector
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, cp * z - sp * x
    return cy * x - sy * y, sy * x + cy * y, z


@kernel
def compute_link_torque(estimator: Estimator, i: int, turns: Turns, up: Vector) -> Vector:
    """Compute the joint torques (3,), N m, that hold the links of leg ``i`` against gravity.

    ``turns`` holds sine and cosine of its joint angles; ``up`` (3,) is the unit vector upwards, in the hip frame.
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
def compute_momentum_torque(estimator: Estimator, i: int, rates: Array, begins: bool) -> Vector:
    """Compute the torque (3,), N m, that changes the joint momentum of leg ``i``: its filtered time derivative.

    The joints turn at ``rates`` (3,), rad/s. The filter is that of the forces; ``begins`` is True in the first step,
    which starts it.
    """
    inertia = estimator.inertia[i]
    momentum = estimator.momentum[i]
    share = 1.0 if begins else estimator.force_share
    x, y, z = momentum[0], momentum[1], momentum[2]
    for j in range(3):
        now = inertia[j, 0] * rates[0] + inertia[j, 1] * rates[1] + inertia[j, 2] * rates[2]
        momentum[j] += share * (now - momentum[j])
    if begins:
        return 0.0, 0.0, 0.0
    return (
        (momentum[0] - x) / estimator.period,
        (momentum[1] - y) / estimator.period,
        (momentum[2] - z) / estimator.period,
    )


@kernel
def compute_vertical_force(kinematics: Array, i: int, torque: Vector, up: Vector) -> float:
    """Compute the vertical force of foot ``i`` on the ground, N, from joint ``torque`` (3,), N m: J^-T tau.

    ``kinematics`` (L, 12) holds foot and Jacobian, m and m/rad; ``up`` (3,) is the unit vector upwards, in the hip
    frame. Positive forces press on the ground.
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
    """Estimate the contact force of leg ``i`` and fill the inputs of the position filters.

    ``stands`` is True if the plan has the foot in support, ``begins`` in the first step. ``attitude`` holds sine and
    cosine of roll, pitch and yaw; ``spin`` (3,) is the angular velocity of the body in its own frame, rad/s. Joints
    and feet of ``observation`` must be those of this step; its force, N, is filled.
    """
    q, dq = observation.q[i], observation.dq[i]
    turns = (sine_cosine(q[0]), sine_cosine(q[1]), sine_cosine(q[2]))
    (sr, cr), (sp, cp), _ = attitude
    up = (-sp, cp * sr, cp * cr)
    up_of_hip = (up[0], -up[2], up[1])
    held = compute_link_torque(estimator, i, turns, up_of_hip)
    torque = estimator.torque[i]
    left = (torque[0] - held[0], torque[1] - held[1], torque[2] - held[2])
    down = compute_vertical_force(observation.kinematics, i, left, up_of_hip)
    if begins:
        estimator.force[i] = down
    estimator.force[i] += estimator.force_share * (down - estimator.force[i])
    grows = compute_momentum_torque(estimator, i, dq, begins)
    force = max(estimator.force[i] - compute_vertical_force(observation.kinematics, i, grows, up_of_hip), 0.0)
    if not stands and force < LEAST_CONTACT * estimator.weight:
        force = 0.0
    observation.force[i] = force
    estimator.depth[i] = force / estimator.stiffness
    places = estimator.places
    places.trust[i] = min(1.0, force / (FULL_TRUST * estimator.weight)) if stands else 0.0
    foot = observation.foot[i]
    velocity = observation.velocity[i]
    reach = (estimator.hips[i, 0] + foot[0], estimator.hips[i, 1] + foot[2], -foot[1])
    moved = cross(spin, reach)
    passing = (velocity[0] + moved[0], velocity[2] + moved[1], moved[2] - velocity[1])
    places.passing[i, 0], places.passing[i, 1], places.passing[i, 2] = rotate_to_world(attitude, passing)
    if estimator.radius > 0.0:
        r = estimator.radius
        rolling = cross(compute_calf_rate(mechanism, i, turns, dq, spin), (r * up[0], r * up[1], r * up[2]))
        places.rolling[i, 0], places.rolling[i, 1], places.rolling[i, 2] = rotate_to_world(attitude, rolling)
    places.reach[i, 0], places.reach[i, 1], places.reach[i, 2] = rotate_to_world(attitude, reach)


@kernel
def compute_calf_rate(mechanism: Mechanism, i: int, turns: Turns, dq: Array, spin: Vector) -> Vector:
    """Compute the angular velocity (3,), rad/s, of the calf of leg ``i``, in the body frame.

    ``turns`` holds sine and cosine of its joint angles, ``dq`` (3,) their rates, rad/s; ``spin`` (3,) is the angular
    velocity of the body in its own frame, rad/s.
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
    """Fill ``observation`` with the state estimated from the ``signals`` of a ``step``.

    Call it once per step, with steps counted from 0. ``support`` (L,) is True for feet that the plan has on the
    ground.
    """
    read_joints(estimator, sensing, signals, step, observation)
    pose = observation.body
    rate = observation.body_rate
    heading = read_attitude(estimator.errors, estimator.period, sensing, signals, step, pose)
    first = len(JOINT_CHANNELS) * signals.q.size
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
    x, y, z = rotate_to_world(attitude, pushed)
    step_filters(places, estimator.period, (x, y, z - GRAVITY), estimator.depth)
    pose[0] = places.state[2, POSITION]
    rate[0] = places.state[2, SPEED]
    rate[1] = spin[1] * cr - spin[2] * sr
    rate[2] = spin[0] + (spin[1] * sr + spin[2] * cr) * sp / cp
    set_travel(observation.travel, places.state[0, POSITION], places.state[1, POSITION], heading)


@kernel
def set_travel(travel: Array | None, x: float, y: float, heading: float) -> None:
    """Fill ``travel`` (3,) with position ``x`` and ``y``, m, and ``heading``, rad; do nothing if it is None."""
    if travel is not None:
        travel[0], travel[1], travel[2] = x, y, heading
