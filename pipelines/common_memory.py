"""How well a CMAC's memory holds the cells that its path visits, and what collisions in it cost."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import Array, Results, Run, per_seed, quotients, relative

SIDES = ("transfer_rmse_x", "transfer_rmse_y")


def rows_per_cell(run: Run) -> float:
    """Rows of memory for each visited cell of all legs."""
    return _sum(run, "rows") / _sum(run, "cells_visited")


def colliding(run: Run) -> float:
    """Share of the visited cells of all legs that share a row with another one."""
    return _sum(run, "cells_colliding") / _sum(run, "cells_visited")


def _sum(run: Run, key: str) -> int:
    return sum(int(leg[key]) for leg in run.manifest["memory"])


def _errors(results: Results, side: str, cycle: int | None) -> Array:
    return results.end(side) if cycle is None else results.at(cycle, side)


def worsening(own: Results, base: Results, cycle: int | None = None) -> Array:
    """(runs of ``own``,): transfer errors over the mean of ``base``, in x or y, the larger.

    Args:
        own: runs to compare; one that ended early counts as infinitely large.
        base: runs to compare with.
        cycle: whose errors; None: at the end.
    """
    return np.max([quotients(_errors(own, side, cycle), _errors(base, side, cycle).mean()) for side in SIDES], axis=0)


def worsening_in_worlds(own: Results, base: Results, cycle: int | None = None) -> Array:
    """(runs of ``own``,): as :func:`worsening`, over the run of ``base`` in the same world, or of the same seed."""
    return np.max([relative(own, base, partial(_errors, side=side, cycle=cycle)) for side in SIDES], axis=0)


def hashed(results: Results) -> Results:
    """The runs with hashed memory."""
    return results.select({"cmac.addressing": "hashed"})


def cost_of_collisions(results: Results) -> Array:
    """(hashed runs,): :func:`worsening` of the runs with hashed memory against the one without collisions."""
    return worsening(hashed(results), results.select({"cmac.addressing": "visited"}))


def cost_against(results: Results) -> Callable[[Results], Array]:
    """A sample of hashed runs with one rule: errors over those of the run of the same world without collisions."""
    free = results.select({"cmac.addressing": "visited"}).by("rule")
    return lambda own: worsening_in_worlds(own, free[own.value("rule")])


def worst_in_worlds(results: Results, measure: str, least: float) -> Array:
    """(worlds,): the largest cost of collisions of the hashed runs in which a measure is at least so large."""
    chosen = Results([row for row in hashed(results).rows if row.measures[measure] >= least])
    free = results.select({"cmac.addressing": "visited"})
    return per_seed(chosen, worsening_in_worlds(chosen, free), max)


def where_hashed(
    measure: str, least: float, sample: Callable[[Results], Any] = cost_of_collisions
) -> Callable[[Results], Any]:
    """A sample of the hashed runs in which a measure of the study is at least so large."""
    return lambda results: np.asarray(sample(results))[hashed(results).measure(measure) >= least]
