"""The transfer from feedforward torque to the learning error, around single samples of the cycle.

T is the transfer from a feedforward torque to -J^T U, the torque that it spares the feedback. A lead of l samples
multiplies T by z^l. What ``docs/theory.md`` proves of several joints needs Hermitian parts, Re M = (M + M^H) / 2: an
error of weights is measured by V = tr(W Q W^T), with one positive definite Q for each leg, and Re(Q z^l T) must be
positive definite. Eigenvalues of T with positive real parts do not suffice (``tests/stability/test_transfer.py``).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.stability.cycle_map import NUDGE, NotPredictable, RestorableLoop, make_restorable_loop
from cmacexp.config import Config
from cmacexp.models.loop_delay import first_order_share
from cmacexp.typing import Array

ILL_CONDITIONED = 1e3
"""Condition number of eigenvectors from which on they are too near to parallel to define a weight of joints."""


class Local(NamedTuple):
    """The loop without learning, linearised at one step: x+ = A x + B (C x + u); n numbers of state."""

    a: Array
    """A, (n, n): without feedback."""
    b: Array
    """B, (n, L J): from torque."""
    c: Array
    """C, (L J, n): to the feedback torque that a feedforward learns from."""
    legs: int = 1
    """L."""


def _from_torque(loop: RestorableLoop, now: Array, torque: Array) -> Array:
    """B at the step where the loop is held; ``torque`` (L, J) is the torque of that step."""
    nominal = torque.copy()

    def end(joint: int, change: float) -> Array:
        """The state after the step, with another torque of one joint."""
        loop.put(now)
        torque[np.unravel_index(joint, nominal.shape)] += change
        NotPredictable.unless(loop.advance(1), f"a run from nearby ends at sample {loop.run.taken % loop.period}")
        torque[...] = nominal
        return loop.state()

    columns = [(end(j, NUDGE) - end(j, -NUDGE)) / (2.0 * NUDGE) for j in range(nominal.size)]
    return np.stack(columns, axis=1)


def _local(loop: RestorableLoop, table: Array) -> Local:
    """Linearise at the step that comes next; ``table`` (N, L, J) holds the torques of the loop."""
    sample = loop.run.taken % loop.period
    now = loop.hold()

    def learning_error() -> Array:
        return loop.run.loop.control_state.learning_error.reshape(-1).copy()

    columns = [loop.derivative(now, along, learning_error, 1) for along in np.eye(len(now))]
    b = _from_torque(loop, now, table[sample])
    loop.put(now)
    closed = np.stack([state for state, _ in columns], axis=1)
    c = np.stack([torque for _, torque in columns], axis=1)
    return Local(closed - b @ c, b, c, table.shape[1])


def _find_commanded(config: Config, acting: Array) -> Array:
    """The torques (k, L, J), N m, that were commanded, from those that acted without a limit; of a whole period."""
    share = first_order_share(config.actuator.lag, config.sampling_period)
    ahead = acting + (1.0 / share - 1.0) * (acting - np.roll(acting, 1, axis=0)) if share < 1.0 else acting
    return np.roll(ahead, -config.actuator.delay, axis=0)


def _replay(config: Config, cycle: int) -> tuple[RestorableLoop, Array]:
    """A loop that learns for some cycles and repeats the torque of the next one, after a cycle of that; that torque.

    The torque (N, L, J), N m, is the loop's own and may change in place.
    """
    loop = make_restorable_loop(config)
    torque = np.empty(0)
    for done in range(cycle + 2):
        NotPredictable.unless(loop.advance(loop.period), f"the run ends in cycle {loop.cycles + 1}")
        if done == cycle:
            torque = _find_commanded(config, loop.column("tau_feedforward"))
            loop.play(torque)
    return loop, torque


def locals_along(config: Config, cycle: int, samples: Sequence[int]) -> Iterator[Local]:
    """Linearise the loop without learning at some samples of the cycle that follows ``cycle`` cycles of learning.

    The learned torque of that cycle is repeated. Raises NotPredictable if the run ends before.
    """
    loop, table = _replay(config, cycle)
    for sample in sorted(samples):
        steps = sample - loop.run.taken % loop.period
        NotPredictable.unless(not steps or loop.advance(steps), f"the run ends in cycle {loop.cycles + 1}")
        yield _local(loop, table)


def transfer(local: Local, frequencies: Array, period: float) -> NDArray[np.complex128]:
    """T at ``frequencies`` (f,), Hz, with a sampling ``period`` in s, (f, L J, L J).

    [f, i, j] is from feedforward torque j to torque i of the learning error, with opposite sign.
    """
    z = np.exp(2j * np.pi * np.asarray(frequencies, dtype=float) * period)[:, None, None]
    path = local.c @ np.linalg.solve(z * np.eye(len(local.a)) - local.a, local.b.astype(complex)[None])
    return np.asarray(-path @ np.linalg.inv(np.eye(local.b.shape[1]) - path))


class Spectrum(NamedTuple):
    """T over frequency at one place of the cycle, in coordinates of the joints in which Q is the unit matrix."""

    frequencies: Array
    """(f,), Hz."""
    period: float
    """Time between two samples, s."""
    transfer: NDArray[np.complex128]
    """(f, L J, L J): S T S^-1 with S^H S = Q, without lead."""

    def least_real(self, lead: int, share: float = 0.0) -> Array:
        """Least eigenvalue (f,) of Re(z^l T) - ``share`` T^H T, with a lead of l samples.

        With a share of 0 its sign says whether Re(z^l T) is positive definite; with beta / 2 it is condition 1 of
        ``docs/theory.md``, with beta (l + 1/2) condition 2.
        """
        turned = np.exp(2j * np.pi * self.frequencies * self.period * lead)[:, None, None] * self.transfer
        adjoint = np.conj(np.swapaxes(turned, 1, 2))
        return np.asarray(np.linalg.eigvalsh((turned + adjoint) / 2.0 - share * adjoint @ turned)[:, 0])

    def least(self, lead: int, share: float = 0.0) -> float:
        """The least of :meth:`least_real` at any frequency."""
        return float(self.least_real(lead, share).min())


def compute_spectrum(local: Local, frequencies: Array, period: float) -> Spectrum:
    """T at some frequencies, the highest of them last; arguments as of :func:`transfer`.

    S^-1 of a leg, (J, J), are the eigenvectors of its part of T at the highest frequency, or the unit matrix. There T
    is hardly more than gain over inertia, which is similar to a symmetric matrix. With this Q the least eigenvalue of
    its Hermitian part is the least real part of its own eigenvalues, the largest that any Q gives.
    """
    values = transfer(local, frequencies, period)
    joints = values.shape[1] // local.legs
    basis = np.zeros(values.shape[1:], dtype=np.complex128)
    for i in range(0, len(basis), joints):
        own = slice(i, i + joints)
        vectors = np.linalg.eig(values[-1, own, own].real)[1]
        basis[own, own] = vectors if np.linalg.cond(vectors) < ILL_CONDITIONED else np.eye(joints)
    return Spectrum(frequencies, period, np.asarray(np.linalg.solve(basis, values @ basis), dtype=np.complex128))


def spectra_along(config: Config, cycle: int, places: int, frequencies: int) -> list[Spectrum]:
    """T at evenly spaced places of the cycle after ``cycle`` cycles of learning, up to half the sampling rate."""
    samples = sorted({int(sample) for sample in np.linspace(0, config.steps_per_cycle, places, endpoint=False)})
    hertz = np.linspace(0.0, 0.5 / config.sampling_period, frequencies + 1)[1:]
    return [compute_spectrum(local, hertz, config.sampling_period) for local in locals_along(config, cycle, samples)]
