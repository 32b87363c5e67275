"""What MuJoCo is told of the ground, and what is measured of its machine, as compiled kernels.

MuJoCo gives where its bodies are and how they move; the foot is the centre of mass of the shank.
"""

import math
from typing import NamedTuple

from cmacexp.arrays import Array
from cmacexp.compile import kernel
from cmacexp.models.ground import Ground, contact_force


class Touch(NamedTuple):
    """How a foot feels the ground."""

    ground: Ground
    damping: float
    """Of the ground along its normal, N s/m."""
    friction: float
    """Tangential over normal force at most; 0 for a foot that slides freely."""
    tangential_stiffness: float
    """Of the spring from a foot to where it sticks, N/m."""
    tangential_damping: float
    """N s/m."""


class Engine(NamedTuple):
    """Arrays of MuJoCo's, which it fills and reads in place; B is the number of its bodies, the world included."""

    place: Array
    """(B, 3): centres of mass in the world, m."""
    motion: Array
    """(B, 6): angular velocity, and velocity of the point of the body that is at ``centre``."""
    centre: Array
    """(B, 3): centre of mass of the tree below each body, m."""
    pull: Array
    """(B, 6): force (N) and moment that act on each body from outside."""
    turn: Array
    """(B, 9): rotation matrices, row by row."""


@kernel
def point_velocity(engine: Engine, body: int, root: int, axis: int) -> float:
    """World velocity along ``axis`` of the centre of mass of ``body`` in the tree of ``root``, m/s."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    w, v, at, centre = engine.motion[body, :3], engine.motion[body, 3:], engine.place[body], engine.centre[root]
    return v[axis] + w[a] * (at[b] - centre[b]) - w[b] * (at[a] - centre[a])


@kernel
def press(touch: Touch, engine: Engine, legs: int, floats: int, stiffness: Array, force: Array, anchor: Array) -> None:
    """Ground on feet: fills ``force`` (L,), N, and what pulls at the shanks of ``engine``.

    Args:
        touch: the law of contact.
        engine: of MuJoCo, its positions and velocities up to date.
        legs: L.
        floats: 1 where a body stands before the legs in the arrays of ``engine``, else 0.
        stiffness: (L,): K_n under each foot, N/m.
        force: (L,): is filled.
        anchor: (L, 2): where each foot sticks in the world, m.
    """
    for i in range(legs):
        shank = floats + 2 * i + 2
        root = 1 if floats else shank - 1
        depth = -engine.place[shank, 2]
        normal = contact_force(stiffness[i], depth)
        if normal > 0.0:
            normal = max(0.0, normal - touch.damping * point_velocity(engine, shank, root, 2))
        force[i] = normal
        engine.pull[shank, 2] = normal
        if touch.friction > 0.0:
            for j in range(2):
                stretch = engine.place[shank, j] - anchor[i, j]
                engine.pull[shank, j] = -touch.tangential_stiffness * stretch
                engine.pull[shank, j] -= touch.tangential_damping * point_velocity(engine, shank, root, j)
            size = math.hypot(engine.pull[shank, 0], engine.pull[shank, 1])
            most = touch.friction * normal
            if size > most:
                engine.pull[shank, 0] *= most / size
                engine.pull[shank, 1] *= most / size


@kernel
def stick(touch: Touch, engine: Engine, legs: int, floats: int, force: Array, anchor: Array) -> None:
    """Let the places where feet stick, ``anchor`` (L, 2), follow feet that slide or are in the air."""
    for i in range(legs):
        shank = floats + 2 * i + 2
        dx, dy = engine.place[shank, 0] - anchor[i, 0], engine.place[shank, 1] - anchor[i, 1]
        stretch = math.hypot(dx, dy)
        longest = touch.friction * force[i] / touch.tangential_stiffness
        if stretch > longest:
            anchor[i, 0] = engine.place[shank, 0] - dx * longest / stretch
            anchor[i, 1] = engine.place[shank, 1] - dy * longest / stretch
