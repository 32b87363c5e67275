"""Growth of the feedback from cycle to cycle, predicted by the loop linearised at one cycle.

Learning is a map from the state of one cycle to that of the next. Linearised at a cycle and applied repeatedly, the
map predicts how the state changes in the following cycles. It is far from normal: over the first hundred cycles a
growing change moves through the cycle and grows faster than the largest eigenvalue indicates. The growth is therefore
computed from the repeated map, on the Krylov space of a change (Arnoldi 1951).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.stability.cycle_map import NotPredictable, RestorableLoop, make_restorable_loop
from cmacexp.config import Config
from cmacexp.feedforward.kernels import TABLE
from cmacexp.typing import Array

MAX_CYCLES_BEFORE = 25
"""Cycles of learning run by default; the loop is linearised at the one with the smallest change."""
DIMENSION = 60
"""Default dimension of the Krylov space: 40 to 120 give the same growth to three decimals."""
EXHAUSTED = 1e-10
"""Relative length of the orthogonal rest of an image below which the Krylov space is complete."""
SETTLING_CYCLES = 5
"""Cycles from the linearised one to the start of the fit of the growth: by then fast modes have decayed."""
GROWTH_CYCLES = 100
"""Cycles over which growth is fitted."""


# einsum instead of BLAS: at this size, on busy cores, BLAS threads cost more time than they save.
class Krylov(NamedTuple):
    """A linear map on the Krylov space, of dimension m, of a start vector."""

    hessenberg: Array
    """(m, m): the map in the orthonormal basis of the Krylov space."""
    start: float
    """Length of the start vector."""
    observations: Array
    """(m, p): observation of the map at each basis vector."""

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Compute the Ritz values (m,), the largest first; the outer ones approximate eigenvalues of the map."""
        values = np.linalg.eigvals(self.hessenberg).astype(np.complex128)
        return values[np.argsort(-np.abs(values))]

    def lengths(self, times: int) -> Array:
        """Compute the observation lengths (times,) at the start vector and its images; the first m are exact."""
        weights = np.zeros((times, len(self.hessenberg)))  # the vectors in the basis
        weights[0, 0] = self.start
        with np.errstate(over="ignore", invalid="ignore"):  # unbounded growth overflows
            for k in range(1, times):
                weights[k] = np.einsum("ij,j", self.hessenberg, weights[k - 1])
            products = np.einsum("ip,jp", self.observations, self.observations)
            squares = np.einsum("ti,ij,tj->t", weights, products, weights, optimize=True)
        return np.sqrt(np.where(np.isnan(squares), np.inf, np.maximum(squares, 0.0)))


def krylov(apply: Callable[[Array], tuple[Array, Array]], start: Array, dimension: int) -> Krylov:
    """Reduce a linear map to the Krylov space of ``start`` (n,), which must not be zero.

    ``apply`` takes a vector (n,) and returns its image (n,) and an observation (p,). The dimension of the space is
    ``dimension``, or lower if the images span fewer directions.
    """
    dimension = min(dimension, len(start))
    basis = np.empty((dimension + 1, len(start)))
    hessenberg = np.zeros((dimension + 1, dimension))
    observations = []
    length = float(np.linalg.norm(start))
    basis[0] = start / length
    for k in range(dimension):
        image, observation = apply(basis[k])
        observations.append(observation)
        size = float(np.linalg.norm(image))
        for _ in range(2):  # Gram-Schmidt once is orthogonal to a few digits only
            projections = np.einsum("ij,j", basis[: k + 1], image)
            image = image - np.einsum("i,ij", projections, basis[: k + 1])
            hessenberg[: k + 1, k] += projections
        rest = float(np.linalg.norm(image))
        if rest <= EXHAUSTED * size:
            return Krylov(hessenberg[: k + 1, : k + 1], length, np.array(observations))
        hessenberg[k + 1, k] = rest
        basis[k + 1] = image / rest
    return Krylov(hessenberg[:dimension], length, np.array(observations))


def fitted_growth(changes: Array | Sequence[float]) -> float:
    """Fit the growth per cycle of a positive quantity (n,), by least squares over its logarithm.

    Returns NaN for fewer than 3 values, or if a value is not positive and finite.
    """
    values = np.asarray(changes, dtype=float)
    if len(values) < 3 or not (np.isfinite(values) & (values > 0.0)).all():
        return float("nan")
    time = np.arange(len(values)) - (len(values) - 1) / 2.0
    return float(np.exp((time @ np.log(values)) / (time @ time)))


@dataclass(frozen=True)
class Growth:
    """The loop linearised at one cycle, and the predicted changes of the following cycles."""

    cycle: int
    """Number of cycles completed at the linearised state."""
    krylov: Krylov
    """The map from cycle to cycle; its observations are the feedback torques of a cycle, N m.

    The length of an observation is the root of the summed squares of the change of the feedback from one cycle to the
    next, starting with the change from cycle ``cycle + 1`` to ``cycle + 2``.
    """

    def over(self, first: int, last: int) -> float:
        """Compute the growth per cycle of the change of the feedback, from cycle ``first`` to cycle ``last``.

        The change of a cycle is the difference between the next cycle and it.
        """
        start = self.cycle + 1
        return fitted_growth(self.krylov.lengths(last - start + 1)[max(0, first - start) :])

    @property
    def per_cycle(self) -> float:
        """Growth factor per cycle over GROWTH_CYCLES cycles, SETTLING_CYCLES after ``cycle``."""
        return self.over(self.cycle + SETTLING_CYCLES, self.cycle + SETTLING_CYCLES + GROWTH_CYCLES)


def with_lead(config: Config, lead: int) -> Config:
    """Return a copy of a config with ``lead`` as its ``learning.lead``."""
    return replace(config, learning=replace(config.learning, lead=lead))


class History(NamedTuple):
    """The feedback torque of a simulation in memory, cycle by cycle."""

    sizes: list[float]
    """Root of the summed squares of the change to the next cycle, N m; entry j is from cycle j + 1 to j + 2."""
    levels: list[float]
    """Root of the summed squares of each cycle, N m."""


def record_history(loop: RestorableLoop, cycles: int) -> History:
    """Run a loop until ``cycles`` cycles are completed and record its feedback; stop where the run ends."""
    before: Array | None = None
    history = History([], [])
    while loop.cycles < cycles and loop.advance(loop.period):
        feedback = loop.column("tau_feedback")
        history.levels.append(float(np.linalg.norm(feedback)))
        if before is not None:
            history.sizes.append(float(np.linalg.norm(feedback - before)))
        before = feedback
    return history


def change_sizes(config: Config, cycles: int) -> list[float]:
    """Simulate ``cycles`` cycles of a config and return the changes of the feedback, N m (``sizes`` of a History)."""
    return record_history(make_restorable_loop(config), cycles).sizes


def find_calmest(sizes: Sequence[float] | Array, first: int) -> int:
    """Find the cycle, from ``first`` on, whose feedback changes least to the next: the nearest to a fixed point."""
    return int(np.argmin(sizes[first - 1 :])) + first


def linearise_cycle(loop: RestorableLoop, dimension: int = DIMENSION, seed: int | None = None) -> Growth:
    """Linearise a loop at its current state, at the start of a cycle; the loop returns to this state.

    Each direction of the Krylov space costs two cycles. The start vector is random with a ``seed``, else the change
    of the state over this cycle. Raises NotPredictable if the run, or one from a nearby state, ends within a cycle.
    """
    completed = loop.cycles
    now = loop.hold()

    def apply(along: Array) -> tuple[Array, Array]:
        return loop.derivative(now, along, lambda: loop.column("tau_feedback").ravel(), loop.period)

    try:
        if seed is not None:  # most directions of the weights change no torque and stay as they are: subtract them
            along = np.random.default_rng(seed).standard_normal(len(now))
            start = apply(along)[0] - along
        else:
            NotPredictable.unless(loop.advance(loop.period), f"the run ends in cycle {completed + 1}")
            start = loop.state() - now
        space = krylov(apply, start, dimension)
    finally:
        loop.put(now)
    return Growth(completed, space)


def require_learning(loop: RestorableLoop) -> None:
    """Raise NotPredictable unless a feedforward learns at the current step of a loop."""
    params = loop.run.loop.feedforward
    NotPredictable.unless(
        loop.run.taken >= loop.plan.start_step and params is not None and params.kind != TABLE,
        "nothing learns from cycle to cycle",
    )


def predicted_growth(config: Config, cycle: int | None = None) -> Growth:
    """Simulate some cycles of a config, and predict the growth of learning from the loop linearised there.

    The loop is linearised after ``cycle`` cycles, by default at the cycle with the smallest change among the first
    MAX_CYCLES_BEFORE of learning. Raises NotPredictable if components cannot be linearised, nothing learns, or the
    run ends before.
    """
    first = config.learning.start_cycle
    if cycle is None:
        sizes = change_sizes(config, first + MAX_CYCLES_BEFORE)
        NotPredictable.unless(len(sizes) > first, f"the run ends in cycle {len(sizes) + 2}, before learning shows")
        cycle = find_calmest(sizes, first)
    loop = make_restorable_loop(config)
    NotPredictable.unless(
        len(record_history(loop, cycle).levels) >= cycle,
        f"the run ends in cycle {loop.cycles + 1}, before cycle {cycle} is done",
    )
    require_learning(loop)
    return linearise_cycle(loop)
