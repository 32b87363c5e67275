"""Measures, samples and cells of tables that several studies share."""

from collections.abc import Callable, Mapping
from functools import partial, wraps
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.planning.reference import Gains, compute_support_reference
from cmacexp.study import (
    Array,
    Measures,
    Results,
    Run,
    Sample,
    Status,
    ended_in,
    estimate,
    format_number,
    per_seed,
    relative,
)

SIDES = ("transfer_rmse_x", "transfer_rmse_y")


def if_completed(measure: Callable[[Run], float]) -> Callable[[Run], float]:
    """The measure of a run; infinite if it ended before."""
    return wraps(measure)(lambda run: measure(run) if run.status == Status.COMPLETED else np.inf)


def slide_median(values: Array, cycles: int) -> Array:
    """Medians of every so many successive values, (n,)."""
    return np.asarray(np.median(sliding_window_view(values, min(cycles, len(values))), axis=1))


def cycles_to(errors: Array, level: float | Array) -> Array:
    """(runs,): first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if there is none.

    The level may be one of each run, (runs, 1).
    """
    cycles = np.arange(1, errors.shape[1] + 1)
    first = np.where(errors > level, cycles, 0).max(axis=1) + 1.0
    return np.where(first > len(cycles), np.inf, first)


def find_depression(config: Mapping[str, Any], stiffness: float | None = None, static_load: bool = True) -> float:
    """Depth of the reference below ground of a ``stiffness``, N/m, per newton of desired force, m/N.

    That of the true ground if it is None. NaN for a method without a position.
    """
    controller, force = config["controller"], config["force_control"]
    gains = Gains(
        **{name: controller[name] for name in ("position_gain", "velocity_gain")},
        **{name: force[name] for name in ("force_gain", "elasticity", "admittance")},
        stiffness=config["terrain"]["stiffness"] if stiffness is None else stiffness,
    )
    return compute_support_reference(force["method"], gains, static_load).depression


def describe_end(results: Results, quantity: Sample) -> str:
    """The estimate of a quantity, or the cycle in which the runs ended."""
    ends, completed = ended_in(results), sum(results.completed)
    if completed == len(results):
        return format_number(estimate(quantity(results)).value)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({completed} complete)" if completed else "")


def divide_memory(run: Run, part: str, whole: str = "cells_visited") -> float:
    """A count of the memory of all legs over another one, both as the manifest names them."""
    legs = run.manifest["memory"]
    return float(sum(leg[part] for leg in legs) / sum(leg[whole] for leg in legs))


MEMORY_MEASURES: Measures = {
    "colliding": partial(divide_memory, part="cells_colliding"),
    "rows_per_cell": partial(divide_memory, part="rows"),
}
"""Share of the visited cells that share a row with another one; rows of memory for each visited cell."""


def worsening(own: Results, base: Results, cycle: int | None = None) -> Array:
    """(runs of ``own``,): transfer errors over those of ``base`` in the same world, or of the same seed; the larger.

    Without a ``cycle`` they are the final ones. A run that ended early counts as infinitely large.
    """

    def error(results: Results, side: str) -> Array:
        return results.end(side) if cycle is None else results.at(cycle, side)

    return np.max([relative(own, base, partial(error, side=side)) for side in SIDES], axis=0)


def hashed_where(results: Results, measure: str, least: float) -> Results:
    """The runs with hashed memory in which a measure of the study is at least so large."""
    hashed = results.select({"cmac.addressing": "hashed"})
    return Results([row for row in hashed.rows if row.measures[measure] >= least])


def cost_of_collisions(results: Results, measure: str, least: float) -> Array:
    """Errors in the runs of :func:`hashed_where` over those without collisions."""
    return worsening(hashed_where(results, measure, least), results.select({"cmac.addressing": "visited"}))


def worst_in_worlds(results: Results, measure: str, least: float) -> Array:
    """(worlds,): the largest :func:`cost_of_collisions`."""
    return per_seed(hashed_where(results, measure, least), cost_of_collisions(results, measure, least), max)
