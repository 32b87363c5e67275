"""Commands of one step to drives that close loops of their own, as kernels: angles, velocities, and J^T F_d.

The reference is that of the hybrid controller, steered alike, but half a sampling period ahead: a command is held for
a whole one. What teaches a feedforward is what the drives' law gives at the sample, and the force that is missing:
J^T (F_d - F), which no drive knows (docs/theory.md). An estimate of F that is filtered is
compared with F_d through the same filter.
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
"""Steps from the planned angles, which are those of the reference but for steering and half a sampling period."""


class DriveParams(NamedTuple):
    """Parameters of the controller of drives."""

    hips: Array
    """(L, 2): in the body frame, x forward and y left, m."""
    chains: Array
    """(L, 21): legs, m, see :mod:`cmacexp.models.chain`."""
    angles: Array
    """(N, L, 3): of the plan, where the search for angles starts, rad."""
    behind: Array
    """(2, N, L, 3): by how much angles, rad, and velocities, rad/s, change in the plan while sensors delay them."""
    stiffness: float
    """K, N m/rad."""
    damping: float
    """D, N m s/rad."""
    force_weight: float
    """Weight of the force that is missing, in what teaches."""
    force_share: float
    """Share of the desired force in ``force_due`` after a step; 1: it is that force."""
    force_due: Clock
    """(L,): the desired force through the filter of the forces that sensors estimate, N."""
    ahead: float
    """Time by which commands are ahead of the plan, s."""
    steering: Steering | None = None
    """None where nothing is steered."""


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
    """Fill the ``command`` (6, L, 3) of a step but for its torques, and torques and learning error of ``state``.

    A leg with ``support`` (L,) also presses with its desired force; ``reference`` is that of this ``sample``. The
    parts of a command are in the units of :data:`cmacexp.plants.drives.TORQUE`, torques and learning error in N m.
    """
    stiffness, damping = params.stiffness, params.damping
    hips = params.hips
    chains = params.chains
    for i in range(support.shape[0]):
        x, vx = steer_longitudinal(params.steering, hips, i, reference)
        z, vz = steer_lateral(params.steering, hips, i, reference)
        y, velocity = reference.position[i, Y], (vx, reference.velocity[i, Y], vz)
        state.reference[i, 0], state.reference[i, 1], state.reference[i, 2] = x, y, z
        x += params.ahead * velocity[0]
        y += params.ahead * velocity[1]
        z += params.ahead * velocity[2]
        start = params.angles[sample, i]
        behind, slower = params.behind[0, sample, i], params.behind[1, sample, i]
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
        kept = (1.0 - params.force_share) * params.force_due[i]
        params.force_due[i] = params.force_share * reference.force_desired[i] + kept
        lacking = params.force_due[i] - observation.force[i]
        missing = params.force_weight * lacking if support[i] else 0.0
        for j, angle in enumerate((q1, q2, q3)):
            command[ANGLE, i, j], command[VELOCITY, i, j] = angle, rates[j]
            command[STIFFNESS, i, j], command[DAMPING, i, j] = stiffness, damping
            off = angle - params.ahead * rates[j] - behind[j] - observation.q[i, j]
            law = stiffness * off + damping * (rates[j] - slower[j] - observation.dq[i, j])
            state.learning_error[i, j] = law + down[j] * missing
            state.feedback[i, j] = down[j] * reference.force_added[i]
