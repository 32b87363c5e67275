"""Kinematics of a leg with three hinges in space, by the product of exponentials (Brockett 1984).

Frame of a hip: x forward, y down, z to the left; the first two are those of a planar leg. A hinge is given at zero
joint angles by a point of its axis and the direction of the axis: no frames of links are needed.
"""

from typing import Any, NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.sine import sine_cosine
from cmacexp.typing import Array

HINGES = 3
HINGE_FIELDS = 6
"""Number of values of a hinge in a row of a chain: a point of its axis (m), then the unit direction of the axis."""
FOOT = HINGES * HINGE_FIELDS
"""Index of the foot in a row of a chain."""
CHAIN_FIELDS = FOOT + 3
"""Number of values of a chain: its hinges, from the body outwards, then the foot (m)."""

Vector = tuple[Any, Any, Any]
"""Three numbers, or three arrays: outside compiled programs the kernels also work on arrays."""
Turn = tuple[Any, Any]
"""Sine and cosine of an angle, or arrays of them."""
MOST_ITERATIONS = 50
CLOSE_ENOUGH = 1e-13
"""Distance of a foot from its target at which the search for joint angles ends, m."""

SIDEWAYS = 0.01
"""Distance of a foot to the side of its frame's origin, over its depth, up to which it stands below the origin."""


class Kinematics(NamedTuple):
    """Foot (3,), m, and columns (3,) of its Jacobian, m/rad, one for each joint."""

    foot: Vector
    hip: Vector
    thigh: Vector
    calf: Vector


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product a x b (3,) of two vectors (3,) of any unit."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product a . b of two vectors (3,) of any unit."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def rotate(v: Vector, axis: Vector, sine: float, cosine: float) -> Vector:
    """Rotate ``v`` (3,), of any unit, about the unit vector ``axis`` (3,) through the origin (Rodrigues)."""
    along = (axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]) * (1.0 - cosine)
    beside = cross(axis, v)
    return (
        v[0] * cosine + beside[0] * sine + axis[0] * along,
        v[1] * cosine + beside[1] * sine + axis[1] * along,
        v[2] * cosine + beside[2] * sine + axis[2] * along,
    )


@kernel
def hinge_point(chain: Array, n: int) -> Vector:
    """Return a point (3,), m, of the axis of hinge ``n`` of a ``chain`` (21,) at zero joint angles."""
    k = HINGE_FIELDS * n
    return chain[k], chain[k + 1], chain[k + 2]


@kernel
def hinge_axis(chain: Array, n: int) -> Vector:
    """Return the unit direction (3,) of the axis of hinge ``n`` of a ``chain`` (21,) at zero joint angles."""
    k = HINGE_FIELDS * n + 3
    return chain[k], chain[k + 1], chain[k + 2]


@kernel
def turn_at(chain: Array, n: int, point: Vector, sine: float, cosine: float) -> Vector:
    """Rotate ``point`` (3,), m, about hinge ``n`` of a ``chain`` (21,) by the angle of ``sine`` and ``cosine``."""
    at = hinge_point(chain, n)
    turned = rotate((point[0] - at[0], point[1] - at[1], point[2] - at[2]), hinge_axis(chain, n), sine, cosine)
    return at[0] + turned[0], at[1] + turned[1], at[2] + turned[2]


@kernel
def lever(chain: Array, n: int, point: Vector) -> Vector:
    """Compute the velocity of ``point`` (3,), m, per velocity of hinge ``n`` of a ``chain`` (21,): (3,), m/rad."""
    at = hinge_point(chain, n)
    return cross(hinge_axis(chain, n), (point[0] - at[0], point[1] - at[1], point[2] - at[2]))


@kernel
def chain_kinematics(chain: Array, q1: float, q2: float, q3: float) -> Kinematics:
    """Compute foot (3,), m, and Jacobian columns (3,), m/rad, of a ``chain`` (21,) at joint angles, rad."""
    return kinematics_at(chain, sine_cosine(q1), sine_cosine(q2), sine_cosine(q3))


@kernel
def kinematics_at(chain: Array, turn_1: Turn, turn_2: Turn, turn_3: Turn) -> Kinematics:
    """Compute foot (3,), m, and Jacobian columns (3,), m/rad, of a ``chain`` (21,) from sines and cosines.

    The foot is rotated about the outermost hinge first; each hinge then rotates the result of the hinges outside it.
    """
    s1, c1 = turn_1
    s2, c2 = turn_2
    s3, c3 = turn_3
    first = hinge_axis(chain, 0)
    foot = turn_at(chain, 2, (chain[FOOT], chain[FOOT + 1], chain[FOOT + 2]), s3, c3)
    calf = rotate(rotate(lever(chain, 2, foot), hinge_axis(chain, 1), s2, c2), first, s1, c1)
    foot = turn_at(chain, 1, foot, s2, c2)
    thigh = rotate(lever(chain, 1, foot), first, s1, c1)
    foot = turn_at(chain, 0, foot, s1, c1)
    return Kinematics(foot, lever(chain, 0, foot), thigh, calf)


@kernel
def joint_velocity(kinematics: Kinematics, velocity: Vector) -> Vector:
    """Compute the joint velocities (3,), rad/s, that move the foot with ``velocity`` (3,), m/s, by Cramer's rule."""
    _, hip, thigh, calf = kinematics
    across = cross(thigh, calf)
    volume = dot(hip, across)
    return (
        dot(velocity, across) / volume,
        dot(velocity, cross(calf, hip)) / volume,
        dot(velocity, cross(hip, thigh)) / volume,
    )


def _fill_each(chain: Array, sines: Array, cosines: Array, filled: Array) -> None:
    """Fill ``filled`` (4, 3, N) with feet, m, and Jacobians, m/rad, by :func:`kinematics_at` of each sample.

    Sines and cosines are (3, N).
    """
    for k in range(sines.shape[1]):
        turns = (sines[0, k], cosines[0, k]), (sines[1, k], cosines[1, k]), (sines[2, k], cosines[2, k])
        kinematics = kinematics_at(chain, turns[0], turns[1], turns[2])
        for n in range(4):
            for axis in range(3):
                filled[n, axis, k] = kinematics[n][axis]


def _fill_together(chain: Array, sines: Array, cosines: Array, filled: Array) -> None:
    filled[...] = kinematics_at(chain, *zip(sines, cosines, strict=True))


_fill = program(_fill_each, plain=_fill_together)


def _compute_kinematics(chain: Array, q: Array) -> Array:
    """Compute feet, m, then Jacobian columns, m/rad, of one chain at ``q`` (3, N), rad, as one array (4, 3, N)."""
    filled = np.empty((4, *q.shape))
    _fill(chain, np.sin(q, order="C"), np.cos(q, order="C"), filled)
    return filled


def batch_kinematics(chain: Array, q: Array) -> tuple[Array, Array]:
    """Compute feet (N, 3), m, and Jacobians (N, 3, 3), m/rad, of one chain at ``q`` (N, 3), rad."""
    kinematics = _compute_kinematics(chain, q.T)
    return kinematics[0].T.copy(), kinematics[1:].T.copy()


def _solve(kinematics: Array, velocity: Array) -> Array:
    """Apply :func:`joint_velocity` to velocities (3, N), m/s.

    The result (3, N), rad/s, is not finite where a Jacobian is singular.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.array(joint_velocity(Kinematics(*kinematics), tuple(velocity)))


def chain_angles(chain: Array, feet: Array, start: Array) -> Array:
    """Find joint angles (N, 3), rad, that put the foot at each of ``feet`` (N, 3), m, by Newton's method.

    Angles are NaN where none are found. The search begins at ``start``, (3,) or (N, 3), rad, which decides to which
    side the knee bends.
    """
    q = np.atleast_2d(start).T
    for _ in range(MOST_ITERATIONS):
        kinematics = _compute_kinematics(chain, q)
        missing = feet.T - kinematics[0]
        if not np.fmax.reduce(np.abs(missing), axis=None) > CLOSE_ENOUGH:  # NaN does not count
            break
        step = _solve(kinematics, missing)
        q = q + step * np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=0), 1e-12))
    return np.where(np.abs(missing).max(axis=0) <= 1e3 * CLOSE_ENOUGH, q, np.nan).T


def find_lateral(chain: Array, home: Array, height: float) -> float:
    """Find how far to the left of the origin a foot is, m, when it is ``height``, m, below it at home's hip angle.

    Thigh and calf move from ``home`` (3,), rad, by Newton's method, until the foot is neither ahead nor behind. The
    result is 0 where they find no such place, and where it is less than SIDEWAYS of the leg to the side: then the
    foot stands below the origin.
    """
    hip, thigh, calf = map(float, home)
    for _ in range(MOST_ITERATIONS):
        foot, _, by_thigh, by_calf = chain_kinematics(chain, hip, thigh, calf)
        ahead, below = -foot[0], height - foot[1]
        if max(abs(ahead), abs(below)) <= CLOSE_ENOUGH:
            break
        area = by_thigh[0] * by_calf[1] - by_thigh[1] * by_calf[0]
        if abs(area) <= CLOSE_ENOUGH:
            return 0.0
        by_step = (ahead * by_calf[1] - below * by_calf[0]) / area, (below * by_thigh[0] - ahead * by_thigh[1]) / area
        share = min(1.0, 0.5 / max(map(abs, by_step)))
        thigh += share * by_step[0]
        calf += share * by_step[1]
    is_there = max(abs(ahead), abs(below)) <= 1e3 * CLOSE_ENOUGH
    return float(foot[2]) if is_there and abs(foot[2]) > SIDEWAYS * height else 0.0


def chain_motion(chain: Array, q: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
    """Compute joint velocities, rad/s, and accelerations, rad/s^2, (N, 3) each, from the motion of the foot.

    At joint angles ``q``, rad, the foot moves with ``velocity``, m/s, and ``acceleration``, m/s^2, (N, 3) each.

    dJ/dt follows from central differences of J along the joint velocity.
    """
    kinematics = _compute_kinematics(chain, q.T)
    dq = _solve(kinematics, velocity.T)
    size = 1e-4 / np.maximum(np.abs(dq).max(axis=0), 1.0)
    after, before = (_compute_kinematics(chain, q.T + sign * size * dq)[1:] for sign in (1.0, -1.0))
    turning = ((after - before).T.copy() @ dq.T.copy()[..., None])[..., 0].T / (2.0 * size)
    return dq.T, _solve(kinematics, acceleration.T - turning).T


def to_hip(vectors: Array) -> Array:
    """Convert vectors (..., 3) of any unit from body axes (forward, left, up) to hip axes (forward, down, left)."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def make_chains(hinges: Array, feet: Array, origins: Array) -> Array:
    """Make chains (..., 21) of legs in the frames of their hips, whose origins are at ``origins`` (..., 3), m.

    ``hinges`` (..., 3, 6), a point of each axis, m, and its direction, and ``feet`` (..., 3), m, are at zero joint
    angles and in the body frame, as are ``origins``.
    """
    points = to_hip(hinges[..., :3] - origins[..., None, :])
    axes = np.concatenate([points, to_hip(hinges[..., 3:])], axis=-1)
    return np.concatenate([axes.reshape(*feet.shape[:-1], FOOT), to_hip(feet - origins)], axis=-1)


def chain_points(chain: Array, q: Array) -> Array:
    """Compute the points of the three hinges and the foot, (..., 4, 3), m, at joint angles ``q`` (..., 3), rad."""
    points = [hinge_point(chain, n) for n in range(HINGES)] + [tuple(chain[FOOT:])]
    for n in reversed(range(HINGES)):
        angle: Any = q[..., n]  # one posture gives the same bits as many
        sine, cosine = np.sin(angle), np.cos(angle)
        points[n + 1 :] = [turn_at(chain, n, point, sine, cosine) for point in points[n + 1 :]]
    coordinates = [np.broadcast_to(coordinate, q.shape[:-1]) for point in points for coordinate in point]
    return np.stack(coordinates, axis=-1).reshape(*q.shape[:-1], HINGES + 1, 3)
