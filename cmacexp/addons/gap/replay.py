"""Commands replayed through a model with its base held, and how the replay depends on the parameters of the joints.

One block of joints at a time, its equations expanded along the log:

    (M + a) dv/dt = w - kp q - kd v + o + s z(q) - b v - F(q) sign(v) - bias(q, v),

with w = kp c + kd dc + u of the drives, and z from -1 to 1 over the range of the joint. Friction is dry: a joint
sticks as long as F(q) can hold it.
Leapfrog: forces at the angles of the middle of a step, damping as the mean of both ends, friction by the new
velocity; of second order, so that it adds no damping of its own.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from cmacexp.addons.gap.machine import Expansion
from cmacexp.jit.compiler import copy_array, program
from cmacexp.typing import Array

SUBSTEP = 1e-3
"""Longest step of the replay, s."""
SWEEPS, CONVERGED = 30, 1e-10
"""Most sweeps of the Gauss-Seidel iteration that decides which joints stick, and the last change of a velocity in it,
rad/s."""


class Drive(NamedTuple):
    """What the drives of a block of B joints do; rows are held for one sampling period."""

    torque: Array
    """(N, B) w, at rest at the angle zero, N m: of commanded angles, velocities and feedforward."""
    kp: Array
    """(B,) N m/rad."""
    kd: Array
    """(B,) N m s/rad."""


def make_drive(command: Array, rate: Array, feedforward: Array, kp: Array, kd: Array) -> Drive:
    """Drives with commanded angles, rad, and velocities, rad/s, and a torque beside their feedback, N m, (N, B)."""
    return Drive(kp * command + kd * rate + feedforward, kp, kd)


class JointParams(NamedTuple):
    """Parameters of a block of B joints, as one row each: a, b, o, s and F at K knots over the range."""

    values: Array
    """(B, 4 + K): kg m^2, N m s/rad, N m, N m, N m."""
    ranges: Array
    """(2, B) least and largest angles of the ranges over which friction and spring are given, rad."""
    delay: float
    """Time by which commands act later than their rows, s."""


class Replay(NamedTuple):
    """What a replay gives at each row."""

    angle: Array
    """(N, B), rad."""
    velocity: Array
    """(N, B), rad/s."""
    angle_by: Array
    """(N, B, P) derivative over the parameters: (4 + K) of each joint in turn, the delay, those of ``forces``."""


def replay(
    expansion: Expansion,
    drive: Drive,
    params: JointParams,
    period: float,
    start: tuple[Array, Array] | Array,
    forces: Array | None = None,
    weights: Array | None = None,
    derive: bool = False,
) -> Replay:
    """Replay N rows of ``period`` seconds from angles and velocities ``start`` (2, B).

    ``forces`` (N, B, E) are torques for each unit of further parameters, whose values are ``weights`` (E,). With
    ``derive`` the derivatives over all parameters are computed too.
    """
    rows, size = expansion.angle.shape
    further = np.zeros((rows, size, 0)) if forces is None else np.ascontiguousarray(forces)
    own = np.zeros(further.shape[2]) if weights is None else weights
    count = size * params.values.shape[1] + 1 + further.shape[2] if derive else 0
    found = Replay(np.zeros((rows, size)), np.zeros((rows, size)), np.zeros((rows, size, count)))
    scratch = (np.zeros((size, size)), tuple(np.zeros((6, size))), tuple(np.zeros((3, size, count))))
    equations = expansion._replace(mass=expansion.mass + np.diag(params.values[:, 0]))
    inputs = (tuple(map(np.ascontiguousarray, each)) for each in (equations, drive, (params.values, *params.ranges)))
    substeps = math.ceil(period / SUBSTEP - 1e-9)
    taken: Any = take_rows
    taken(*inputs, params.delay, further, own, period / substeps, substeps, tuple(np.array(start)), found, scratch)
    return found


@program
def take_rows(equations, drive, params, delay, further, own, h, substeps, state, found, scratch):  # type: ignore
    """Take all rows of a replay, see :func:`replay`; fills ``found``, changes ``state`` and ``scratch``."""
    at, mass, bias_of, gradient_of = equations
    torques, kp, kd = drive
    values, low, high = params
    q, v = state
    angle, velocity, angle_by = found
    factor, (target, right, slope, side, dry, place), (dq, dv, new) = scratch
    rows, size = angle.shape
    width, count, extra = values.shape[1], angle_by.shape[2], further.shape[2]
    knots = width - 4
    for k in range(rows):
        copy_array(q, angle[k])
        copy_array(v, velocity[k])
        copy_array(dq, angle_by[k])
        for s in range(substeps):
            begin = k + (s * h - delay) / (substeps * h)
            end = begin + 1.0 / substeps
            first, last = int(np.floor(begin)), int(np.floor(end))
            part = (last - begin) / (end - begin) if last > first else 1.0
            first, last = min(max(first, 0), rows - 1), min(max(last, 0), rows - 1)
            for i in range(size):
                q[i] += 0.5 * h * v[i]
                for p in range(count):
                    dq[i, p] += 0.5 * h * dv[i, p]
            for i in range(size):
                target[i] = torques[first, i] - torques[last, i]  # h d(torque)/d(delay)
                unit = (q[i] - low[i]) / (high[i] - low[i])
                given = part * torques[first, i] + (1.0 - part) * torques[last, i] - kp[i] * q[i]
                total = given - bias_of[k, i] + (values[i, 2] + values[i, 3] * (2.0 * unit - 1.0))
                for j in range(size):
                    total -= gradient_of[k, i, j] * (q[j] - at[k, j])
                for e in range(extra):
                    total += further[k, i, e] * own[e]
                right[i] = h * total - 0.5 * h * (values[i, 1] + kd[i]) * v[i]
                for j in range(size):
                    right[i] += mass[k, i, j] * v[j]
                    factor[i, j] = mass[k, i, j]
                factor[i, i] += 0.5 * h * (values[i, 1] + kd[i])
                place[i] = min(max(unit, 0.0), 1.0) * (knots - 1)
                below = min(int(place[i]), max(knots - 2, 0))
                share, above = place[i] - below, min(below + 1, knots - 1)
                dry[i] = h * ((1.0 - share) * values[i, 4 + below] + share * values[i, 4 + above])
                slope[i] = (values[i, 4 + above] - values[i, 4 + below]) * (knots - 1) / (high[i] - low[i])
                slope[i] *= 0.0 < unit < 1.0
                for p in range(count):  # b as in factor @ dv = b, before what the new velocity decides
                    new[i, p] = h * (2.0 * values[i, 3] / (high[i] - low[i]) - kp[i]) * dq[i, p]
                    new[i, p] -= 0.5 * h * (values[i, 1] + kd[i]) * dv[i, p]
                    for j in range(size):
                        new[i, p] += mass[k, i, j] * dv[j, p] - h * gradient_of[k, i, j] * dq[j, p]
                if count:
                    new[i, i * width] += v[i]
                    new[i, i * width + 1] -= 0.5 * h * v[i]
                    new[i, i * width + 2] += h
                    new[i, i * width + 3] += h * (2.0 * unit - 1.0)
                    new[i, size * width] += target[i]
                    for e in range(extra):
                        new[i, size * width + 1 + e] += h * further[k, i, e]
            for _sweep in range(SWEEPS):
                change = 0.0
                for i in range(size):
                    before = v[i]
                    total = right[i]
                    for j in range(size):
                        if j != i:
                            total -= factor[i, j] * v[j]
                    side[i] = 1.0 if total > dry[i] else -1.0 if total < -dry[i] else 0.0
                    v[i] = (total - side[i] * dry[i]) / factor[i, i] if side[i] != 0.0 else 0.0
                    change = max(change, abs(v[i] - before))
                if change < CONVERGED:
                    break
            if count:
                for i in range(size):
                    for p in range(count):
                        new[i, p] = (new[i, p] - h * side[i] * slope[i] * dq[i, p]) * (side[i] != 0.0)
                    new[i, i * width] -= v[i]
                    new[i, i * width + 1] -= 0.5 * h * v[i]
                    below = min(int(place[i]), max(knots - 2, 0))
                    share = place[i] - below
                    new[i, i * width + 4 + below] -= h * side[i] * (1.0 - share)
                    new[i, i * width + 4 + min(below + 1, knots - 1)] -= h * side[i] * share
                for i in range(size):  # Gauss-Jordan elimination among the joints that move; the others stay at rest
                    if side[i] != 0.0:
                        for j in range(size):
                            ratio = factor[j, i] / factor[i, i]
                            if j != i and side[j] != 0.0:
                                for m in range(i, size):
                                    factor[j, m] -= ratio * factor[i, m]
                                for p in range(count):
                                    new[j, p] -= ratio * new[i, p]
            for i in range(size):
                q[i] += 0.5 * h * v[i]
                for p in range(count):
                    dv[i, p] = new[i, p] / factor[i, i] * (side[i] != 0.0)
                    dq[i, p] += 0.5 * h * dv[i, p]
