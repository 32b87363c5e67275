"""Samples of the comparison of feedforwards: what its claims and findings are decided by."""

from collections.abc import Sequence

import numpy as np

from cmacexp.study import Results
from cmacexp.typing import Array
from pipelines.feedforwards_figures import ANEW, CARRIED
from pipelines.feedforwards_kinds import ALONE, CMAC, ILC, KEPT, MLP, RBF, cycles_to_tenth, error_at

LEG, WALK, SMOOTH, RATE = "one leg", "quadruped", "without jumps", "other rates"
RATES = (0.5, 1.0)
"""Besides the paper's; the last suits iterative learning control."""
STROKES = {"stroke 150 mm": ("gait.stroke=0.15",), "stroke 250 mm": ("gait.stroke=0.25",)}
CHANGES = {
    **STROKES,
    "ground 1.5 times as stiff, known": ("terrain.stiffness=15",),
    "ground 1.5 times as stiff, unknown": ("terrain.stiffness=15", "terrain.assumed_stiffness=10"),
}
"""What becomes of the default path and ground (10 N/m); planner and models know of the ground, or do not."""
EARLY, LATE = 5, 20
"""Cycles that are compared."""


def _mean(results: Results, kind: str, cycle: int) -> float:
    return float(error_at(results.select(kind=kind), cycle).mean())


def _over(cycles: Array, others: float) -> Array:
    """Cycles over those of others; infinite if there are infinitely many."""
    ratios: Array = np.full(len(cycles), np.inf)
    np.divide(cycles, others, out=ratios, where=np.isfinite(cycles))
    return ratios


def against_fastest(results: Results) -> Array:
    """(seeds,): cycles that CMAC needs over those of the fastest of the others; infinite if it never learns."""
    own = cycles_to_tenth(results, CMAC)
    fastest = min(float(cycles_to_tenth(results, kind).mean()) for kind in (RBF, MLP, ILC))
    return _over(own, fastest)


def training_time(results: Results) -> Array:
    """(seeds,): cycles that the perceptron needs over those of CMAC; 1 if neither ever learns."""
    with np.errstate(invalid="ignore"):
        ratios: Array = cycles_to_tenth(results, MLP) / cycles_to_tenth(results, CMAC).mean()
    ratios[np.isnan(ratios)] = 1.0
    return ratios


def left_at_first(results: Results, kind: str = CMAC) -> Array:
    """(seeds,): error of the first cycle after a change, with what was learnt, over that of feedback alone."""
    carried = error_at(results.select(kind=kind, start=CARRIED), 1)
    return carried / _mean(results, ALONE, 1)


def carried_over(results: Results) -> Array:
    """(seeds,): cycles of learning that CMAC needs after a change with its weights, over those from nothing."""
    carried, anew = (_cycles_of_learning(results, start) for start in (CARRIED, ANEW))
    return _over(carried, float(anew.mean()))


def _cycles_of_learning(results: Results, start: str) -> Array:
    """(seeds,): as :func:`cycles_to_tenth`, counted from the cycle in which CMAC begins to learn."""
    first = int(results.select(kind=CMAC, start=start).value("learning.start_cycle"))
    return cycles_to_tenth(results, CMAC, start) - (first - 1)


def cmac_against(results: Results, kinds: Sequence[str]) -> Array:
    """(seeds,): late error of CMAC over that of the best of some kinds."""
    return error_at(results.select(kind=CMAC), LATE) / min(_mean(results, kind, LATE) for kind in kinds)


def without_jumps(results: Results, kind: str) -> Array:
    """(runs,): late error of a kind on a path without jumps of speed, over that with jumps."""
    return error_at(results.select(group=SMOOTH, kind=kind), LATE) / _mean(results.select(group=LEG), kind, LATE)


def at_best_rate(results: Results) -> Array:
    """(seeds,): early error of CMAC over the least of the other learners, each at the best of the rates tried."""
    rated = {kind: results.select(group=[LEG, RATE], kind=kind).by("learning.rate").values() for kind in KEPT}
    best = {kind: min(groups, key=lambda g: float(error_at(g, EARLY).mean())) for kind, groups in rated.items()}
    least = min(float(error_at(best[kind], EARLY).mean()) for kind in KEPT if kind != CMAC)
    return error_at(best[CMAC], EARLY) / least


def slowest_step(results: Results) -> list[float]:
    """Time of a step of the slowest feedforward, the least of its runs, over the sampling period."""
    least = results.computed["cost"].groupby("kind")["seconds_per_step"].min()
    return [float(least.max() / results.value("sampling_period"))]
