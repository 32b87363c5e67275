"""Panels over cycles or over a setting, and tables with one row per group of runs."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from cmacexp.addons.study.interval import estimate
from cmacexp.addons.study.results import Results
from cmacexp.addons.study.samples import Sample
from cmacexp.errors import BadInput
from cmacexp.metrics.registry import format_number
from cmacexp.report import figures
from cmacexp.report.figures import Panel
from cmacexp.typing import Array, DataFrame


def over_cycles(results: Results, name: str, by: str, log: str = "", title: str = "") -> Panel:
    """Make a panel of a metric over cycles: median of the runs with equal value of ``by``, their range as a band.

    ``log`` names the logarithmic axes; ``title`` replaces the name of the metric in the title and on the y axis.
    """
    return figures.over_cycles(
        name, {value: group.history(name) for value, group in results.by(by).items()}, log, title
    )


def _interval(sample: Array) -> tuple[float, float, float]:
    interval = estimate(sample)
    return interval.value, interval.low, interval.high


def over_setting(
    results: Results,
    key: str,
    y: str,
    sample: Callable[[Results], Array],
    by: str | None = None,
    *,
    axis: str = "",
    place: Callable[[Results], float] | None = None,
    **style: str,
) -> Panel:
    """Make a panel of an estimate over a setting, with its interval if the sample has a spread.

    Infinite estimates are not drawn.

    Args:
        results: results to draw.
        key: setting on the x axis; only lines need a numeric setting; groups of bars are in the order of the runs.
        y: label of the y axis, with its unit.
        sample: function that computes one value per run.
        by: setting that divides the runs into series, one per value.
        axis: label of the x axis, with its unit; empty: ``key``, or no label for bars.
        place: function that computes the x coordinate of the runs with one value of the setting; None: the value.
        style: ``title``, ``kind`` and ``log`` of the panel, see :class:`cmacexp.report.figures.Panel`.
    """
    groups = {
        name: {place(runs) if place else value: sample(runs) for value, runs in group.by(key).items()}
        for name, group in (results.by(by) if by else {"": results}).items()
    }
    x = axis or ("" if style.get("kind") == "bars" else key)
    return figures.over_setting(groups, x, y, _interval, order=results.values(key), **style)


def tabulate(results: Results, by: Mapping[str, str], columns: Mapping[str, Callable[[Results], Any]]) -> DataFrame:
    """Make a table with one row per combination of settings: their values and functions of the runs that have them.

    Args:
        results: results to tabulate.
        by: column titles by setting; each column holds the values of its setting.
        columns: functions of the runs of a row, by column title; if one returns an array (runs,), its estimate is
            shown.
    """
    import pandas as pd

    groups: list[tuple[dict[str, Any], Results]] = [({}, results)]
    for key, title in by.items():
        groups = [
            ({**cells, title: value}, subset) for cells, runs in groups for value, subset in runs.by(key).items()
        ]
    return pd.DataFrame(
        cells | {title: _reduce(compute(runs)) for title, compute in columns.items()} for cells, runs in groups
    )


def cross_tabulate(
    results: Results, rows: tuple[str, str], columns: tuple[str, str], cell: Callable[[Results], Any]
) -> DataFrame:
    """Make a table with a row per value of one setting, a column per value of another.

    ``rows`` holds the first setting and the title of its column, ``columns`` the second setting and the prefix of its
    column titles. ``cell`` computes the entry of a cell from the runs that have both values.
    """
    values = {f"{columns[1]} {value}": {columns[0]: value} for value in results.values(columns[0])}
    cells = {title: (lambda runs, chosen=chosen: cell(runs.select(chosen))) for title, chosen in values.items()}
    return tabulate(results, {rows[0]: rows[1]}, cells)


def _reduce(value: Any) -> Any:
    """Estimate the value of an array (runs,), NaN if it is empty or contains NaN; return anything else unchanged."""
    if not isinstance(value, np.ndarray):
        return value
    return estimate(value).value if len(value) and not np.isnan(value).any() else np.nan


def completed(results: Results) -> str:
    """Format the number of completed runs, e.g. ``2 of 3``."""
    return f"{sum(results.completed)} of {len(results)}"


def _compute_reached(sample: Sample, results: Results) -> Any:
    """Compute a sample; None if its cycle or metric is missing, e.g. a cycle beyond the last one of a quick study."""
    try:
        return sample(results)
    except BadInput as error:
        if error.key not in ("cycle", "metric"):
            raise
        return None


def of_completed(columns: Mapping[str, Sample]) -> dict[str, Callable[[Results], Any]]:
    """Return table columns that compute each sample over the completed runs, or over all runs if none completed."""

    def show(results: Results, sample: Sample) -> Any:
        done = [row for row in results.rows if row.run.completed] or results.rows
        return _compute_reached(sample, Results(done, results.computed))

    return {title: partial(show, sample=sample) for title, sample in columns.items()}


def describe_estimates(results: Results, *samples: Sample) -> str | None:
    """Format the estimates of several samples, e.g. ``5.66 / 17 (2 of 3)``: with the number of runs if some failed.

    Returns None if one of them cannot be computed, e.g. in a quick study.
    """
    values = [_compute_reached(sample, results) for sample in samples]
    if any(value is None for value in values):
        return None
    intervals = [estimate(value) for value in values]
    text = " / ".join(format_number(interval.value) for interval in intervals)
    return f"{text} ({intervals[-1].size})" if intervals[-1].failed else text
