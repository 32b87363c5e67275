"""Equations of motion of the built-in machines, and their integration by the classical Runge-Kutta method."""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import called_kernel, copy_array, kernel
from cmacexp.models.body import Load, balance, depth, make_pose
from cmacexp.models.ground import (
    Ground,
    contact_force,
    damped_force,
    damped_spring,
    grade_at,
    height_at,
    stiffness_under,
)
from cmacexp.models.leg import Trig, foot_position, foot_velocity, forward_dynamics, trigonometry, trigonometry_near
from cmacexp.models.mechanism import (
    KINEMATICS_FIELDS,
    LEGS_UNDER_BODY,
    PLANE,
    POINT_MASS,
    Mechanism,
    compute_foot_velocity,
    get_leg,
    get_trig,
)
from cmacexp.typing import Array, Clock, Scratch, State

NO_TRIG: Trig = (0.0, 1.0, 0.0, 1.0)
"""Sines and cosines of a point mass, which has no angles."""


class Payload(NamedTuple):
    """A load on the body from a given time on."""

    load: Load
    start: int
    """First sampling period with the load."""


class PlantParams(NamedTuple):
    """Parameters of a plant; L is the number of its legs."""

    mechanism: Mechanism
    ground: Ground
    payload: Payload
    speed: float
    """Speed of the body over the ground, m/s."""
    step: float
    """Time of one Runge-Kutta step, s."""
    substeps: int
    """Runge-Kutta steps per sampling period."""


class PlantState(NamedTuple):
    """State of a plant, quantities computed from it, and working arrays of the integration."""

    q: State
    """(L, J): joint angles, rad; of a point mass its position, m."""
    dq: State
    """(L, J): joint velocities, rad/s; of a point mass m/s."""
    foot: State
    """(L, J): position of the foot in the frame of its hip, m."""
    velocity: State
    """(L, J): velocity of the foot, m/s."""
    force: State
    """(L,): contact force, N."""
    body: State
    """(3,): height of the hips above the undepressed ground, m; pitch and roll, rad."""
    body_rate: State
    """(3,): mean rate over the last sampling period, m/s and rad/s: a quasi-static body has no other velocity."""
    stiffness: State
    """(L,): K_n under each foot, N/m."""
    ground_offset: State
    """(L,): depth below the undepressed ground at which the ground begins to press each foot, m."""
    spring: Scratch
    """(2, L): equivalent stiffness, N/m, and offset, m, under a quasi-static body within a step, on ground with
    damping."""
    pressed: State
    """(L,): depression under each foot at the start of a Runge-Kutta step, m; only on ground with damping."""
    distance: Clock
    """(1,): distance that the body has covered, m."""
    clock: Clock
    """(1,): number of sampling periods since the start."""
    kinematics: State
    """(L, 4) of planar legs, (L, 12), m and m/rad, of chains: :func:`cmacexp.models.mechanism.update_kinematics`."""
    stages: Scratch
    """(5, L, J): joint velocities, rad/s, of one stage of the integration, accelerations, rad/s^2, of all four."""
    stage_kinematics: Scratch
    """Kinematics of one stage, in the form of ``kinematics``."""


def new_state(legs: int, axes: tuple[int, ...] = PLANE) -> PlantState:
    """Make a state of zeros for ``legs`` legs."""
    motion = (legs, len(axes))
    kinematics = (legs, KINEMATICS_FIELDS[axes])
    return PlantState(
        q=np.zeros(motion),
        dq=np.zeros(motion),
        foot=np.zeros(motion),
        velocity=np.zeros(motion),
        force=np.zeros(legs),
        body=np.zeros(3),
        body_rate=np.zeros(3),
        stiffness=np.zeros(legs),
        ground_offset=np.zeros(legs),
        spring=np.zeros((2, legs)),
        pressed=np.zeros(legs),
        distance=np.zeros(1),
        clock=np.zeros(1),
        kinematics=np.zeros(kinematics),
        stages=np.zeros((5, *motion)),
        stage_kinematics=np.zeros(kinematics),
    )


@kernel
def stand_force(params: PlantParams, i: int, dq: Array, kinematics: Array, state: PlantState) -> float:
    """Compute the contact force, N, of foot ``i`` under a fixed hip, at ``dq`` (L, 2), rad/s.

    ``kinematics`` is (L, 4).
    """
    depression = state.foot[i, 1] - params.mechanism.hip_height - state.ground_offset[i]
    if params.ground.damping == 0.0:
        return contact_force(state.stiffness[i], depression)
    along, rate = dq[i, 0], dq[i, 1]
    if params.mechanism.kind != POINT_MASS:
        along, rate = foot_velocity(get_leg(params.mechanism, i), get_trig(kinematics, i), dq[i, 0], dq[i, 1])
    rate += grade_at(params.ground, state.foot[i, 0]) * along
    return damped_force(state.stiffness[i], params.ground.damping, depression, rate)


@kernel
def compute_load(params: PlantParams, step: float) -> Load:
    """Compute the load of the feet after ``step`` sampling periods: body, and payload from its start on."""
    payload = params.payload.load
    if step < params.payload.start:
        return Load(params.mechanism.weight, 0.0, 0.0)
    total = params.mechanism.weight + payload.weight
    return Load(total, payload.weight * payload.x / total, payload.weight * payload.y / total)


@called_kernel
def update_ground_offset(ground: Ground, hips: Array, foot: Array, x: float, ground_offset: Array) -> None:
    """Fill ``ground_offset`` (L,): depth of the ground under each foot below that under a body at ``x``, m.

    ``hips`` (L, 2) and ``foot`` (L, J), in the frames of the hips, are in m.
    """
    below = height_at(ground.slope, ground.slope_start, x)
    for i in range(hips.shape[0]):
        ground_offset[i] = below - height_at(ground.slope, ground.slope_start, x + hips[i, 0] + foot[i, 0])


@kernel
def balance_body(params: PlantParams, state: PlantState, time: float) -> bool:
    """Balance the body on the feet in ``state``, ``time``, s, after the start of the Runge-Kutta step.

    Returns False if there is no equilibrium.
    """
    mechanism = params.mechanism
    stiffness = state.stiffness
    ground_offset = state.ground_offset
    if params.ground.damping != 0.0:
        stiffness = state.spring[0]
        ground_offset = state.spring[1]
        for i in range(stiffness.shape[0]):
            stiffness[i], offset = damped_spring(state.stiffness[i], params.ground.damping, state.pressed[i], time)
            ground_offset[i] = state.ground_offset[i] + offset
    load = compute_load(params, state.clock[0])
    return balance(mechanism.hips, state.foot, stiffness, ground_offset, load, state.body, state.force)


@kernel
def place_leg(mechanism: Mechanism, i: int, q1: float, q2: float, trig: Trig, kinematics: Array, foot: Array) -> None:
    """Fill row ``i`` of ``foot`` (L, 2), m, and of ``kinematics`` (L, 4), of a leg at angles ``q1``, ``q2``, rad.

    ``trig`` belongs to these angles; for a point mass, which is at ``q1``, ``q2``, m, it is :data:`NO_TRIG`.
    Treating that case in the callers instead was measured to make a step of one leg half as long again.
    """
    if mechanism.kind == POINT_MASS:
        foot[i, 0], foot[i, 1] = q1, q2
    else:
        kinematics[i, 0], kinematics[i, 1], kinematics[i, 2], kinematics[i, 3] = trig
        foot[i, 0], foot[i, 1] = foot_position(get_leg(mechanism, i), trig)


@kernel
def update_contact(params: PlantParams, state: PlantState, time: float, x: float) -> None:
    """Update the ground under the feet in ``state`` and, under a body, the coupled contact forces, N.

    ``time``, s, has passed since the start of the step, and the body is at ``x``, m. Without equilibrium the height
    of the body becomes NaN. See :func:`stand_force` for hips that do not move.
    """
    mechanism = params.mechanism
    if params.ground.slope != 0.0:
        update_ground_offset(params.ground, mechanism.hips, state.foot, x, state.ground_offset)
    if mechanism.kind == LEGS_UNDER_BODY and not balance_body(params, state, time):
        state.body[0] = math.nan


@kernel
def accelerate(
    mechanism: Mechanism, i: int, dq: Array, kinematics: Array, tau: Array, force: float, ddq: Array
) -> None:
    """Fill row ``i`` of the joint accelerations ``ddq`` (L, 2), rad/s^2, of a leg (Lin & Song 1997, eq. 2).

    ``dq``, rad/s, and ``tau``, N m, are (L, 2), ``kinematics`` is (L, 4); ``force``, N, presses on its foot.
    """
    leg = get_leg(mechanism, i)
    if mechanism.kind == POINT_MASS:
        ddq[i, 0], ddq[i, 1] = tau[i, 0] / leg.mass_2, (tau[i, 1] - force) / leg.mass_2
    else:
        ddq[i, 0], ddq[i, 1] = forward_dynamics(
            leg, get_trig(kinematics, i), dq[i, 0], dq[i, 1], tau[i, 0], tau[i, 1], force
        )


@kernel
def update_stiffness(params: PlantParams, state: PlantState) -> None:
    """Set the stiffness under each foot to that of its position and time."""
    hips = params.mechanism.hips
    for i in range(hips.shape[0]):
        x = state.distance[0] + hips[i, 0] + state.foot[i, 0]
        state.stiffness[i] = stiffness_under(params.ground, i, state.clock[0], x, hips[i, 1])


@kernel
def update_depression(params: PlantParams, state: PlantState) -> None:
    """Store the depression of the ground under each foot of a body, for the damping of the next step."""
    hips = params.mechanism.hips
    pose = make_pose(state.body)
    for i in range(hips.shape[0]):
        down = depth(pose, hips[i, 0] + state.foot[i, 0], hips[i, 1], state.foot[i, 1])
        state.pressed[i] = max(0.0, down - state.ground_offset[i])


@kernel
def observe(params: PlantParams, state: PlantState, time: float) -> None:
    """Update feet, forces and velocities of ``state`` to its joints, ``time``, s, after their last update."""
    mechanism = params.mechanism
    for i in range(state.q.shape[0]):
        q1, q2 = state.q[i, 0], state.q[i, 1]
        trig = NO_TRIG if mechanism.kind == POINT_MASS else trigonometry(q1, q2)
        place_leg(mechanism, i, q1, q2, trig, state.kinematics, state.foot)
    update_contact(params, state, time, state.distance[0])
    if params.ground.damping != 0.0 and mechanism.kind == LEGS_UNDER_BODY:
        update_depression(params, state)
    for i in range(state.q.shape[0]):
        if mechanism.kind != LEGS_UNDER_BODY:
            state.force[i] = stand_force(params, i, state.dq, state.kinematics, state)
    # In the loop above this would make a step of a quadruped a tenth longer.
    for i in range(state.q.shape[0]):
        if mechanism.kind == POINT_MASS:
            state.velocity[i, 0], state.velocity[i, 1] = state.dq[i, 0], state.dq[i, 1]
        else:
            compute_foot_velocity(mechanism, i, state.kinematics, state.dq, state.velocity)


@kernel
def compute_stage(
    params: PlantParams, state: PlantState, time: float, velocity: Array, acceleration: Array, tau: Array, ddq: Array
) -> None:
    """Compute a stage of a step: joint accelerations ``ddq``, rad/s^2, ``time``, s, after the start of the step.

    The stage is reached with the given ``velocity``, rad/s, and ``acceleration``, rad/s^2, under ``tau``, N m; all
    arrays are (L, 2). Fills ``ddq``, and ``state.stages[0]``, which may be ``velocity``, with the new velocities.

    Legs are computed one after the other, so that quantities of a leg can stay in registers: with a loop for each
    quantity a step of one leg took 1.3 times as long.
    """
    mechanism = params.mechanism
    dq = state.stages[0]
    kinematics = state.stage_kinematics
    for i in range(state.q.shape[0]):
        start_q1, start_q2 = state.q[i, 0], state.q[i, 1]
        q1, q2 = start_q1 + time * velocity[i, 0], start_q2 + time * velocity[i, 1]
        for j in range(2):
            dq[i, j] = state.dq[i, j] + time * acceleration[i, j]
        trig = NO_TRIG
        if mechanism.kind != POINT_MASS:
            # Sines at the start of the step are computed again in each step, so that errors do not add up.
            trig = trigonometry_near(q1, q2, get_trig(state.kinematics, i), start_q1, start_q2)
        place_leg(mechanism, i, q1, q2, trig, kinematics, state.foot)
    update_contact(params, state, time, state.distance[0] + params.speed * time)
    for i in range(state.q.shape[0]):
        if mechanism.kind != LEGS_UNDER_BODY:
            state.force[i] = stand_force(params, i, dq, kinematics, state)
        accelerate(mechanism, i, dq, kinematics, tau, state.force[i], ddq)


@kernel
def runge_kutta_step(params: PlantParams, state: PlantState, tau: Array) -> None:
    """Integrate one classical fourth-order step of ``params.step`` under ``tau`` (L, 2), N m.

    Contact forces act in all stages. Sines, feet and forces in ``state`` must belong to its joints; after the step
    they do not, until :func:`observe` is called.
    """
    h = params.step
    dq = state.stages[0]
    k1 = state.stages[1]
    k2 = state.stages[2]
    k3 = state.stages[3]
    k4 = state.stages[4]
    for i in range(state.q.shape[0]):
        accelerate(params.mechanism, i, state.dq, state.kinematics, tau, state.force[i], k1)
    compute_stage(params, state, 0.5 * h, state.dq, k1, tau, k2)
    compute_stage(params, state, 0.5 * h, dq, k2, tau, k3)
    compute_stage(params, state, h, dq, k3, tau, k4)
    for i in range(state.q.shape[0]):
        for j in range(2):
            # The velocities of the stages are dq, dq + h/2 k1, dq + h/2 k2, dq + h k3: their weighted sum is this.
            state.q[i, j] += h * state.dq[i, j] + h * h / 6.0 * (k1[i, j] + k2[i, j] + k3[i, j])
            state.dq[i, j] += h / 6.0 * (k1[i, j] + 2.0 * k2[i, j] + 2.0 * k3[i, j] + k4[i, j])


@kernel
def advance(params: PlantParams, state: PlantState, tau: Array) -> None:
    """Integrate the plant over one sampling period under the held torque ``tau`` (L, 2), N m."""
    copy_array(state.body, state.body_rate)
    for substep in range(params.substeps):
        runge_kutta_step(params, state, tau)
        state.distance[0] += params.speed * params.step
        if substep + 1 == params.substeps:
            state.clock[0] += 1
        update_stiffness(params, state)
        observe(params, state, params.step)
    period = params.substeps * params.step
    for n in range(3):
        state.body_rate[n] = (state.body[n] - state.body_rate[n]) / period
