"""From feedforward torque to what the feedforward is taught, around single samples of the cycle.

T is the transfer from a feedforward torque to -J^T U, the torque that it spares the feedback. Learning from cycle to
cycle takes u to u - beta T u, so it settles at frequencies where every eigenvalue of T has a positive real part. A
lead of l samples multiplies T by z^l; torques that reach the joints d samples late put z^-d into the loop.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.arrays import Array
from cmacexp.config import Config
from cmacexp.stability.cycle_map import NUDGE, Loop, NotPredictable, open_loop


class Local(NamedTuple):
    """The loop without learning, linearised at one step: x+ = A x + B (C_f x + u); n numbers of state, L legs."""

    sample: int
    """Of the cycle."""
    a: Array
    """A, (n, n): without feedback."""
    b: Array
    """B, (n, 2 L): from torque."""
    feedback: Array
    """C_f, (2 L, n): to the feedback torque."""
    taught: Array
    """(2 L, n): to what a feedforward is taught."""


def _local(loop: Loop, table: Array) -> Local:
    """Linearise at the step that comes next; ``table`` (N, L, 2) is what the loop plays."""
    sample = loop.run.taken % loop.period
    loop.hold(1)
    now = loop.state()
    count = table[0].size

    def seen() -> Array:
        return np.concatenate([loop.column("tau_feedback")[0].ravel(), loop.run.loop.control_state.taught.ravel()])

    columns = [loop.derivative(now, along, seen, 1) for along in np.eye(len(now))]
    own = table[sample].copy()
    b = np.empty((len(now), count))
    for j in range(count):
        ends = []
        for sign in (1.0, -1.0):
            loop.put(now)
            table[sample].reshape(-1)[j] += sign * NUDGE
            if not loop.advance(1):
                raise NotPredictable(f"a run from nearby ends at sample {sample}")
            ends.append(loop.state())
            table[sample] = own
        b[:, j] = (ends[0] - ends[1]) / (2.0 * NUDGE)
    loop.put(now)
    closed = np.stack([state for state, _ in columns], axis=1)
    outputs = np.stack([out for _, out in columns], axis=1)

    return Local(sample, closed - b @ outputs[:count], b, outputs[:count], outputs[count:])


def locals_along(config: Config, cycle: int, samples: Sequence[int]) -> list[Local]:
    """Linearise the loop without learning at some samples of the cycle that follows ``cycle`` cycles of learning.

    The learned torque of that cycle is played on, while the loop stands at each of the samples.

    Raises:
        NotPredictable: the run ends before, or its parts cannot be linearised.
    """
    loop = open_loop(config)
    while loop.cycles < cycle + 1:
        if not loop.advance(loop.period):
            raise NotPredictable(f"the run ends in cycle {loop.cycles + 1}")
    table = loop.column("tau_feedforward")
    loop.play(table)
    if not loop.advance(loop.period):
        raise NotPredictable(f"the run ends in cycle {loop.cycles + 1}")
    found = []
    for sample in sorted(samples):
        steps = sample - loop.run.taken % loop.period
        if steps and not loop.advance(steps):
            raise NotPredictable(f"the run ends in cycle {loop.cycles + 1}")
        found.append(_local(loop, table))
    return found


def transfer(local: Local, frequencies: Array, period: float, delay: int = 0) -> NDArray[np.complex128]:
    """T at some frequencies.

    Args:
        local: where.
        frequencies: (f,), Hz.
        period: sampling period, s.
        delay: further samples from every torque to the joints.

    Returns:
        (f, 2 L, 2 L); [f, i, j] from feedforward torque j to the torque i that is taught, sign turned.
    """
    z = np.exp(2j * np.pi * np.asarray(frequencies, dtype=float) * period)[:, None, None]
    states = np.linalg.solve(z * np.eye(len(local.a)) - local.a, local.b.astype(complex)[None]) * z**-delay
    inner = np.eye(local.b.shape[1]) - local.feedback @ states
    return np.asarray(-(local.taught @ states) @ np.linalg.inv(inner))


def least_real(found: NDArray[np.complex128], frequencies: Array, period: float, lead: int) -> Array:
    """Least real part (f,) of the eigenvalues of T (f, m, m) with a lead, in samples."""
    turned = np.exp(2j * np.pi * np.asarray(frequencies, dtype=float) * period * lead)
    return np.asarray((np.linalg.eigvals(found) * turned[:, None]).real.min(axis=1))
