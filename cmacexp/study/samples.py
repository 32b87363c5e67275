"""Samples of how far runs came, and of runs compared with others."""

from collections.abc import Callable, Sequence

import numpy as np

from cmacexp.study.interval import UNPAIRED
from cmacexp.study.results import Results
from cmacexp.typing import Array

Sample = Callable[[Results], Array]


def quotients(values: Array, references: Array | float) -> Array:
    """Values over references, pair by pair: infinite where the run failed, ``UNPAIRED`` where its reference did."""
    values, references = np.broadcast_arrays(values, references)
    found = np.where(np.isfinite(references), np.inf, UNPAIRED)
    both = np.isfinite(values) & np.isfinite(references)
    return np.divide(values, references, out=found, where=both)


def growth(late: Array, early: Array) -> Array:
    """(runs,): a value late in each run over one early in the same run; infinite of a run that ended before."""
    return np.divide(late, early, out=np.full(np.shape(late), np.inf), where=np.isfinite(late))


def ended_in(results: Results) -> Array:
    """(runs,): cycle in which each ended before its time; infinite if it completed."""
    return np.where(results.completed, np.inf, np.array(results.cycles) + 1.0)


def relative(results: Results, other: Results, measure: Callable[[Results], Sequence[float] | Array]) -> Array:
    """(runs,): :func:`quotients` of a measure and that of ``other``: by seed, of the only run, or in order."""
    references = np.asarray(measure(other))
    by_seed = dict(zip(_seeds(other), references, strict=True))
    if len(by_seed) == len(other) > 1:
        references = np.array([by_seed[seed] for seed in _seeds(results)])
    return quotients(np.asarray(measure(results)), references)


def per_seed(results: Results, values: Array, choose: Callable[[Array], float]) -> Array:
    """(seeds,): e.g. the least of the values of all runs of one seed."""
    seeds = np.array(_seeds(results))
    return np.array([choose(values[seeds == seed]) for seed in results.values("seed")])


def _seeds(results: Results) -> list[int]:
    return [int(row.settings["seed"]) for row in results.rows]
