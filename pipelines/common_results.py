"""Measures of runs, samples of results and table cells that several studies share."""

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
    """Wrap the measure of a run so that it is infinite for a run that did not complete."""
    return wraps(measure)(lambda run: measure(run) if run.status == Status.COMPLETED else np.inf)


def slide_median(values: Array, cycles: int) -> Array:
    """Compute moving medians of values (n,) over windows of ``cycles`` values, (n - cycles + 1,)."""
    return np.asarray(np.median(sliding_window_view(values, min(cycles, len(values))), axis=1))


def cycles_to(errors: Array, level: float | Array) -> Array:
    """Find the first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if none, (runs,).

    The level is one number, or one per run, (runs, 1).
    """
    cycles = np.arange(1, errors.shape[1] + 1)
    first = np.where(errors > level, cycles, 0).max(axis=1) + 1.0
    return np.where(first > len(cycles), np.inf, first)


def find_depression(config: Mapping[str, Any], stiffness: float | None = None, static_load: bool = True) -> float:
    """Compute the depth of the reference below ground per newton of desired force, m/N.

    ``stiffness`` is that of the ground, N/m; None takes the true one of the config. ``static_load`` includes the
    static load F_d/K_ap of eq. 13. NaN for a method of force control without a position reference.
    """
    gains = Gains(
        **{name: config["controller"][name] for name in ("position_gain", "velocity_gain")},
        **{name: config["force_control"][name] for name in ("force_gain", "elasticity", "admittance")},
        stiffness=config["terrain"]["stiffness"] if stiffness is None else stiffness,
    )
    return compute_support_reference(config["force_control"]["method"], gains, static_load).depression


def describe_end(results: Results, quantity: Sample) -> str:
    """Format the estimate of a quantity if all runs completed, else the median cycle in which runs ended."""
    completed = sum(results.completed)
    if completed == len(results):
        return format_number(estimate(quantity(results)).value)
    ends = ended_in(results)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({completed} complete)" if completed else "")


def count_per_cell(run: Run, name: str) -> float:
    """Return a memory count of the manifest over the number of visited cells, both summed over all legs."""
    legs = run.manifest["memory"]
    return float(sum(leg[name] for leg in legs) / sum(leg["cells_visited"] for leg in legs))


MEMORY_MEASURES: Measures = {
    "colliding": partial(count_per_cell, name="cells_colliding"),
    "rows_per_cell": partial(count_per_cell, name="rows"),
}
"""Share of the visited cells whose memory row another visited cell shares; memory rows per visited cell."""


def worsening(compared: Results, base: Results, cycle: int | None = None) -> Array:
    """Return the ratio of the transfer errors of runs to those of paired runs, (runs of ``compared``,).

    The paired run of ``base`` has the same world or seed. Of the ratios in x and y the larger one counts, in
    ``cycle`` or, if None, at the end. The error of a run that ended early is infinite.
    """

    def error(results: Results, side: str) -> Array:
        return results.end(side) if cycle is None else results.at(cycle, side)

    return np.max([relative(compared, base, partial(error, side=side)) for side in SIDES], axis=0)


def hashed_where(results: Results, measure: str, least: float, most: float = np.inf) -> Results:
    """Select the runs with hashed memory in which a measure of the study is from ``least`` to ``most``."""
    hashed = results.select({"cmac.addressing": "hashed"})
    return Results([row for row in hashed.rows if least <= row.measures[measure] <= most])


def cost_of_collisions(results: Results, measure: str, least: float, most: float = np.inf) -> Array:
    """Return the errors in the runs of :func:`hashed_where` relative to runs without collisions, (runs,)."""
    return worsening(hashed_where(results, measure, least, most), results.select({"cmac.addressing": "visited"}))


def worst_in_worlds(results: Results, measure: str, least: float) -> Array:
    """Return the largest :func:`cost_of_collisions` in each world, (worlds,)."""
    return per_seed(hashed_where(results, measure, least), cost_of_collisions(results, measure, least), max)
