"""How well a CMAC's memory holds the cells that its path visits, and what collisions in it cost."""

from collections.abc import Callable
from functools import partial

import numpy as np

from cmacexp.study import Array, Results, Run, compute_quantity, per_seed, relative

SIDES = ("transfer_rmse_x", "transfer_rmse_y")


def rows_per_cell(run: Run) -> float:
    """Rows of memory for each visited cell of all legs."""
    return _sum(run, "rows") / _sum(run, "cells_visited")


def colliding(run: Run) -> float:
    """Share of the visited cells of all legs that share a row with another one."""
    return _sum(run, "cells_colliding") / _sum(run, "cells_visited")


def _sum(run: Run, key: str) -> int:
    return sum(int(leg[key]) for leg in run.manifest["memory"])


def worsening(own: Results, base: Results, at: str = "") -> Array:
    """(runs of ``own``,): transfer errors over those of ``base`` in the same world, or of the same seed; the larger.

    ``at`` is the cycle, ``[5]``; empty: at the end. A run that ended early counts as infinitely large.
    """
    samples = [partial(compute_quantity, f"{side}{at}") for side in SIDES]
    return np.max([relative(own, base, sample) for sample in samples], axis=0)


def hashed(results: Results) -> Results:
    """The runs with hashed memory."""
    return results.select({"cmac.addressing": "hashed"})


def hashed_where(results: Results, measure: str, least: float) -> Results:
    """Those in which a measure of the study is at least so large."""
    return Results([row for row in hashed(results).rows if row.measures[measure] >= least])


def cost_of_collisions(results: Results, measure: str, least: float) -> Array:
    """Errors in the runs of :func:`hashed_where` over those without collisions."""
    return worsening(hashed_where(results, measure, least), results.select({"cmac.addressing": "visited"}))


def worst_in_worlds(results: Results, measure: str, least: float) -> Array:
    """(worlds,): the largest :func:`cost_of_collisions`."""
    return per_seed(hashed_where(results, measure, least), cost_of_collisions(results, measure, least), max)


def cost_against(results: Results) -> Callable[[Results], Array]:
    """A sample of hashed runs with one rule: errors over those of the run of the same world without collisions."""
    free = results.select({"cmac.addressing": "visited"}).by("rule")
    return lambda own: worsening(own, free[own.value("rule")])
