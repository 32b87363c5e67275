"""Samples, tables and figures that several studies share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.run import Run
from cmacexp.metrics.registry import SHOWN
from cmacexp.metrics.text import format_number
from cmacexp.report.curves import find_log
from cmacexp.report.figures import draw
from cmacexp.study.curves import over_cycles
from cmacexp.study.interval import estimate
from cmacexp.study.results import Results
from cmacexp.study.samples import ended_in
from cmacexp.study.statements import ANY, Criterion, Limit
from cmacexp.typing import Array, Mask

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def share_of_time(run: Run) -> float:
    """Share of the planned time that a run lasted: a measure for studies of machines that may fall."""
    return float(run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]))


def find_least(values: Array, cycles: int) -> float:
    """The least median of so many successive values, (n,)."""
    return float(np.median(sliding_window_view(values, min(cycles, len(values))), axis=1).min())


def share_done(results: Results) -> Array:
    """(runs,): whole cycles over those asked for."""
    return np.array([row.run.cycles_done / row.settings["cycles"] for row in results.rows])


def describe_end(results: Results, values: Array) -> str:
    """The estimate from one value a run, or the cycle in which the runs ended."""
    ends, completed = ended_in(results), sum(results.completed)
    if completed == len(results):
        return format_number(estimate(values).value)
    return f"ends in {np.median(ends[np.isfinite(ends)]):.0f}" + (f" ({completed} complete)" if completed else "")


def draw_cycles(results: Results, names: Sequence[str], by: str, columns: int = 2) -> "Figure":
    """A figure of :func:`over_cycles` for each metric, logarithmic where its values span decades."""
    panels = [over_cycles(results, name, by) for name in names]
    return draw([replace(panel, log=find_log(panel.series, "y")) for panel in panels], columns)


def itself(
    quantity: str, name: str, sample: Callable[[Results], Array], case: str, of: Mapping[str, Any] | None = None
) -> Criterion:
    """A metric in its unit, beside a ratio of it: without a limit, since only what the ratio compares can fail."""
    return Criterion(quantity, sample, ANY, unit=SHOWN[name].unit, scale=SHOWN[name].factor, of=of or {}, case=case)


def percent(
    quantity: str,
    sample: Callable[[Results], Sequence[float] | Sequence[bool] | Array | Mask],
    holds: Limit,
    fails: Limit | None = None,
    of: Mapping[str, Any] | None = None,
    case: str = "",
    **more: Any,
) -> Criterion:
    """A criterion of a share, shown in per cent; ``of`` and ``more`` are settings of its runs."""
    return Criterion(quantity, sample, holds, fails, "%", 100.0, {**(of or {}), **more}, case)
