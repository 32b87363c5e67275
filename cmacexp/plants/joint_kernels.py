"""Joints of a robot as it is built: dry friction over their angle, an offset, a spring."""

from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Counts


class Joints(NamedTuple):
    """Joints (L, J) whose friction depends on their angle, and what else turns them."""

    friction: Array
    """(nv,): dry friction of all that moves, in MuJoCo's model, N m."""
    low: Array
    """(L, J): angle of the first knot, rad."""
    high: Array
    """(L, J): angle of the last, rad."""
    knots: Array
    """(L, J, K) friction at equal distances, N m."""
    offset: Array
    """(L, J): torque at any angle, N m."""
    spring: Array
    """(L, J): torque at the last knot, and its opposite at the first, N m."""


@kernel
def hold_torque(joints: Joints | None, torque: Array, q: Counts, dq: Counts, position: Array, applied: Array) -> None:
    """Hold ``torque`` (L, J), N m, and what ``joints`` add to it at their present angles; sets their friction.

    Joints have the rows ``q`` (L, J) of ``position``, rad, and ``dq`` of ``applied``, N m, which this fills.
    """
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            at = dq[i, j]
            applied[at] = torque[i, j]
            if joints is not None:
                low, last = joints.low[i, j], joints.knots.shape[2] - 1
                unit = (position[q[i, j]] - low) / (joints.high[i, j] - low)
                unit = min(max(unit, 0.0), 1.0)
                below = min(int(unit * last), max(last - 1, 0))
                share = unit * last - below
                knot, above = joints.knots[i, j, below], joints.knots[i, j, min(below + 1, last)]
                joints.friction[at] = knot + share * (above - knot)
                applied[at] += joints.offset[i, j] + joints.spring[i, j] * (2.0 * unit - 1.0)
