"""Samples of how far runs came, and of runs compared with others."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cmacexp.study.results import Results
from cmacexp.typing import Array

Sample = Callable[[Results], Array]


def ratio(sample: Sample, chosen: Mapping[str, Any], reference: Mapping[str, Any]) -> Sample:
    """A sample of the runs with some settings over that of the runs with others, in order; or over the only one."""
    return lambda results: sample(results.select(chosen)) / sample(results.select(reference))


def ended_in(results: Results) -> Array:
    """(runs,): cycle in which each ended before its time; infinite if it completed."""
    return np.where(results.completed, np.inf, np.array(results.cycles) + 1.0)


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
