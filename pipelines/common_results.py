"""Samples, tables and figures that several studies share."""

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.planning.reference import Gains, compute_support_reference
from cmacexp.study import Array, Results, Run, Status, compute_quantity, ended_in, estimate, format_number


def if_completed(measure: Callable[[Run], float]) -> Callable[[Run], float]:
    """The measure of a run; infinite if it ended before."""
    return wraps(measure)(lambda run: measure(run) if run.status == Status.COMPLETED else np.inf)


def find_least(values: Array, cycles: int) -> float:
    """The least median of so many successive values, (n,)."""
    return float(np.median(sliding_window_view(values, min(cycles, len(values))), axis=1).min())


def cycles_to(errors: Array, level: float | Array) -> Array:
    """(runs,): first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if there is none.

    The level may be one of each run, (runs, 1).
    """
    above = errors > level
    last = above.shape[1] - above[:, ::-1].argmax(axis=1)
    first = np.where(above.any(axis=1), last + 1.0, 1.0)
    return np.where(first > above.shape[1], np.inf, first)


def find_depression(config: Mapping[str, Any], stiffness: float, static_load: bool = True) -> float:
    """Depth of the reference below ground of a ``stiffness``, N/m, per newton of desired force, m/N.

    NaN for a method without a position.
    """
    controller, force = config["controller"], config["force_control"]
    gains = Gains(
        **{name: controller[name] for name in ("position_gain", "velocity_gain")},
        **{name: force[name] for name in ("force_gain", "elasticity", "admittance")},
        stiffness=stiffness,
    )
    return compute_support_reference(force["method"], gains, static_load).depression


def describe_end(results: Results, quantity: str) -> str:
    """The estimate of a quantity, or the cycle in which the runs ended."""
    ends, completed = ended_in(results), sum(results.completed)
    if completed == len(results):
        return format_number(estimate(compute_quantity(quantity, results)).value)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({completed} complete)" if completed else "")
