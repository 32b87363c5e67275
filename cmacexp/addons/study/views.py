"""Panels and tables of results: over cycles, over a setting, and a row for each group of runs."""

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
    """A metric in every cycle: the median over runs with the same value of ``by``, and their range as a band.

    ``title`` replaces the metric's own.
    """
    return figures.over_cycles(
        name, {value: group.history(name) for value, group in results.by(by).items()}, log, title
    )


def _interval(sample: Array) -> tuple[float, float, float]:
    found = estimate(sample)
    return found.value, found.low, found.high


def over_setting(
    results: Results,
    key: str,
    y: str,
    sample: Callable[[Results], Array],
    by: str | None = None,
    *,
    title: str = "",
    log: str = "",
    kind: str = "lines",
    axis: str = "",
    place: Callable[[Results], float] | None = None,
) -> Panel:
    """An estimate with its interval, if the sample has a spread, against a setting; none where it is infinite.

    Args:
        results: to draw.
        key: setting on the x axis; of bars, whose groups are in the order of the runs, it need not be numeric.
        y: name and unit of the y axis.
        sample: a value for each run.
        by: a setting with a series for each of its values.
        title: of the panel.
        log: logarithmic axes.
        kind: of the panel.
        axis: name and unit of the x axis, if not ``key``.
        place: on the x axis of runs with one value of the setting, if not the value itself.
    """
    groups = {
        name: {place(part) if place else value: sample(part) for value, part in group.by(key).items()}
        for name, group in (results.by(by) if by else {"": results}).items()
    }
    x = axis or ("" if kind == "bars" else key)
    return figures.over_setting(groups, x, y, _interval, kind=kind, log=log, title=title, order=results.values(key))


def tabulate(results: Results, by: Mapping[str, str], columns: Mapping[str, Callable[[Results], Any]]) -> DataFrame:
    """A row for each combination of settings that occurs: their values, and what functions give of its runs.

    Args:
        results: to tabulate.
        by: titles of columns, by the setting whose values they hold.
        columns: functions by the titles of further columns; of an array, a value for each run, the estimate is shown.
    """
    import pandas as pd

    groups: list[tuple[dict[str, Any], Results]] = [({}, results)]
    for key, title in by.items():
        groups = [({**names, title: value}, own) for names, part in groups for value, own in part.by(key).items()]
    return pd.DataFrame(
        names | {title: _show(compute(own)) for title, compute in columns.items()} for names, own in groups
    )


def cross_tabulate(
    results: Results, rows: tuple[str, str], columns: tuple[str, str], cell: Callable[[Results], Any]
) -> DataFrame:
    """A row for each value of one setting, a column for each value of another; ``cell`` shows the runs with both.

    ``rows`` are the first setting and the title of its column, ``columns`` the second and what its titles begin with.
    """
    values = {f"{columns[1]} {value}": {columns[0]: value} for value in results.values(columns[0])}
    found = {title: (lambda own, chosen=chosen: cell(own.select(chosen))) for title, chosen in values.items()}
    return tabulate(results, {rows[0]: rows[1]}, found)


def _show(value: Any) -> Any:
    """The estimate of a value for each run, NaN if there is none or one is undefined; anything else as it is."""
    if not isinstance(value, np.ndarray):
        return value
    return estimate(value).value if len(value) and not np.isnan(value).any() else np.nan


def completed(results: Results) -> str:
    """How many runs reached their end, e.g. ``2 of 3``."""
    return f"{sum(results.completed)} of {len(results)}"


def _compute_reached(sample: Sample, results: Results) -> Any:
    """The sample; None of a cycle that runs were not to reach, as those of a quick form."""
    try:
        return sample(results)
    except BadInput as error:
        if error.key not in ("cycle", "metric"):
            raise
        return None


def of_completed(columns: Mapping[str, Sample]) -> dict[str, Callable[[Results], Any]]:
    """Columns of a table: each quantity in the runs that completed, or in all if none did."""

    def show(results: Results, sample: Sample) -> Any:
        done = [row for row in results.rows if row.run.completed] or results.rows
        return _compute_reached(sample, Results(done, results.computed))

    return {title: partial(show, sample=sample) for title, sample in columns.items()}


def describe_estimates(results: Results, *samples: Sample) -> str | None:
    """The estimates of several quantities, and of how many runs they are if some failed, e.g. ``6 / 18 (2 of 3)``."""
    values = [_compute_reached(sample, results) for sample in samples]
    if any(value is None for value in values):
        return None
    found = [estimate(value) for value in values]
    text = " / ".join(format_number(each.value) for each in found)
    return f"{text} ({found[-1].size})" if found[-1].failed else text
