"""Samples, tables and figures that several studies share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.run import Run
from cmacexp.metrics.registry import SHOWN
from cmacexp.metrics.text import format_number
from cmacexp.report.curves import find_log
from cmacexp.report.figures import draw
from cmacexp.study import DataFrame, Figure
from cmacexp.study.curves import over_cycles
from cmacexp.study.interval import estimate
from cmacexp.study.quantity import compute_quantity
from cmacexp.study.results import Results
from cmacexp.study.samples import ended_in
from cmacexp.study.statements import ANY, Criterion, Limit
from cmacexp.study.tables import cross_tabulate
from cmacexp.typing import Array, Mask


def share_of_time(run: Run) -> float:
    """Share of the planned time that a run lasted: a measure for studies of machines that may fall."""
    return float(run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]))


def find_least(values: Array, cycles: int) -> float:
    """The least median of so many successive values, (n,)."""
    return float(np.median(sliding_window_view(values, min(cycles, len(values))), axis=1).min())


def cycles_to(errors: Array, level: float) -> Array:
    """(runs,): first cycle from which on errors (runs, cycles) stay at most ``level``; infinite if there is none."""
    above = errors > level
    last = above.shape[1] - above[:, ::-1].argmax(axis=1)
    first = np.where(above.any(axis=1), last + 1.0, 1.0)
    return np.where(first > above.shape[1], np.inf, first)


def describe_end(results: Results, quantity: str) -> str:
    """The estimate of a quantity, or the cycle in which the runs ended."""
    ends, completed = ended_in(results), sum(results.completed)
    if completed == len(results):
        return format_number(estimate(compute_quantity(quantity, results)).value)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({completed} complete)" if completed else "")


def tabulate_ends(
    quantity: str, rows: tuple[str, str], columns: tuple[str, str], of: Mapping[str, Any]
) -> Callable[[Results], DataFrame]:
    """A cross table of :func:`describe_end` of selected runs, see :func:`cmacexp.study.tables.cross_tabulate`."""
    cell = partial(describe_end, quantity=quantity)
    return lambda results: cross_tabulate(results.select(of), rows, columns, cell)


def draw_cycles(results: Results, names: Sequence[str], by: str, columns: int = 2) -> Figure:
    """A figure of :func:`over_cycles` for each metric, logarithmic where its values span decades."""
    panels = [over_cycles(results, name, by) for name in names]
    return draw([replace(panel, log=find_log(panel.series, "y")) for panel in panels], columns)


def itself(
    quantity: str, name: str, sample: str | Callable[[Results], Array], case: str, of: Mapping[str, Any] | None = None
) -> Criterion:
    """A metric in its unit, beside a ratio of it: without a limit, since only what the ratio compares can fail."""
    return Criterion(quantity, sample, ANY, unit=SHOWN[name].unit, scale=SHOWN[name].factor, of=of or {}, case=case)


def percent(
    quantity: str,
    sample: str | Callable[[Results], Sequence[float] | Sequence[bool] | Array | Mask],
    holds: Limit,
    fails: Limit | None = None,
    of: Mapping[str, Any] | None = None,
    case: str = "",
    over: Mapping[str, Any] | None = None,
    **more: Any,
) -> Criterion:
    """A criterion of a share, shown in per cent; ``of`` and ``more`` are settings of its runs."""
    return Criterion(quantity, sample, holds, fails, "%", 100.0, {**(of or {}), **more}, case, over=over)
