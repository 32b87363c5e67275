"""Samples: functions that compute one value per run from the results of a study, and ratios of two samples.

A quantity is a plain function of :class:`cmacexp.study.Results`: ``lambda runs: runs.end("force_rmse")`` computes
final values, ``lambda runs: runs.at(5, "force_rmse")`` the values of cycle 5.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cmacexp.addons.study.interval import UNPAIRED
from cmacexp.addons.study.results import Results
from cmacexp.errors import require
from cmacexp.typing import Array, Mask

Sample = Callable[[Results], Sequence[float] | Sequence[bool] | Array | Mask]
"""Function that computes one value per run, pair of runs or case; Boolean values for a proportion."""


def require_sample(key: str, value: Any) -> None:
    """Raise BadInput unless the quantity ``value`` is a function; the message says how to write one."""
    require(
        callable(value),
        key,
        value,
        "must be a function of the results, such as lambda runs: runs.at(5, 'force_rmse'), runs.end('force_rmse') "
        "or runs.completed",
    )


def quotients(values: Array, references: Array | float) -> Array:
    """Divide values by references, pair by pair.

    A quotient is infinite if the run failed and ``UNPAIRED`` if its reference failed (the value is not finite).
    """
    values, references = np.broadcast_arrays(values, references)
    undefined = np.where(np.isfinite(references), np.inf, UNPAIRED)
    both = np.isfinite(values) & np.isfinite(references)
    return np.divide(values, references, out=undefined, where=both)


def compute_growth(late: Array, early: Array) -> Array:
    """Divide a late value of each run by an early one of the same run, (runs,); infinite if the run ended before."""
    return np.divide(late, early, out=np.full(np.shape(late), np.inf), where=np.isfinite(late))


def ended_in(results: Results) -> Array:
    """Return the cycle in which each run ended early, (runs,); infinite if the run completed."""
    return np.where(results.completed, np.inf, np.array(results.cycles) + 1.0)


def relative(results: Results, other: Results, measure: Sample) -> Array:
    """Divide a measure of ``results`` by the same measure of the runs ``other``, (runs,), with :func:`quotients`.

    If each run of ``other`` has a different seed, it is the reference of the runs with its seed; a single run of
    ``other`` is the reference of all runs; else the runs are paired in order.
    """
    references = np.asarray(measure(other))
    by_seed = dict(zip(_list_seeds(other), references, strict=True))
    if len(by_seed) == len(other) > 1:
        references = np.array([by_seed[seed] for seed in _list_seeds(results)])
    return quotients(np.asarray(measure(results)), references)


def per_seed(results: Results, values: Array, choose: Callable[[Array], float]) -> Array:
    """Reduce the values (runs,) of the runs of each seed by ``choose``, such as their minimum; returns (seeds,)."""
    seeds = np.array(_list_seeds(results))
    return np.array([choose(values[seeds == seed]) for seed in results.values("seed")])


def _list_seeds(results: Results) -> list[int]:
    return [int(row.settings["seed"]) for row in results.rows]
