"""How much the feedback grows from cycle to cycle: predicted by the loop linearised at one cycle.

Learning is a map from cycle to cycle. Linearised at a cycle and repeated, it predicts the changes from cycle to
cycle that follow. The map is far from normal: over the hundred cycles that matter, a growing change moves through the
cycle and grows faster than the largest eigenvalue indicates, so the growth is computed from the repeated map.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.config import Config
from cmacexp.feedforward.kernels import TABLE
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.stability.cycle_map import NotPredictable, RestorableLoop, open_loop
from cmacexp.stability.krylov import Krylov, krylov
from cmacexp.typing import Array

MAX_CYCLES_BEFORE = 25
"""Cycles that are run by default; the calmest of them is linearised."""
DIMENSION = 60
"""Dimension of the Krylov space: 40 to 120 give the same growth to three decimals."""
SETTLING_CYCLES, GROWTH_CYCLES = 5, 100
"""Growth is fitted over GROWTH_CYCLES, SETTLING_CYCLES after the linearised one: by then fast modes have decayed."""


def fitted_growth(changes: Array | Sequence[float]) -> float:
    """Growth per cycle of a positive quantity, by least squares over its logarithm.

    Args:
        changes: (n,), of successive cycles.

    Returns:
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
    """The map from cycle to cycle; its observation: feedback and feedforward torques (2, N, L, 2) of a cycle, N m."""
    shape: tuple[int, int, int]
    """N, L, 2."""

    def changes(self, times: int) -> Array:
        """Change of the feedback torque, then of the feedforward, from cycle to cycle: (times, 2, N, L, 2), N m.

        The first is the change from cycle ``cycle + 1`` to the next.
        """
        return self.krylov.iterate(times).reshape(times, 2, *self.shape)

    def sizes(self, times: int) -> Array:
        """Root of the summed squares of the change of the feedback torque, (times,), N m; see :meth:`changes`."""
        return np.asarray(np.sqrt((self.changes(times)[:, 0] ** 2).sum(axis=(1, 2, 3))))

    def over(self, first: int, last: int) -> float:
        """Growth per cycle of the change of the feedback, from that of cycle ``first`` to that of ``last``.

        The change of a cycle is that from it to the next one.
        """
        start = self.cycle + 1
        return fitted_growth(self.sizes(last - start + 1)[max(0, first - start) :])

    @property
    def per_cycle(self) -> float:
        """Growth per cycle over the cycles that follow; below 1 learning holds."""
        return self.over(self.cycle + SETTLING_CYCLES, self.cycle + SETTLING_CYCLES + GROWTH_CYCLES)


def with_lead(config: Config, lead: int) -> Config:
    """The same config with another ``learning.lead``."""
    return replace(config, learning=replace(config.learning, lead=lead))


def change_sizes(config: Config, cycles: int, prepared: Scenario | None = None) -> list[float]:
    """Run in memory; root of the summed squares of each change of the feedback torque from cycle to cycle, N m.

    Entry j is from cycle j + 1 to j + 2; the list ends where the run does.
    """
    loop, before = open_loop(config, prepared), None
    sizes: list[float] = []
    while loop.cycles < cycles and loop.advance(loop.period):
        feedback = loop.column("tau_feedback")
        if before is not None:
            sizes.append(float(np.linalg.norm(feedback - before)))
        before = feedback
    return sizes


def calmest(sizes: Sequence[float] | Array, first: int) -> int:
    """The cycle whose feedback changes least to the next: where the loop is nearest to a fixed point.

    Args:
        sizes: of changes, see :func:`change_sizes`.
        first: cycle to begin with: none before the feedforward acts.
    """
    return int(np.argmin(sizes[first - 1 :])) + first


def grow(loop: RestorableLoop, dimension: int = DIMENSION) -> Growth:
    """Linearise a loop where it stands, at the start of a cycle.

    Raises:
        NotPredictable: the run, or one from nearby, ends within a cycle.
    """
    done, now = loop.cycles, loop.hold()
    if not loop.advance(loop.period):
        raise NotPredictable(f"the run ends in cycle {done + 1}")
    after = loop.state()

    def observe() -> Array:
        return np.concatenate([loop.column("tau_feedback").ravel(), loop.column("tau_feedforward").ravel()])

    space = krylov(lambda along: loop.derivative(now, along, observe, loop.period), after - now, dimension)
    loop.put(now)
    return Growth(done, space, (loop.period, loop.samples.shape[1], 2))


def predicted_growth(
    config: Config, cycle: int | None = None, dimension: int = DIMENSION, prepared: Scenario | None = None
) -> Growth:
    """Predict the growth of learning, by running a few cycles in memory and linearising the loop there.

    Args:
        config: a checked config.
        cycle: where to linearise, in cycles done; None: at the calmest of the first MAX_CYCLES_BEFORE.
        dimension: of the Krylov space; each direction costs two cycles.
        prepared: the scenario of ``config`` if it is already made; it stays unchanged.

    Raises:
        NotPredictable: the loop has components that cannot be linearised, does not learn, or ends before.
        BadInput: the machine cannot follow the plan.
    """
    first = config.learning.start_cycle
    scenario = make_scenario(config) if prepared is None else prepared
    if cycle is None:
        sizes = change_sizes(config, first + MAX_CYCLES_BEFORE, scenario)
        if len(sizes) <= first:
            raise NotPredictable(f"the run ends in cycle {len(sizes) + 1}, before learning shows")
        cycle = calmest(sizes, first)
    loop = open_loop(config, scenario)
    while loop.cycles < cycle:
        if not loop.advance(loop.period):
            raise NotPredictable(f"the run ends in cycle {loop.cycles + 1}, before cycle {cycle} is done")
    params = loop.run.loop.feedforward
    if loop.run.taken < loop.plan.start_step or params is None or params.kind == TABLE:
        raise NotPredictable("nothing learns from cycle to cycle")
    return grow(loop, dimension)
