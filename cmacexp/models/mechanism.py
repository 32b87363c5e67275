"""The mechanism of a machine: planar legs, legs of three hinges, or a point mass.

One set of kernels serves every machine: ``kind`` determines whether a "joint" is a joint of a leg or a Cartesian axis
of a point mass. The first axis of arrays is that of the L legs, the next that of the J joints of a leg, or of the J
axes of its foot: x forward, y down, and z to the left where J = 3.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.chain import chain_kinematics
from cmacexp.models.leg import (
    Leg,
    Trig,
    foot_position,
    foot_velocity,
    inverse_dynamics,
    joint_torque,
    trigonometry,
)
from cmacexp.models.sine import sines_cosines
from cmacexp.typing import Array

POINT_MASS = 0
LEGS_ON_STAND = 1
LEGS_UNDER_BODY = 2
CHAINS_UNDER_BODY = 3
"""Legs of three hinges under the body of a robot."""
PLANE = (0, 1)
"""Axes along which the foot of a planar leg moves."""
SPACE = (0, 1, 2)
"""Axes along which the foot of a leg with three hinges moves."""
KINEMATICS_FIELDS = {PLANE: 4, SPACE: 12}
"""Number of values that describe a leg at given joint angles; see :func:`update_kinematics`."""


class Mechanism(NamedTuple):
    """Geometry and masses of a machine; L is the number of its legs."""

    kind: int
    """POINT_MASS, LEGS_ON_STAND, LEGS_UNDER_BODY or CHAINS_UNDER_BODY."""
    legs: Array
    """(L, 9): the fields of :class:`Leg`, of which a point mass uses ``mass_2`` only; for a robot its chains (L,
    21)."""
    hip_height: float
    """Height of the hips above the undepressed ground, m; of a body the planned height, h0."""
    hips: Array
    """(L, 2): hips in the body frame, x forward and y left of the centre of gravity, m."""
    weight: float
    """Weight that the feet carry together, N; 0 without a body."""
    axes: tuple[int, ...] = PLANE
    """PLANE or SPACE; the compiler unrolls loops over its length."""
    torque_limits: tuple[float, ...] = (math.inf, math.inf)
    """(J,): torque limits of the motors of a leg, N m."""
    chains: Array | None = None
    """(L, 21): m, see :mod:`cmacexp.models.chain`; None for planar legs, whose programs are compiled without that
    code."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of legs L, and of joints per leg J."""
        return len(self.legs), len(self.axes)

    @property
    def planar_legs(self) -> Any:
        """Planar legs as one :class:`Leg`, whose fields are views (L,) of the columns of ``legs``."""
        return Leg(*self.legs.T)


@kernel
def has_body(mechanism: Mechanism) -> bool:
    """Return True if the legs carry a body."""
    return mechanism.kind >= LEGS_UNDER_BODY


@kernel
def get_leg(mechanism: Mechanism, i: int) -> Leg:
    """Return the parameters of leg ``i`` of the machine."""
    legs = mechanism.legs
    return Leg(
        legs[i, 0],
        legs[i, 1],
        legs[i, 2],
        legs[i, 3],
        legs[i, 4],
        legs[i, 5],
        legs[i, 6],
        legs[i, 7],
        legs[i, 8],
    )


@kernel
def get_trig(kinematics: Array, i: int) -> Trig:
    """Return sines and cosines of the joint angles of planar leg ``i`` from ``kinematics`` (L, 4)."""
    return kinematics[i, 0], kinematics[i, 1], kinematics[i, 2], kinematics[i, 3]


@kernel
def update_kinematics(mechanism: Mechanism, q: Array, kinematics: Array) -> None:
    """Fill ``kinematics`` at joint angles ``q`` (L, J), rad; feet and Jacobians follow from it.

    It holds sines and cosines of planar legs, (L, 4), and foot, m, and Jacobian, m/rad, of chains, (L, 12). A point
    mass needs none.
    """
    if mechanism.kind != POINT_MASS:
        for i in range(q.shape[0]):
            if mechanism.kind == CHAINS_UNDER_BODY:
                update_chain(mechanism.chains, i, q, kinematics)
            else:
                kinematics[i, 0], kinematics[i, 1], kinematics[i, 2], kinematics[i, 3] = trigonometry(
                    q[i, 0], q[i, 1]
                )


@kernel
def update_chain(chains: Array | None, i: int, q: Array, kinematics: Array) -> None:
    """Fill row ``i`` of ``kinematics`` (L, 12) with foot, m, and Jacobian columns, m/rad, at ``q`` (L, 3), rad.

    ``chains`` is (L, 21).
    """
    if chains is not None:
        row = kinematics[i]
        foot, hip, thigh, calf = chain_kinematics(chains[i], q[i, 0], q[i, 1], q[i, 2])
        row[0], row[1], row[2] = foot
        row[3], row[4], row[5] = hip
        row[6], row[7], row[8] = thigh
        row[9], row[10], row[11] = calf


@kernel
def compute_foot_position(mechanism: Mechanism, i: int, kinematics: Array, foot: Array) -> None:
    """Fill row ``i`` of ``foot`` (L, J), m, in the frame of its hip, from ``kinematics``.

    See :func:`update_kinematics`. Callers treat a point mass themselves: with a branch for it here its step took 1.4
    times as long.
    """
    if mechanism.kind == CHAINS_UNDER_BODY:
        for j in range(len(mechanism.axes)):
            foot[i, j] = kinematics[i, j]
    else:
        foot[i, 0], foot[i, 1] = foot_position(get_leg(mechanism, i), get_trig(kinematics, i))


@kernel
def compute_foot_velocity(mechanism: Mechanism, i: int, kinematics: Array, dq: Array, velocity: Array) -> None:
    """Fill row ``i`` of the foot ``velocity`` (L, J), J dtheta, m/s, at joint velocities ``dq`` (L, J), rad/s."""
    if mechanism.kind == CHAINS_UNDER_BODY:
        for j in range(len(mechanism.axes)):
            velocity[i, j] = 0.0
            for n in range(len(mechanism.axes)):
                velocity[i, j] += kinematics[i, 3 + 3 * n + j] * dq[i, n]
    else:
        velocity[i, 0], velocity[i, 1] = foot_velocity(
            get_leg(mechanism, i), get_trig(kinematics, i), dq[i, 0], dq[i, 1]
        )


@kernel
def apply_jacobian_transpose(
    mechanism: Mechanism, i: int, kinematics: Array, force: Array, down: float, torque: Array
) -> None:
    """Fill row ``i`` of ``torque`` (L, J) with J^T U of leg ``i``, N m (Lin & Song 1997, Fig. 1).

    U is ``force`` (L, J), N, with its y replaced by ``down``, N; J, the identity for a point mass, follows from
    ``kinematics``, see :func:`update_kinematics`.
    """
    if mechanism.kind == CHAINS_UNDER_BODY:
        for n in range(len(mechanism.axes)):
            x = kinematics[i, 3 + 3 * n]
            y = kinematics[i, 4 + 3 * n]
            z = kinematics[i, 5 + 3 * n]
            torque[i, n] = x * force[i, 0] + y * down + z * force[i, 2]
    elif mechanism.kind == POINT_MASS:
        torque[i, 0], torque[i, 1] = force[i, 0], down
    else:
        torque[i, 0], torque[i, 1] = joint_torque(get_leg(mechanism, i), get_trig(kinematics, i), force[i, 0], down)


def planned_torque(mechanism: Mechanism, q: Array, dq: Array, ddq: Array, force: Array) -> Array:
    """Compute the torques (N, L, J), N m, for joint accelerations ``ddq`` against contact forces ``force`` (N, L), N.

    ``q``, ``dq`` and ``ddq`` are (N, L, J), in rad, rad/s and rad/s^2; for a point mass in m, m/s and m/s^2, and its
    torque is a force in N (eq. 2, 16, 17).
    """
    legs: Leg = mechanism.planar_legs
    (dq1, dq2), (ddq1, ddq2) = (np.moveaxis(values, -1, 0) for values in (dq, ddq))
    if mechanism.kind == POINT_MASS:
        return np.stack([legs.mass_2 * ddq1, legs.mass_2 * ddq2 + force], axis=-1)
    trig: Any = *sines_cosines(q[..., 0]), *sines_cosines(q[..., 0] + q[..., 1])
    pair: Any = inverse_dynamics(legs, trig, dq1, dq2, ddq1, ddq2, force)  # type: ignore[arg-type]  # of arrays
    return np.stack(pair, axis=-1)


def point_mass(mass: float, hip_height: float) -> Mechanism:
    """Make a machine that is one point mass of ``mass`` kg, whose planned height is ``hip_height``, m."""
    return Mechanism(POINT_MASS, np.array([Leg(1.0, 1.0, 0.0, mass, 1.0)]), hip_height, np.zeros((1, 2)), 0.0)


def legs_on_stand(legs: list[Leg], hip_height: float) -> Mechanism:
    """Make a machine of planar legs with fixed hips at ``hip_height``, m."""
    return Mechanism(LEGS_ON_STAND, np.array(legs, dtype=float), hip_height, np.zeros((len(legs), 2)), 0.0)


def legs_under_body(legs: list[Leg], hip_height: float, hips: list[tuple[float, float]], weight: float) -> Mechanism:
    """Make a machine of planar legs under a moving body, the feet of which carry ``weight`` N.

    ``hips`` are forward and left of the body's centre, m; ``hip_height`` is the planned height of the body, m.
    """
    return Mechanism(LEGS_UNDER_BODY, np.array(legs, dtype=float), hip_height, np.array(hips, dtype=float), weight)
