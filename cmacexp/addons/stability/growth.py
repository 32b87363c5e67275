"""How much the feedback grows from cycle to cycle: predicted by the loop linearised at one cycle.

Learning is a map from cycle to cycle. Linearised at a cycle and repeated, it predicts the changes from cycle to
cycle that follow. The map is far from normal: over the hundred cycles that matter, a growing change moves through the
cycle and grows faster than the largest eigenvalue indicates, so the growth is computed from the repeated map: on the
space that a change and its first images span (Arnoldi 1951).
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
"""Cycles that are run by default; the calmest of them is linearised."""
DIMENSION = 60
"""Dimension of the Krylov space: 40 to 120 give the same growth to three decimals."""
EXHAUSTED = 1e-10
"""A new direction shorter than this, relative to the last, adds no direction."""
SETTLING_CYCLES, GROWTH_CYCLES = 5, 100
"""Growth is fitted over GROWTH_CYCLES, SETTLING_CYCLES after the linearised one: by then fast modes have decayed."""


# Products are taken by einsum, not by BLAS, whose threads cost more than they save at this size where cores are busy.
class Krylov(NamedTuple):
    """A linear map on the space of a vector and its first images; m is the dimension of that space."""

    hessenberg: Array
    """(m, m): the map in the orthonormal basis of that space."""
    start: float
    """Length of the vector."""
    observations: Array
    """(m, p): of the map at each vector of the basis."""

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Ritz values (m,), the largest first: the outer ones are near eigenvalues of the map."""
        values = np.linalg.eigvals(self.hessenberg).astype(np.complex128)
        return values[np.argsort(-np.abs(values))]

    def lengths(self, times: int) -> Array:
        """Lengths of the observations at the vector and its first images, (times,); exact for the first m of them."""
        each, weights = self.observations, np.zeros((times, len(self.hessenberg)))
        weights[0, 0] = self.start  # the vector and its images in the basis
        with np.errstate(over="ignore", invalid="ignore"):  # what grows without end is not finite
            for k in range(1, times):
                weights[k] = np.einsum("ij,j", self.hessenberg, weights[k - 1])
            squares = np.einsum("ti,ij,tj->t", weights, np.einsum("ip,jp", each, each), weights, optimize=True)
        return np.sqrt(np.where(np.isnan(squares), np.inf, np.maximum(squares, 0.0)))


def krylov(apply: Callable[[Array], tuple[Array, Array]], start: Array, dimension: int) -> Krylov:
    """Reduce a linear map to the space of ``start`` (n,), not zero, and its first images.

    ``apply`` takes a vector (n,) and returns its image (n,) and an observation (p,). The space has a lower
    ``dimension`` if the images span fewer directions.
    """
    dimension = min(dimension, len(start))
    basis = np.empty((dimension + 1, len(start)))
    hessenberg, observations = np.zeros((dimension + 1, dimension)), []
    length = float(np.linalg.norm(start))
    basis[0] = start / length
    for k in range(dimension):
        image, observation = apply(basis[k])
        observations.append(observation)
        size = float(np.linalg.norm(image))
        for _ in range(2):  # once leaves them orthogonal to no more than a few digits
            parts = np.einsum("ij,j", basis[: k + 1], image)
            image = image - np.einsum("i,ij", parts, basis[: k + 1])
            hessenberg[: k + 1, k] += parts
        rest = float(np.linalg.norm(image))
        if rest <= EXHAUSTED * size:
            return Krylov(hessenberg[: k + 1, : k + 1], length, np.array(observations))
        hessenberg[k + 1, k] = rest
        basis[k + 1] = image / rest
    return Krylov(hessenberg[:dimension], length, np.array(observations))


def fitted_growth(changes: Array | Sequence[float]) -> float:
    """Growth per cycle of a positive quantity (n,), by least squares over its logarithm.

    NaN with fewer than 3 values, or one that is not positive and finite.
    """
    values = np.asarray(changes, dtype=float)
    if len(values) < 3 or not (np.isfinite(values) & (values > 0.0)).all():
        return float("nan")
    time = np.arange(len(values)) - (len(values) - 1) / 2.0
    return float(np.exp((time @ np.log(values)) / (time @ time)))


@dataclass(frozen=True)
class Growth:
    """The loop linearised at one cycle, and its changes from then on."""

    cycle: int
    """Cycles done where it was linearised."""
    krylov: Krylov
    """The map from cycle to cycle; its observation: feedback torques of a cycle, N m.

    Lengths of that are roots of the summed squares of the change of the feedback from cycle to cycle, of which the
    first is from cycle ``cycle + 1`` to the next.
    """

    def over(self, first: int, last: int) -> float:
        """Growth per cycle of the change of the feedback, from that of cycle ``first`` to that of ``last``.

        The change of a cycle is that from it to the next one.
        """
        start = self.cycle + 1
        return fitted_growth(self.krylov.lengths(last - start + 1)[max(0, first - start) :])

    @property
    def per_cycle(self) -> float:
        """Growth per cycle over the cycles that follow."""
        return self.over(self.cycle + SETTLING_CYCLES, self.cycle + SETTLING_CYCLES + GROWTH_CYCLES)


def with_lead(config: Config, lead: int) -> Config:
    """The same config with another ``learning.lead``."""
    return replace(config, learning=replace(config.learning, lead=lead))


class History(NamedTuple):
    """The feedback torque of a run in memory, cycle by cycle."""

    sizes: list[float]
    """Root of the summed squares of its change to the next cycle, N m; entry j is from cycle j + 1 to j + 2."""
    levels: list[float]
    """Root of its summed squares, N m."""


def watch(loop: RestorableLoop, cycles: int) -> History:
    """Run a loop in memory until so many cycles are done; the history ends where the run does."""
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
    """Changes of the feedback torque from cycle to cycle of a run in memory, N m; see :class:`History`."""
    return watch(make_restorable_loop(config), cycles).sizes


def calmest(sizes: Sequence[float] | Array, first: int) -> int:
    """The cycle from ``first`` on whose feedback changes least to the next: the nearest to a fixed point."""
    return int(np.argmin(sizes[first - 1 :])) + first


def grow(loop: RestorableLoop, dimension: int = DIMENSION, seed: int | None = None) -> Growth:
    """Linearise a loop where it stands, at the start of a cycle; it stays as it is.

    Each direction of the Krylov space costs two cycles. Its start is random with a ``seed``, else the change that the
    loop makes in this cycle. Raises NotPredictable if the run, or one from nearby, ends within a cycle.
    """
    done, now = loop.cycles, loop.hold()

    def apply(along: Array) -> tuple[Array, Array]:
        return loop.derivative(now, along, lambda: loop.column("tau_feedback").ravel(), loop.period)

    try:
        if seed is not None:  # its change: most weights in use change no torque, so the map keeps them as they are
            along = np.random.default_rng(seed).standard_normal(len(now))
            start = apply(along)[0] - along
        else:
            NotPredictable.unless(loop.advance(loop.period), f"the run ends in cycle {done + 1}")
            start = loop.state() - now
        space = krylov(apply, start, dimension)
    finally:
        loop.put(now)
    return Growth(done, space)


def require_learning(loop: RestorableLoop) -> None:
    """Check that something learns from cycle to cycle where a loop stands; raises NotPredictable."""
    params = loop.run.loop.feedforward
    NotPredictable.unless(
        loop.run.taken >= loop.plan.start_step and params is not None and params.kind != TABLE,
        "nothing learns from cycle to cycle",
    )


def predicted_growth(config: Config, cycle: int | None = None) -> Growth:
    """Predict the growth of learning, by running a few cycles in memory and linearising the loop there.

    It is linearised after ``cycle`` cycles, by default at the calmest of the first MAX_CYCLES_BEFORE. Raises
    NotPredictable if components cannot be linearised, nothing is learnt, or it ends.
    """
    first = config.learning.start_cycle
    if cycle is None:
        sizes = change_sizes(config, first + MAX_CYCLES_BEFORE)
        NotPredictable.unless(len(sizes) > first, f"the run ends in cycle {len(sizes) + 2}, before learning shows")
        cycle = calmest(sizes, first)
    loop = make_restorable_loop(config)
    NotPredictable.unless(
        len(watch(loop, cycle).levels) >= cycle,
        f"the run ends in cycle {loop.cycles + 1}, before cycle {cycle} is done",
    )
    require_learning(loop)
    return grow(loop)
