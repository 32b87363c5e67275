"""The mechanism of a machine: legs or a point mass.

One set of kernels serves every machine: ``kind`` determines whether a "joint" is a joint of a leg or a Cartesian axis
of a point mass. The first axis of arrays is that of the legs.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.leg import Leg, Trig, inverse_dynamics, joint_torque, trigonometry, turned_trigonometry
from cmacexp.typing import Array

POINT_MASS = 0
LEGS_ON_STAND = 1
LEGS_UNDER_BODY = 2


class Mechanism(NamedTuple):
    """Geometry and masses of a machine; L is the number of its legs."""

    kind: int
    """POINT_MASS, LEGS_ON_STAND or LEGS_UNDER_BODY."""
    legs: Array
    """(L, 5): the fields of :class:`Leg`; of a point mass only ``mass_2`` counts."""
    hip_height: float
    """Height of the hips above the undepressed ground, m; of a body its planned height, h0."""
    hips: Array
    """(L, 2): hips in the body frame, x forward and y left of the centre of gravity, m."""
    weight: float
    """Weight that the feet carry together, N; 0 without a body."""


@kernel
def get_leg(mechanism: Mechanism, i: int) -> Leg:
    """Leg ``i`` of the machine."""
    legs = mechanism.legs
    return Leg(legs[i, 0], legs[i, 1], legs[i, 2], legs[i, 3], legs[i, 4])


@kernel
def get_trig(trig: Array, i: int) -> Trig:
    """Row ``i`` of ``trig`` (L, 4), as :func:`trigonometries` fills it."""
    return trig[i, 0], trig[i, 1], trig[i, 2], trig[i, 3]


@kernel
def trigonometries(mechanism: Mechanism, q: Array, trig: Array) -> None:
    """Sines and cosines of the joint angles ``q`` (L, 2), rad; fills ``trig`` (L, 4). A point mass has none."""
    if mechanism.kind != POINT_MASS:
        for i in range(q.shape[0]):
            trig[i, 0], trig[i, 1], trig[i, 2], trig[i, 3] = trigonometry(q[i, 0], q[i, 1])


@kernel
def turned_trigonometries(mechanism: Mechanism, q: Array, trig: Array, near_q: Array, near: Array) -> None:
    """:func:`trigonometries` in less time, from ``near`` (L, 4) of angles ``near_q`` (L, 2) close to ``q``."""
    if mechanism.kind != POINT_MASS:
        for i in range(q.shape[0]):
            trig[i, 0], trig[i, 1], trig[i, 2], trig[i, 3] = turned_trigonometry(
                q[i, 0], q[i, 1], get_trig(near, i), near_q[i, 0], near_q[i, 1]
            )


@kernel
def torque_for(mechanism: Mechanism, i: int, trig: Array, fx: float, fy: float) -> tuple[float, float]:
    """J^T U of leg ``i``, N m; J is the identity for a point mass (Lin & Song 1997, Fig. 1).

    ``trig`` (L, 4) is filled by :func:`trigonometries`.
    """
    if mechanism.kind == POINT_MASS:
        return fx, fy
    return joint_torque(get_leg(mechanism, i), get_trig(trig, i), fx, fy)


@kernel
def planned_torque(
    mechanism: Mechanism, i: int, q: Array, dq: Array, ddq: Array, force: float
) -> tuple[float, float]:
    """Torque (N m) that gives leg ``i`` ``ddq`` at ``q``, ``dq``, each (2,), against ``force`` N (eq. 2, 16, 17)."""
    leg = get_leg(mechanism, i)
    if mechanism.kind == POINT_MASS:
        return leg.mass_2 * ddq[0], leg.mass_2 * ddq[1] + force
    return inverse_dynamics(leg, trigonometry(q[0], q[1]), dq[0], dq[1], ddq[0], ddq[1], force)


def point_mass(mass: float, hip_height: float) -> Mechanism:
    """A machine that is one point mass of ``mass`` kg."""
    return Mechanism(POINT_MASS, np.array([[1.0, 1.0, 0.0, mass, 1.0]]), hip_height, np.zeros((1, 2)), 0.0)


def legs_on_stand(legs: list[Leg], hip_height: float) -> Mechanism:
    """A machine whose hips do not move."""
    return Mechanism(LEGS_ON_STAND, np.array(legs, dtype=float), hip_height, np.zeros((len(legs), 2)), 0.0)


def legs_under_body(legs: list[Leg], hip_height: float, hips: list[tuple[float, float]], weight: float) -> Mechanism:
    """A machine whose body moves so that the feet carry ``weight`` N."""
    return Mechanism(LEGS_UNDER_BODY, np.array(legs, dtype=float), hip_height, np.array(hips, dtype=float), weight)
