"""The transfer function from feedforward torque to learning error, at single samples of the cycle.

T is the transfer function from a feedforward torque to -J^T U, the torque by which it relieves the feedback. A lead
of l samples multiplies T by z^l. The proofs of ``docs/theory.md`` for several joints need Hermitian parts, Re M = (M
+ M^H) / 2: an error of the weights is measured by V = tr(W Q W^T), with one positive definite Q for each leg, and
Re(Q z^l T) must be positive definite. Eigenvalues of T with positive real parts do not suffice
(``tests/stability/test_transfer.py``).
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
"""Condition number above which eigenvectors are too near to parallel to define a weight of the joints."""


class Local(NamedTuple):
    """The loop without learning, linearised at one step: x+ = A x + B (C x + u), with a state of n numbers."""

    a: Array
    """A, (n, n): state to next state, without feedback."""
    b: Array
    """B, (n, L J): torque to next state."""
    c: Array
    """C, (L J, n): state to the feedback torque that trains a feedforward."""
    legs: int = 1
    """Number of legs, L."""


def _from_torque(loop: RestorableLoop, now: Array, torque: Array) -> Array:
    """Compute B at the held step, with state ``now`` (n,), by central differences of its ``torque`` (L, J), N m."""
    nominal = torque.copy()

    def end(joint: int, change: float) -> Array:
        """Compute the state after the step with the torque of one joint changed by ``change``, N m."""
        loop.put(now)
        torque[np.unravel_index(joint, nominal.shape)] += change
        NotPredictable.unless(loop.advance(1), f"a run from nearby ends at sample {loop.run.taken % loop.period}")
        torque[...] = nominal
        return loop.state()

    columns = [(end(j, NUDGE) - end(j, -NUDGE)) / (2.0 * NUDGE) for j in range(nominal.size)]
    return np.stack(columns, axis=1)


def _local(loop: RestorableLoop, table: Array) -> Local:
    """Linearise the loop at its next step; ``table`` (N, L, J), N m, holds the torques that it repeats."""
    sample = loop.run.taken % loop.period
    now = loop.hold()

    def learning_error() -> Array:
        return loop.run.loop.controller.state.learning_error.reshape(-1).copy()

    columns = [loop.derivative(now, along, learning_error, 1) for along in np.eye(len(now))]
    b = _from_torque(loop, now, table[sample])
    loop.put(now)
    closed = np.stack([state for state, _ in columns], axis=1)
    c = np.stack([torque for _, torque in columns], axis=1)
    return Local(closed - b @ c, b, c, table.shape[1])


def _find_commanded(config: Config, acting: Array) -> Array:
    """Compute commanded torques from ``acting`` ones, both (N, L, J), N m, over a whole cycle.

    Inverts delay and lag of the actuator; the torques must not have reached a limit.
    """
    share = first_order_share(config.actuator.lag, config.sampling_period)
    ahead = acting + (1.0 / share - 1.0) * (acting - np.roll(acting, 1, axis=0)) if share < 1.0 else acting
    return np.roll(ahead, -config.actuator.delay, axis=0)


def _replay(config: Config, cycle: int) -> tuple[RestorableLoop, Array]:
    """Run a loop that learns for ``cycle`` cycles and from then on repeats the torque of the next cycle.

    Returns the loop after one repeated cycle, and the torque (N, L, J), N m, which the loop reads: it may be changed
    in place. Raises NotPredictable if the run ends before.
    """
    loop = make_restorable_loop(config)
    torque = np.empty(0)
    for completed in range(cycle + 2):
        NotPredictable.unless(loop.advance(loop.period), f"the run ends in cycle {loop.cycles + 1}")
        if completed == cycle:
            torque = _find_commanded(config, loop.column("tau_feedforward"))
            loop.play(torque)
    return loop, torque


def locals_along(config: Config, cycle: int, samples: Sequence[int]) -> Iterator[Local]:
    """Yield the loop without learning, linearised at each of ``samples``, after ``cycle`` cycles of learning.

    The torque learnt by then is repeated. Raises NotPredictable if the run ends before.
    """
    loop, table = _replay(config, cycle)
    for sample in sorted(samples):
        steps = sample - loop.run.taken % loop.period
        NotPredictable.unless(not steps or loop.advance(steps), f"the run ends in cycle {loop.cycles + 1}")
        yield _local(loop, table)


def transfer(local: Local, frequencies: Array, period: float) -> NDArray[np.complex128]:
    """Compute T, (f, L J, L J), at ``frequencies`` (f,), Hz, for a sampling ``period`` in s.

    Entry [f, i, j] leads from feedforward torque j to minus torque i of the learning error.
    """
    z = np.exp(2j * np.pi * np.asarray(frequencies, dtype=float) * period)[:, None, None]
    path = local.c @ np.linalg.solve(z * np.eye(len(local.a)) - local.a, local.b.astype(complex)[None])
    return np.asarray(-path @ np.linalg.inv(np.eye(local.b.shape[1]) - path))


class Spectrum(NamedTuple):
    """T over frequency at one sample of the cycle, in joint coordinates in which Q is the unit matrix."""

    frequencies: Array
    """(f,), Hz."""
    period: float
    """Sampling period, s."""
    transfer: NDArray[np.complex128]
    """(f, L J, L J): S T S^-1 with S^H S = Q, without lead."""

    def least_real(self, lead: int, share: float = 0.0) -> Array:
        """Compute the least eigenvalue (f,) of Re(z^l T) - ``share`` T^H T, with a ``lead`` of l samples.

        With a share of 0 it is positive where Re(z^l T) is positive definite; with beta / 2 it is condition 1 of
        ``docs/theory.md``, with beta (l + 1/2) condition 2.
        """
        turned = np.exp(2j * np.pi * self.frequencies * self.period * lead)[:, None, None] * self.transfer
        adjoint = np.conj(np.swapaxes(turned, 1, 2))
        return np.asarray(np.linalg.eigvalsh((turned + adjoint) / 2.0 - share * adjoint @ turned)[:, 0])

    def least(self, lead: int, share: float = 0.0) -> float:
        """Compute the least value of :meth:`least_real` over all frequencies."""
        return float(self.least_real(lead, share).min())


def compute_spectrum(local: Local, frequencies: Array, period: float) -> Spectrum:
    """Compute the spectrum of T, with the arguments of :func:`transfer`; the highest frequency must be the last.

    S^-1 of a leg, (J, J), consists of the eigenvectors of the leg's block of T at the highest frequency, or is the
    unit matrix. There T is nearly gain over inertia, which is similar to a symmetric matrix. With this Q the least
    eigenvalue of the block's Hermitian part equals the least real part of its eigenvalues, the largest value that any
    Q gives.
    """
    values = transfer(local, frequencies, period)
    joints = values.shape[1] // local.legs
    basis = np.zeros(values.shape[1:], dtype=np.complex128)
    for i in range(0, len(basis), joints):
        block = slice(i, i + joints)
        vectors = np.linalg.eig(values[-1, block, block].real)[1]
        basis[block, block] = vectors if np.linalg.cond(vectors) < ILL_CONDITIONED else np.eye(joints)
    return Spectrum(frequencies, period, np.asarray(np.linalg.solve(basis, values @ basis), dtype=np.complex128))


def spectra_along(config: Config, cycle: int, places: int, frequencies: int) -> list[Spectrum]:
    """Compute T at ``places`` evenly spaced samples of a cycle, after ``cycle`` cycles of learning.

    The ``frequencies`` frequencies are evenly spaced up to half the sampling rate.
    """
    samples = sorted({int(sample) for sample in np.linspace(0, config.steps_per_cycle, places, endpoint=False)})
    hertz = np.linspace(0.0, 0.5 / config.sampling_period, frequencies + 1)[1:]
    return [compute_spectrum(local, hertz, config.sampling_period) for local in locals_along(config, cycle, samples)]
