"""Kernels of hybrid position/force control in one step, with fault detection of the force sensors.

Equation 21 adds two LEAD compensators, one over position and one over velocity errors. Both have the same corner
frequencies, so one LEAD over K_ap E + K_av E' is the same controller, and keeps its state when the planned phase
switches between position and force control.

Fault detection compares each reading with the force expected at the measured depth of the foot. The statistic is a
one-sided cumulative sum of normalised deviations (CUSUM: Page 1954, Continuous inspection schemes, Biometrika 41), so
that neither spikes nor noise exclude a healthy sensor.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.control.steering import Steering, steer_lateral, steer_longitudinal
from cmacexp.jit.compiler import kernel
from cmacexp.models.body import LEVEL, Pose, depth, depth_rate, make_pose
from cmacexp.models.ground import contact_force
from cmacexp.models.lead import Lead, lead_step
from cmacexp.models.mechanism import PLANE, Mechanism, apply_jacobian_transpose, has_body
from cmacexp.planning.reference import ControlReference, Gains, Y, Z
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array, Clock, Mask, Scratch, State

LARGEST_INCREMENT = 1.0
"""Largest increment of the cumulative sum in one sample, so that a spike counts no more than a moderate deviation."""


class FaultDetection(NamedTuple):
    """Parameters of fault detection; fields as in :class:`cmacexp.config.schema.PlausibilityConfig`."""

    enabled: bool
    tolerance: float
    """Allowed difference from the expected force, N."""
    relative_tolerance: float
    """Additional allowed difference, relative to the expected force."""
    patience: int
    """Threshold of the cumulative sum; a sample with twice the allowed difference adds 1."""


class FaultStatus(NamedTuple):
    """Fault status of the force sensors of L legs."""

    statistic: State
    """(L,): cumulative sum of normalised deviations, at least 0."""
    trusted: Clock
    """(L,): 1 if the sensor is trusted, 0 after its exclusion."""
    steps: Clock
    """(L,): number of steps in which the sensor was trusted."""


def new_fault_status(legs: int) -> FaultStatus:
    """Make the fault status of ``legs`` legs, with all sensors trusted."""
    return FaultStatus(np.zeros(legs), np.ones(legs), np.zeros(legs))


@kernel
def expected_force(stiffness: float, mechanism: Mechanism, i: int, foot: Array, pose: Pose) -> float:
    """Compute the contact force of foot ``i`` on flat ground at its measured depth, N (eq. 1).

    ``stiffness`` is that of the ground, K_n, N/m; ``foot`` (L, J), m, is in the frames of the hips, ``pose`` is the
    pose of the body.
    """
    if has_body(mechanism):
        hips = mechanism.hips
        return contact_force(stiffness, depth(pose, hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]))
    return contact_force(stiffness, foot[i, 1] - mechanism.hip_height)


@kernel
def update_status(params: FaultDetection, status: FaultStatus, i: int, measured: float, expected: float) -> bool:
    """Update the fault status with one sample of leg ``i``; return True if its sensor is still trusted.

    ``measured`` and ``expected`` are forces, N.
    """
    if status.trusted[i] == 0.0:
        return False
    allowed = params.tolerance + params.relative_tolerance * expected
    increment = min(abs(measured - expected) / allowed - 1.0, LARGEST_INCREMENT)
    status.statistic[i] = max(0.0, status.statistic[i] + increment)
    if status.statistic[i] > params.patience:
        status.trusted[i] = 0.0
        return False
    status.steps[i] += 1.0
    return True


STIFFNESS, DAMPING, COMBINED, EXPLICIT = range(4)
METHODS = {"stiffness": STIFFNESS, "damping": DAMPING, "combined": COMBINED, "explicit": EXPLICIT}


class HybridParams(NamedTuple):
    """Parameters of the hybrid controller."""

    mechanism: Mechanism
    method: int
    """Force control method, one of METHODS."""
    gains: Gains
    lead: Lead
    posture_gain: float
    """Gain of the posture control of a body; 0 switches it off."""
    posture_rate_gain: float
    """Gain of the posture term in the velocity reference; 0 as in the paper."""
    fault_detection: FaultDetection
    lead_reset: bool
    """True if the LEAD of a leg starts from zero when its planned phase changes."""
    force_in_transfer: bool
    """True if the force terms act whenever a foot presses, also in planned transfer."""
    steering: Steering | None = None
    """Course feedback; None without one."""


class HybridState(NamedTuple):
    """LEAD states and results of the last step, for L legs with J axes and joints each."""

    error: State
    """(L, J): weighted error of the last step, N."""
    output: State
    """(L, J): LEAD output U of the last step, without the desired force, N."""
    feedback: Scratch
    """(L, J): feedback torque J^T (U + F_d), N m."""
    learning_error: State
    """(L, J): learning error of a feedforward, J^T U, N m."""
    reference: Scratch
    """(L, J): reference position of the last step, including posture control, m."""
    supporting: State
    """(L,): 1 if the last step was planned support, else 0."""
    fault_status: FaultStatus


def new_hybrid_state(legs: int, axes: int = len(PLANE)) -> HybridState:
    """Make the state of ``legs`` legs with ``axes`` axes each: all zero, all force sensors trusted."""
    error, output, feedback, learning_error, reference = (np.zeros((legs, axes)) for _ in range(5))
    return HybridState(error, output, feedback, learning_error, reference, np.zeros(legs), new_fault_status(legs))


@kernel
def position_error(params: HybridParams, reference: float, reference_rate: float, value: float, rate: float) -> float:
    """Compute the weighted position error K_ap E + K_av E', N, without force terms (Lin & Song 1997, eq. 21)."""
    return params.gains.position_gain * (reference - value) + params.gains.velocity_gain * (reference_rate - rate)


@kernel
def posture_term(params: HybridParams, i: int, pose: Pose) -> float:
    """Compute the posture term of the y reference of supporting foot ``i``, gain x (h0 - h_i), m (section 6.2).

    ``pose`` is the pose of the body; h0 is the nominal height of the hips, h_i that of hip i.
    """
    if not has_body(params.mechanism) or params.posture_gain == 0.0:
        return 0.0
    hips = params.mechanism.hips
    return params.posture_gain * (params.mechanism.hip_height + depth(pose, hips[i, 0], hips[i, 1], 0.0))


@kernel
def posture_rate_term(params: HybridParams, i: int, pose: Pose, rate: Array) -> float:
    """Compute the posture term of the vy reference of supporting foot ``i``, -gain x dh_i/dt, m/s.

    With the gain of :func:`posture_term` it is the derivative of that term. The paper omits it, but a body with
    inertia rocks without it. ``rate`` (3,) holds the rates of height, m/s, pitch and roll, rad/s.
    """
    if not has_body(params.mechanism) or params.posture_rate_gain == 0.0:
        return 0.0
    hips = params.mechanism.hips
    return params.posture_rate_gain * depth_rate(pose, rate, hips[i, 0], hips[i, 1])


@kernel
def force_error(
    params: HybridParams,
    i: int,
    force_reference: float,
    y_reference: float,
    vy_reference: float,
    y: float,
    vy: float,
    force: float,
) -> float:
    """Compute the weighted error of the force control method, N (Lin & Song 1997, Fig. 2 to 5 and eq. 21).

    ``force`` and its reference are in N, ``y`` in m, ``vy`` in m/s; the references of ``y`` and ``vy`` include
    posture control.
    """
    if params.method == EXPLICIT:
        return params.gains.force_gain * (force_reference - force)
    stiffness = params.gains.position_gain * (y_reference - y - force * params.gains.elasticity)
    damping = params.gains.velocity_gain * (vy_reference - vy - force * params.gains.admittance)
    if params.method == STIFFNESS:
        return stiffness
    if params.method == DAMPING:
        return damping
    return stiffness + damping


@kernel
def control_force(
    params: HybridParams, status: FaultStatus, i: int, measured: float, desired: float, foot: Array, pose: Pose
) -> float:
    """Return the force used by control, N: the ``measured`` force unless the sensor of leg ``i`` is excluded.

    With an excluded sensor, stiffness and combined control use the ``desired`` force: its terms P_fn and V_fn in the
    error then cancel those in the reference (eq. 9, 13, 24). Damping and explicit control have no other information
    about the ground; they use the force expected at the measured depth. ``foot`` (L, J), m, is in the frames of the
    hips.
    """
    if not params.fault_detection.enabled:
        return measured
    expected = expected_force(params.gains.stiffness, params.mechanism, i, foot, pose)
    if update_status(params.fault_detection, status, i, measured, expected):
        return measured
    return desired if params.method == STIFFNESS or params.method == COMBINED else expected


@kernel
def filter_error(lead: Lead, state: HybridState, i: int, axis: int, reference: float, error: float) -> None:
    """Filter the weighted ``error``, N, of leg ``i`` along ``axis`` by its LEAD; store the ``reference``, m."""
    state.output[i, axis] = lead_step(lead, error, state.error[i, axis], state.output[i, axis])
    state.error[i, axis] = error
    state.reference[i, axis] = reference


@kernel
def reset_leads(state: HybridState, support: Mask) -> None:
    """Set the LEAD states of the legs to zero whose planned ``support`` (L,) has changed."""
    for i in range(support.shape[0]):
        now = 1.0 if support[i] else 0.0
        if now != state.supporting[i]:
            state.error[i, :] = 0.0
            state.output[i, :] = 0.0
            state.supporting[i] = now


@kernel
def hybrid_feedback(
    params: HybridParams,
    state: HybridState,
    support: Mask,
    reference: ControlReference,
    observation: Observation,
) -> None:
    """Compute the feedback torques (L, J), N m, of all legs, and advance ``state`` by one step.

    Legs with ``support`` (L,) True are under force control along y, the others under position control. With
    ``force_in_transfer`` all are under force control; without contact the force is 0, and both errors are the same.
    ``reference`` and ``observation`` are those of this step.
    """
    foot = observation.foot
    velocity = observation.velocity
    kinematics = observation.kinematics
    pose = make_pose(observation.body) if has_body(params.mechanism) else LEVEL
    if params.lead_reset:
        reset_leads(state, support)
    for i in range(support.shape[0]):
        x_reference, vx_reference = steer_longitudinal(params.steering, params.mechanism.hips, i, reference)
        x_error = position_error(params, x_reference, vx_reference, foot[i, 0], velocity[i, 0])
        y_reference, vy_reference = reference.position[i, Y], reference.velocity[i, Y]
        force = control_force(
            params, state.fault_status, i, observation.force[i], reference.force_desired[i], foot, pose
        )
        if support[i]:
            y_reference += posture_term(params, i, pose)
            vy_reference += posture_rate_term(params, i, pose, observation.body_rate)
        if support[i] or params.force_in_transfer:
            y_error = force_error(
                params,
                i,
                force_reference=reference.force_reference[i],
                y_reference=y_reference,
                vy_reference=vy_reference,
                y=foot[i, 1],
                vy=velocity[i, 1],
                force=force,
            )
        else:
            y_error = position_error(params, y_reference, vy_reference, foot[i, 1], velocity[i, 1])
        filter_error(params.lead, state, i, 0, x_reference, x_error)
        filter_error(params.lead, state, i, 1, y_reference, y_error)
        if len(params.mechanism.axes) > 2:
            z_reference, vz_reference = steer_lateral(params.steering, params.mechanism.hips, i, reference)
            z_error = position_error(params, z_reference, vz_reference, foot[i, Z], velocity[i, Z])
            filter_error(params.lead, state, i, Z, z_reference, z_error)
        uy = state.output[i, 1]
        apply_jacobian_transpose(params.mechanism, i, kinematics, state.output, uy, state.learning_error)
        added = reference.force_added[i]
        if added != 0.0:
            apply_jacobian_transpose(params.mechanism, i, kinematics, state.output, uy + added, state.feedback)
        else:
            for j in range(len(params.mechanism.axes)):
                state.feedback[i, j] = state.learning_error[i, j]
