"""Commands replayed through a model with its base held, with derivatives over the parameters of the joints.

One block of joints at a time, its equations expanded along the log:

    (M + a) dv/dt = w - kp q - kd v + o + s z(q) - b v - F(q) sign(v) - bias(q, v),

with w = kp c + kd dc + u of the drives, and z from -1 to 1 over the range of the joint. Friction is dry: a joint
sticks as long as F(q) can hold it.
Leapfrog: forces at the angles of the middle of a step, damping as the mean of both ends, friction by the new
velocity; of second order, so that it adds no damping of its own.
"""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import copy_array, kernel, program
from cmacexp.models.joint import OWN
from cmacexp.typing import Array, Counts

SUBSTEP = 1e-3
"""Longest step of the replay, s."""
SWEEPS = 30
"""Most sweeps of the Gauss-Seidel iteration that decides which joints stick."""
CONVERGED = 1e-10
"""Largest change of a velocity in the last sweep, rad/s."""


class Expansion(NamedTuple):
    """Equations of motion of a block of B joints along a motion of N rows, to first order in the angles."""

    angle: Array
    """(N, B) angles at which the equations are expanded, rad."""
    mass: Array
    """(N, B, B) joint-space inertia without rotors, kg m^2."""
    bias: Array
    """(N, B) torque of gravity, Coriolis and centrifugal forces, and springs of the model, N m."""
    gradient: Array
    """(N, B, B) derivative of the bias over the angles, N m/rad."""


class DriveTerms(NamedTuple):
    """Torque and gains of the drives of a block of B joints; each row is held for one sampling period."""

    torque: Array
    """(N, B) w, the torque at angle and velocity zero, N m: from commanded angles, velocities and feedforward."""
    kp: Array
    """(B,) N m/rad."""
    kd: Array
    """(B,) N m s/rad."""

    def choose(self, joints: Counts) -> "DriveTerms":
        """Return the drives of some of the joints, by their numbers."""
        return DriveTerms(*(values[..., joints] for values in self))


def make_drive(command: Array, rate: Array, feedforward: Array, kp: Array, kd: Array) -> DriveTerms:
    """Return the drives for commanded angles, rad, and velocities, rad/s, and a feedforward torque, N m, (N, B) each.

    The gains ``kp``, N m/rad, and ``kd``, N m s/rad, are (B,).
    """
    return DriveTerms(kp * command + kd * rate + feedforward, kp, kd)


class JointParams(NamedTuple):
    """Parameters of a block of B joints, as one row each: a, b, o, s and F at K knots over the range."""

    values: Array
    """(B, 4 + K): kg m^2, N m s/rad, N m, N m, N m."""
    ranges: Array
    """(2, B) least and largest angles of the ranges over which friction and spring are defined, rad."""
    delay: float
    """Time by which commands act later than their rows, s."""


class Forces(NamedTuple):
    """Further torques, linear in E parameters, such as masses of links."""

    torque: Array
    """(N, B, E), N m for each unit of a parameter."""
    weights: Array
    """(E,) values of the parameters."""


class Replay(NamedTuple):
    """Replayed motion of a block, one row for each row of the log."""

    angle: Array
    """(N, B), rad."""
    velocity: Array
    """(N, B), rad/s."""
    angle_by: Array
    """(N, B, P) derivative over the parameters: (4 + K) of each joint in turn, the delay, those of ``forces``.

    P is 0 without derivatives.
    """


class Terms(NamedTuple):
    """Terms of the momentum balance that a replay does not change."""

    equations: Expansion
    drive: DriveTerms
    params: JointParams
    forces: Forces


class Motion(NamedTuple):
    """Angles and velocities of a block within a step, and their derivatives over the P parameters."""

    q: Array
    """(B,), rad."""
    v: Array
    """(B,), rad/s."""
    dq: Array
    """(B, P)."""
    dv: Array
    """(B, P)."""


class Balance(NamedTuple):
    """Momentum balance of a step of length h: ``inertia`` times new velocities equals ``momentum`` less friction."""

    inertia: Array
    """(B, B) inertia with half a step of damping, kg m^2; the elimination overwrites it."""
    momentum: Array
    """(B,) momentum after the step without dry friction, N m s."""
    momentum_by: Array
    """(B, P) its derivative over the parameters."""
    torque: Array
    """(B,) mean of w over the step, N m."""
    torque_by_delay: Array
    """(B,) h times the derivative of ``torque`` over the delay, N m."""
    unit: Array
    """(B,) angles over the range of each joint, 0 to 1 within it."""
    friction: Array
    """(B,) largest momentum that dry friction takes in the step, N m s."""
    friction_slope: Array
    """(B,) derivative of dry friction over the angle, N m/rad; 0 outside of the range."""
    direction: Array
    """(B,) direction in which each joint slides, -1 or 1; 0: it sticks."""


def replay(
    expansion: Expansion,
    drive: DriveTerms,
    params: JointParams,
    period: float,
    start: tuple[Array, Array] | Array,
    forces: Array | None = None,
    weights: Array | None = None,
    derive: bool = False,
) -> Replay:
    """Replay N rows of ``period`` seconds from the angles, rad, and velocities, rad/s, of ``start`` (2, B).

    ``forces`` (N, B, E) are torques for each unit of further parameters, whose values are ``weights`` (E,). With
    ``derive`` the derivatives over all parameters are computed too.
    """
    rows, size = expansion.angle.shape
    further = Forces(
        np.zeros((rows, size, 0)) if forces is None else np.ascontiguousarray(forces),
        np.zeros(0) if weights is None else weights,
    )
    count = size * params.values.shape[1] + 1 + further.torque.shape[2] if derive else 0
    replayed = Replay(np.zeros((rows, size)), np.zeros((rows, size)), np.zeros((rows, size, count)))
    motion = Motion(np.array(start[0]), np.array(start[1]), np.zeros((size, count)), np.zeros((size, count)))
    balance = Balance(np.zeros((size, size)), np.zeros(size), np.zeros((size, count)), *np.zeros((6, size)))
    equations = expansion._replace(mass=expansion.mass + np.diag(params.values[:, 0]))
    substeps = math.ceil(period / SUBSTEP - 1e-9)
    take_rows(
        Terms(
            Expansion(*map(np.ascontiguousarray, equations)),
            DriveTerms(*map(np.ascontiguousarray, drive)),
            JointParams(
                np.ascontiguousarray(params.values), np.ascontiguousarray(params.ranges), float(params.delay)
            ),
            further,
        ),
        (period / substeps, substeps),
        motion,
        replayed,
        balance,
    )
    return replayed


@program
def take_rows(
    terms: Terms,
    steps: tuple[float, int],
    motion: Motion,
    replayed: Replay,
    balance: Balance,
) -> None:
    """Take all rows of a replay, see :func:`replay`; fill ``replayed``, and change ``motion`` and ``balance``.

    ``steps`` are the length of a step, s, and the number of steps in each row.
    """
    h, substeps = steps
    drive = terms.drive
    params = terms.params
    for k in range(replayed.angle.shape[0]):
        copy_array(motion.q, replayed.angle[k])
        copy_array(motion.v, replayed.velocity[k])
        copy_array(motion.dq, replayed.angle_by[k])
        for s in range(substeps):
            drift(h, motion)
            average_torque(k + (s * h - params.delay) / (substeps * h), 1.0 / substeps, drive.torque, balance)
            interpolate_friction(h, params, motion.q, balance)
            set_balance(k, h, terms, motion, balance)
            if motion.dq.shape[1]:
                derive_balance(k, h, terms, motion, balance)
            slide(motion.v, balance)
            if motion.dq.shape[1]:
                derive_friction(h, params.values, motion, balance)
                solve_derivatives(motion.dv, balance)
            drift(h, motion)


@kernel
def drift(h: float, motion: Motion) -> None:
    """Advance the angles in ``motion``, and their derivatives, by half a step ``h``, s, at constant velocity."""
    q, v, dq, dv = motion
    for i in range(dq.shape[0]):
        q[i] += 0.5 * h * v[i]
        for p in range(dq.shape[1]):
            dq[i, p] += 0.5 * h * dv[i, p]


@kernel
def average_torque(begin: float, duration: float, torques: Array, balance: Balance) -> None:
    """Fill ``torque`` and ``torque_by_delay`` of the balance from the ``torques`` (N, B) of the rows, N m.

    The step begins at the fractional row ``begin`` and takes ``duration`` rows. Before the first row the torque is
    that of the first row, after the last row that of the last row.
    """
    end = begin + duration
    first, last = int(np.floor(begin)), int(np.floor(end))
    share = (last - begin) / (end - begin) if last > first else 1.0
    first, last = min(max(first, 0), torques.shape[0] - 1), min(max(last, 0), torques.shape[0] - 1)
    for i in range(torques.shape[1]):
        balance.torque[i] = share * torques[first, i] + (1.0 - share) * torques[last, i]
        balance.torque_by_delay[i] = torques[first, i] - torques[last, i]


@kernel
def locate_knot(unit: float, knots: int) -> tuple[int, int, float]:
    """Return the ``knots`` next to an angle, below and above it, and the weight of the upper one in interpolation.

    ``unit`` is the angle over the range of its joint, 0 to 1; beyond them it is clipped.
    """
    position = min(max(unit, 0.0), 1.0) * (knots - 1)
    below = min(int(position), max(knots - 2, 0))
    return below, min(below + 1, knots - 1), position - below


@kernel
def interpolate_friction(h: float, params: JointParams, q: Array, balance: Balance) -> None:
    """Fill ``unit``, ``friction`` and ``friction_slope`` of the balance at the angles ``q`` (B,), rad."""
    values, ranges, _ = params
    knots = values.shape[1] - OWN
    for i in range(values.shape[0]):
        width = ranges[1, i] - ranges[0, i]
        unit = (q[i] - ranges[0, i]) / width
        below, above, share = locate_knot(unit, knots)
        balance.unit[i] = unit
        balance.friction[i] = h * ((1.0 - share) * values[i, OWN + below] + share * values[i, OWN + above])
        slope = (values[i, OWN + above] - values[i, OWN + below]) * (knots - 1) / width
        balance.friction_slope[i] = slope * (0.0 < unit < 1.0)


@kernel
def set_balance(k: int, h: float, terms: Terms, motion: Motion, balance: Balance) -> None:
    """Fill ``inertia`` and ``momentum`` of the balance of a step ``h``, s, in row ``k``, without dry friction."""
    equations, drive, params, forces = terms
    angle, mass, bias, gradient = equations
    values = params.values
    q, v, _, _ = motion
    inertia, momentum = balance.inertia, balance.momentum
    size = mass.shape[1]
    for i in range(size):
        spring = values[i, 2] + values[i, 3] * (2.0 * balance.unit[i] - 1.0)
        torque = balance.torque[i] - drive.kp[i] * q[i] - bias[k, i] + spring
        for j in range(size):
            torque -= gradient[k, i, j] * (q[j] - angle[k, j])
        for e in range(forces.weights.shape[0]):
            torque += forces.torque[k, i, e] * forces.weights[e]
        damping = 0.5 * h * (values[i, 1] + drive.kd[i])
        momentum[i] = h * torque - damping * v[i]
        for j in range(size):
            momentum[i] += mass[k, i, j] * v[j]
            inertia[i, j] = mass[k, i, j]
        inertia[i, i] += damping


@kernel
def derive_balance(k: int, h: float, terms: Terms, motion: Motion, balance: Balance) -> None:
    """Fill ``momentum_by`` of the balance of a step ``h``, s, in row ``k``, without the terms of the new velocity.

    Those are friction, and damping and inertia at the end of the step: :func:`derive_friction` adds them.
    """
    equations, drive, params, forces = terms
    _, mass, _, gradient = equations
    values, ranges, _ = params
    _, v, dq, dv = motion
    by = balance.momentum_by
    size, width = values.shape
    for i in range(size):
        stiffness = 2.0 * values[i, 3] / (ranges[1, i] - ranges[0, i])
        for p in range(by.shape[1]):
            by[i, p] = h * (stiffness - drive.kp[i]) * dq[i, p]
            by[i, p] -= 0.5 * h * (values[i, 1] + drive.kd[i]) * dv[i, p]
            for j in range(size):
                by[i, p] += mass[k, i, j] * dv[j, p] - h * gradient[k, i, j] * dq[j, p]
        by[i, i * width] += v[i]
        by[i, i * width + 1] -= 0.5 * h * v[i]
        by[i, i * width + 2] += h
        by[i, i * width + 3] += h * (2.0 * balance.unit[i] - 1.0)
        by[i, size * width] += balance.torque_by_delay[i]
        for e in range(forces.weights.shape[0]):
            by[i, size * width + 1 + e] += h * forces.torque[k, i, e]


@kernel
def slide(v: Array, balance: Balance) -> None:
    """Set the velocities ``v`` (B,), rad/s, at the end of a step, and the ``direction`` in which each joint slides.

    The balance is solved joint by joint, with the newest velocities of the others, until none changes (Gauss-Seidel).
    """
    for _sweep in range(SWEEPS):
        change = 0.0
        for i in range(v.shape[0]):
            before = v[i]
            momentum = balance.momentum[i]
            for j in range(v.shape[0]):
                if j != i:
                    momentum -= balance.inertia[i, j] * v[j]
            friction = balance.friction[i]
            side = 1.0 if momentum > friction else -1.0 if momentum < -friction else 0.0
            v[i] = (momentum - side * friction) / balance.inertia[i, i] if side != 0.0 else 0.0
            balance.direction[i] = side
            change = max(change, abs(v[i] - before))
        if change < CONVERGED:
            break


@kernel
def derive_friction(h: float, values: Array, motion: Motion, balance: Balance) -> None:
    """Add the terms of the new velocity, friction among them, to ``momentum_by``; set it to 0 where a joint sticks.

    ``values`` (B, 4 + K) are those of :class:`JointParams`; the step takes ``h``, s.
    """
    _, v, dq, _ = motion
    by = balance.momentum_by
    width = values.shape[1]
    for i in range(values.shape[0]):
        side = balance.direction[i]
        for p in range(by.shape[1]):
            by[i, p] = (by[i, p] - h * side * balance.friction_slope[i] * dq[i, p]) * (side != 0.0)
        by[i, i * width] -= v[i]
        by[i, i * width + 1] -= 0.5 * h * v[i]
        below, above, share = locate_knot(balance.unit[i], width - OWN)
        by[i, i * width + OWN + below] -= h * side * (1.0 - share)
        by[i, i * width + OWN + above] -= h * side * share


@kernel
def solve_derivatives(dv: Array, balance: Balance) -> None:
    """Fill ``dv`` (B, P) by Gauss-Jordan elimination among the joints that slide; it is 0 where a joint sticks."""
    inertia = balance.inertia
    by = balance.momentum_by
    side = balance.direction
    size, count = by.shape
    for i in range(size):
        for j in range(size):
            if j != i and side[i] != 0.0 and side[j] != 0.0:
                ratio = inertia[j, i] / inertia[i, i]
                for m in range(i, size):
                    inertia[j, m] -= ratio * inertia[i, m]
                for p in range(count):
                    by[j, p] -= ratio * by[i, p]
    for i in range(size):
        for p in range(count):
            dv[i, p] = by[i, p] / inertia[i, i] * (side[i] != 0.0)
