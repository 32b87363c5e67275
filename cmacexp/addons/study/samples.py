"""Samples: a value for each run of a study, as functions of its results, and how two samples compare.

A quantity is a plain function of :class:`cmacexp.study.Results`: ``lambda runs: runs.end("force_rmse")`` is a final
value, ``lambda runs: runs.at(5, "force_rmse")`` that of cycle 5.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cmacexp.addons.study.interval import UNPAIRED
from cmacexp.addons.study.results import Results
from cmacexp.errors import require
from cmacexp.typing import Array, Mask

Sample = Callable[[Results], Sequence[float] | Sequence[bool] | Array | Mask]
"""A value for each run, pair or case; truth values for a proportion."""


def require_sample(key: str, value: Any) -> None:
    """Require of a quantity that it is a function; raises BadInput, which says how to write one."""
    require(
        callable(value),
        key,
        value,
        "must be a function of the results, such as lambda runs: runs.at(5, 'force_rmse'), runs.end('force_rmse') "
        "or runs.completed",
    )


def quotients(values: Array, references: Array | float) -> Array:
    """Values over references, pair by pair: infinite where the run failed, ``UNPAIRED`` where its reference did."""
    values, references = np.broadcast_arrays(values, references)
    found = np.where(np.isfinite(references), np.inf, UNPAIRED)
    both = np.isfinite(values) & np.isfinite(references)
    return np.divide(values, references, out=found, where=both)


def compute_growth(late: Array, early: Array) -> Array:
    """(runs,): a value late in each run over one early in the same run; infinite of a run that ended before."""
    return np.divide(late, early, out=np.full(np.shape(late), np.inf), where=np.isfinite(late))


def ended_in(results: Results) -> Array:
    """(runs,): cycle in which each ended before its time; infinite if it completed."""
    return np.where(results.completed, np.inf, np.array(results.cycles) + 1.0)


def relative(results: Results, other: Results, measure: Sample) -> Array:
    """(runs,): :func:`quotients` of a measure and that of ``other``: by seed, of the only run, or in order."""
    references = np.asarray(measure(other))
    by_seed = dict(zip(_list_seeds(other), references, strict=True))
    if len(by_seed) == len(other) > 1:
        references = np.array([by_seed[seed] for seed in _list_seeds(results)])
    return quotients(np.asarray(measure(results)), references)


def per_seed(results: Results, values: Array, choose: Callable[[Array], float]) -> Array:
    """(seeds,): e.g. the least of the values of all runs of one seed."""
    seeds = np.array(_list_seeds(results))
    return np.array([choose(values[seeds == seed]) for seed in results.values("seed")])


def _list_seeds(results: Results) -> list[int]:
    return [int(row.settings["seed"]) for row in results.rows]
