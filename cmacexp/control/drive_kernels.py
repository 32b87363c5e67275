"""Kernels that compute the commands to joint drives in one step: angles, velocities and J^T F_d.

The reference is that of the hybrid controller, steered in the same way, but half a sampling period ahead, because a
command is held for a whole period. The learning error of a feedforward is the feedback torque of the drives at the
sample plus the torque of the force error, J^T (F_d - F), which the drives do not know (docs/theory.md). If the
estimate of F is filtered, F_d passes through the same filter.
"""

from typing import NamedTuple

from cmacexp.control.hybrid_kernels import HybridState
from cmacexp.control.steering import Steering, steer_lateral, steer_longitudinal
from cmacexp.jit.compiler import kernel
from cmacexp.models.chain import chain_kinematics, joint_velocity
from cmacexp.planning.reference import ControlReference, Y
from cmacexp.plants.drives import ANGLE, DAMPING, STIFFNESS, VELOCITY
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array, Clock, Mask

NEWTON_STEPS = 3
"""Newton iterations from the planned angles, which differ from the wanted ones only by steering and half a period."""


class DriveParams(NamedTuple):
    """Parameters of the controller of joint drives, for L legs of three joints and N samples per cycle."""

    hips: Array
    """(L, 2): hip positions in the body frame, x forward and y left, m."""
    chains: Array
    """(L, 21): geometry of the legs, m, see :mod:`cmacexp.models.chain`."""
    angles: Array
    """(N, L, 3): planned joint angles, from which the inverse kinematics start, rad."""
    behind: Array
    """(2, N, L, 3): planned change of angles, rad, and velocities, rad/s, over the delay of their sensors."""
    stiffness: float
    """Position gain K, N m/rad."""
    damping: float
    """Velocity gain D, N m s/rad."""
    force_weight: float
    """Weight of the force error in the learning error."""
    force_share: float
    """Gain of the force filter: fraction of (desired force - ``force_due``) added per step; 1: not filtered."""
    force_due: Clock
    """(L,): desired force after the filter of the estimated forces, N."""
    ahead: float
    """Time by which commands lead the plan, s."""
    steering: Steering | None = None
    """Course feedback; None without one."""


@kernel
def command_drives(
    params: DriveParams,
    state: HybridState,
    command: Array,
    sample: int,
    support: Mask,
    reference: ControlReference,
    observation: Observation,
) -> None:
    """Fill the drive ``command`` (6, L, 3) of one step, and feedback and learning error of ``state``, N m.

    ``reference`` is that of this ``sample`` of the cycle; legs with ``support`` (L,) True also press with their
    desired force. The rows of a command have the order and units given at :data:`cmacexp.plants.drives.TORQUE`; its
    torques are not filled.
    """
    stiffness = params.stiffness
    damping = params.damping
    hips = params.hips
    chains = params.chains
    for i in range(support.shape[0]):
        x, vx = steer_longitudinal(params.steering, hips, i, reference)
        z, vz = steer_lateral(params.steering, hips, i, reference)
        y = reference.position[i, Y]
        velocity = (vx, reference.velocity[i, Y], vz)
        state.reference[i, 0], state.reference[i, 1], state.reference[i, 2] = x, y, z
        x += params.ahead * velocity[0]
        y += params.ahead * velocity[1]
        z += params.ahead * velocity[2]
        start = params.angles[sample, i]
        behind = params.behind[:, sample, i]
        q1, q2, q3 = start[0], start[1], start[2]
        for _ in range(NEWTON_STEPS):
            at = chain_kinematics(chains[i], q1, q2, q3)
            step = joint_velocity(at, (x - at.foot[0], y - at.foot[1], z - at.foot[2]))
            q1 += step[0]
            q2 += step[1]
            q3 += step[2]
        at = chain_kinematics(chains[i], q1, q2, q3)
        rates = joint_velocity(at, velocity)
        down = (at.hip[1], at.thigh[1], at.calf[1])
        force_share = params.force_share
        params.force_due[i] = force_share * reference.force_desired[i] + (1.0 - force_share) * params.force_due[i]
        force_error = params.force_due[i] - observation.force[i]
        weighted_error = params.force_weight * force_error if support[i] else 0.0
        for j, angle in enumerate((q1, q2, q3)):
            command[ANGLE, i, j], command[VELOCITY, i, j] = angle, rates[j]
            command[STIFFNESS, i, j], command[DAMPING, i, j] = stiffness, damping
            angle_error = angle - params.ahead * rates[j] - behind[0, j] - observation.q[i, j]
            feedback = stiffness * angle_error + damping * (rates[j] - behind[1, j] - observation.dq[i, j])
            state.learning_error[i, j] = feedback + down[j] * weighted_error
            state.feedback[i, j] = down[j] * reference.force_added[i]
