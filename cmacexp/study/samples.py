"""Samples of how far runs came, and of runs compared with those of the same seed."""

from collections.abc import Callable, Sequence

import numpy as np

from cmacexp.study.results import Results
from cmacexp.typing import Array


def share_done(results: Results) -> Array:
    """(runs,): whole cycles over those asked for."""
    return np.array([row.summary.cycles / row.settings["cycles"] for row in results.rows])


def relative(results: Results, other: Results, measure: Callable[[Results], Sequence[float] | Array]) -> Array:
    """(runs,): a measure over that of the run of ``other`` with the same seed; infinite where it is itself."""
    reference = dict(zip(_seeds(other), measure(other), strict=True))
    pairs = zip(_seeds(results), measure(results), strict=True)
    return np.array([np.inf if np.isinf(value) else value / reference[seed] for seed, value in pairs])


def per_seed(results: Results, values: Array, choose: Callable[[Array], float]) -> Array:
    """(seeds,): e.g. the least of the values of all runs of one seed."""
    seeds = np.array(_seeds(results))
    return np.array([choose(values[seeds == seed]) for seed in results.values("seed")])


def _seeds(results: Results) -> list[int]:
    return [int(row.settings["seed"]) for row in results.rows]
