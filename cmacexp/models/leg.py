"""A planar two-link leg: kinematics, and dynamics with point masses at knee and foot.

The hip is the origin, x forward, y DOWN; theta1 runs from +x to the thigh, theta2 from the thigh to the shank.
Scalars in, scalars out, so that loops compile to straight arithmetic. ``trig`` is the result of :func:`trigonometry`.
"""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.models.sine import LARGEST_ROTATION, rotate, sine_cosine

GRAVITY = 9.81
"""Acceleration of gravity, m/s^2."""
Trig = tuple[float, float, float, float]
Pair = tuple[float, float]


GRAVITY_TERMS = 4
"""Terms of the gravity vector G of eq. 23, in the order in which it is printed: m2 l2 cos(theta1 + theta2),
m1 l1 cos(theta1) and m2 l1 cos(theta1) in the first row, m2 l2 cos(theta1 + theta2) in the second."""


class Leg(NamedTuple):
    """Link lengths (m) and masses (kg) of one leg, and the sign of theta2, ``knee``.

    The last fields are factors of the four :data:`GRAVITY_TERMS`; 1: as printed.
    """

    length_1: float
    length_2: float
    mass_1: float
    mass_2: float
    knee: float
    gravity_12: float = 1.0
    gravity_11: float = 1.0
    gravity_21: float = 1.0
    gravity_22: float = 1.0


@kernel
def trigonometry(q1: float, q2: float) -> Trig:
    """Return sine and cosine of theta1, then of theta1 + theta2, from joint angles in rad."""
    s1, c1 = sine_cosine(q1)
    s12, c12 = sine_cosine(q1 + q2)
    return s1, c1, s12, c12


@kernel
def trigonometry_near(q1: float, q2: float, near: Trig, near_q1: float, near_q2: float) -> Trig:
    """Compute :func:`trigonometry` faster, by rotating ``near``, its result at nearby angles, rad.

    The result is within 1e-15 of :func:`trigonometry`, relative to 1, for angles up to 4 rad, the sum of which is
    rounded as well. If an angle has moved by more than :data:`LARGEST_ROTATION`, the bits are the same.
    """
    by_1 = q1 - near_q1
    by_12 = by_1 + (q2 - near_q2)
    if not (abs(by_1) <= LARGEST_ROTATION and abs(by_12) <= LARGEST_ROTATION):
        return trigonometry(q1, q2)
    s1, c1, s12, c12 = near
    s1, c1 = rotate(s1, c1, by_1)
    s12, c12 = rotate(s12, c12, by_12)
    return s1, c1, s12, c12


@kernel
def foot_position(leg: Leg, trig: Trig) -> Pair:
    """Compute x, y of the foot in the hip frame, m (forward kinematics)."""
    s1, c1, s12, c12 = trig
    return leg.length_1 * c1 + leg.length_2 * c12, leg.length_1 * s1 + leg.length_2 * s12


@kernel
def jacobian(leg: Leg, trig: Trig) -> tuple[float, float, float, float]:
    """Compute the Jacobian d(x, y)/d(theta1, theta2), m/rad, row by row."""
    s1, c1, s12, c12 = trig
    j12 = -leg.length_2 * s12
    j22 = leg.length_2 * c12
    return -leg.length_1 * s1 + j12, j12, leg.length_1 * c1 + j22, j22


@kernel
def foot_velocity(leg: Leg, trig: Trig, dq1: float, dq2: float) -> Pair:
    """Compute the velocity of the foot in the hip frame, J dtheta, m/s."""
    j11, j12, j21, j22 = jacobian(leg, trig)
    return j11 * dq1 + j12 * dq2, j21 * dq1 + j22 * dq2


@kernel
def joint_torque(leg: Leg, trig: Trig, fx: float, fy: float) -> Pair:
    """Compute the joint torques J^T U (N m) that press the foot with U = (fx, fy) N (Lin & Song 1997, Fig. 1)."""
    j11, j12, j21, j22 = jacobian(leg, trig)
    return j11 * fx + j21 * fy, j12 * fx + j22 * fy


@kernel
def inertia(leg: Leg, trig: Trig) -> tuple[float, float, float]:
    """Compute M11, M12, M22 of the inertia matrix, kg m^2 (Lin & Song 1997, eq. 23)."""
    s1, c1, s12, c12 = trig
    m22 = leg.length_2 * leg.length_2 * leg.mass_2
    m12 = m22 + leg.length_1 * leg.length_2 * leg.mass_2 * (c1 * c12 + s1 * s12)
    m11 = 2.0 * m12 - m22 + leg.length_1 * leg.length_1 * (leg.mass_1 + leg.mass_2)
    return m11, m12, m22


@kernel
def bias_torque(leg: Leg, trig: Trig, dq1: float, dq2: float) -> Pair:
    """Compute Coriolis, centrifugal and gravity torques C dtheta + G, N m (Lin & Song 1997, eq. 23).

    The scan of the paper lost the square in the second row of C: it is m2 l1 l2 sin(theta2) dtheta1^2.
    """
    s1, c1, s12, c12 = trig
    coupling = leg.mass_2 * leg.length_1 * leg.length_2 * (s12 * c1 - c12 * s1)
    weight_2 = leg.mass_2 * leg.length_2 * c12 * GRAVITY
    weight_1 = (leg.gravity_11 * leg.mass_1 + leg.gravity_21 * leg.mass_2) * leg.length_1 * c1 * GRAVITY
    coriolis_1 = -coupling * (dq2 * dq2 + 2.0 * dq1 * dq2)
    return coriolis_1 - leg.gravity_12 * weight_2 - weight_1, coupling * dq1 * dq1 - leg.gravity_22 * weight_2


@kernel
def forward_dynamics(leg: Leg, trig: Trig, dq1: float, dq2: float, tau_1: float, tau_2: float, force: float) -> Pair:
    """Compute joint accelerations, rad/s^2, under torques (N m) and a contact force (N) (Lin & Song 1997, eq. 17)."""
    m11, m12, m22 = inertia(leg, trig)
    bias_1, bias_2 = bias_torque(leg, trig, dq1, dq2)
    contact_1, contact_2 = joint_torque(leg, trig, 0.0, force)
    net_1 = tau_1 - bias_1 - contact_1
    net_2 = tau_2 - bias_2 - contact_2
    determinant = m11 * m22 - m12 * m12
    return (m22 * net_1 - m12 * net_2) / determinant, (m11 * net_2 - m12 * net_1) / determinant


@kernel
def inverse_dynamics(leg: Leg, trig: Trig, dq1: float, dq2: float, ddq1: float, ddq2: float, force: float) -> Pair:
    """Compute joint torques, N m, for accelerations (rad/s^2) and a contact force (N) (Lin & Song 1997, eq. 16)."""
    m11, m12, m22 = inertia(leg, trig)
    bias_1, bias_2 = bias_torque(leg, trig, dq1, dq2)
    contact_1, contact_2 = joint_torque(leg, trig, 0.0, force)
    return m11 * ddq1 + m12 * ddq2 + bias_1 + contact_1, m12 * ddq1 + m22 * ddq2 + bias_2 + contact_2


@kernel
def inverse_kinematics(leg: Leg, x: float, y: float) -> Pair:
    """Compute the joint angles, rad, that put the foot at (x, y), m; NaN out of reach.

    theta2 has the sign of ``leg.knee``.
    """
    cosine = (x * x + y * y - leg.length_1 * leg.length_1 - leg.length_2 * leg.length_2) / (
        2.0 * leg.length_1 * leg.length_2
    )
    if not -1.0 <= cosine <= 1.0:
        return math.nan, math.nan
    q2 = leg.knee * math.acos(cosine)
    return math.atan2(y, x) - math.atan2(leg.length_2 * math.sin(q2), leg.length_1 + leg.length_2 * cosine), q2


@kernel
def joint_velocity(leg: Leg, trig: Trig, vx: float, vy: float) -> Pair:
    """Compute the joint velocities J^-1 v, rad/s, that move the foot with v = (vx, vy) m/s."""
    j11, j12, j21, j22 = jacobian(leg, trig)
    determinant = j11 * j22 - j12 * j21
    return (j22 * vx - j12 * vy) / determinant, (j11 * vy - j21 * vx) / determinant


@kernel
def joint_acceleration(leg: Leg, trig: Trig, dq1: float, dq2: float, ax: float, ay: float) -> Pair:
    """Compute joint accelerations J^-1 (a - dJ dtheta), rad/s^2, that give the foot a = (ax, ay) m/s^2."""
    s1, c1, s12, c12 = trig
    turn_1 = leg.length_1 * dq1 * dq1
    turn_2 = leg.length_2 * (dq1 + dq2) * (dq1 + dq2)
    return joint_velocity(leg, trig, ax + turn_1 * c1 + turn_2 * c12, ay + turn_1 * s1 + turn_2 * s12)
