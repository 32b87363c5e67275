"""Panels of results: a metric over cycles or over a setting, a series for each value of another setting."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.metrics.metric import Shown
from cmacexp.metrics.registry import ALL_METRICS, SHOWN
from cmacexp.report.figure_data import spans_decades
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.run_summary import format_value
from cmacexp.study.interval import estimate
from cmacexp.study.results import Results
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def appearance(name: str) -> Shown:
    """How a metric appears; one that tables do not show, under its name and in its unit."""
    return SHOWN.get(name) or Shown(name.replace("_", " "), ALL_METRICS[name].unit)


def over_cycles(results: Results, name: str, by: str, log: str = "", title: str = "") -> Panel:
    """A metric in every cycle: the median over runs with the same value of ``by``, and their range as a band.

    ``title`` replaces the metric's own.
    """
    shown = appearance(name)
    title = title or shown.title
    series = []
    for value, own in results.by(by).items():
        histories = own.history(name)
        length = max(map(len, histories))
        padded = np.array([np.pad(h, (0, length - len(h)), constant_values=np.nan) for h in histories]) * shown.factor
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a cycle in which no run defines the metric
            middle, low, high = np.nanmedian(padded, 0), np.nanmin(padded, 0), np.nanmax(padded, 0)
        band = (low, high) if len(histories) > 1 else (None, None)
        series.append(Series(format_value(value), np.arange(1, length + 1), middle, *band))
    y = f"{title}, {shown.unit}".rstrip(", ")
    return Panel(title, "cycle", y, series, log=log, from_zero=shown.from_zero)


def draw_cycles(results: Results, names: Sequence[str], by: str, columns: int = 2) -> "Figure":
    """A figure of :func:`over_cycles` for each metric, logarithmic where its values span decades."""
    panels = []
    for name in names:
        panel = over_cycles(results, name, by)
        values = np.concatenate([np.asarray(series.y) for series in panel.series])
        panels.append(replace(panel, log="y" if spans_decades(values) else ""))
    return draw(panels, columns)


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
    groups: dict[Any, Results] = results.by(by) if by else {"": results}
    series, ticks = [], [format_value(value) for value in results.values(key)] if kind == "bars" else []
    for name, own in groups.items():
        parts = own.by(key)
        if kind == "bars":
            placed = {float(ticks.index(format_value(value))): part for value, part in parts.items()}
        else:
            placed = {place(part) if place else float(value): part for value, part in parts.items()}
            placed = {x: placed[x] for x in sorted(placed)}
        found = [estimate(sample(part)) for part in placed.values()]
        spread = [each.has_spread for each in found]
        middle, low, high = (_finite([getattr(each, side) for each in found]) for side in ("value", "low", "high"))
        band = (np.where(spread, low, middle), np.where(spread, high, middle)) if any(spread) else (None, None)
        series.append(Series(format_value(name), list(placed), middle, *band))
    return Panel(title, axis or ("" if ticks else key), y, series, kind=kind, log=log, ticks=ticks)


def _finite(values: list[float]) -> Array:
    return np.where(np.isfinite(values), values, np.nan)
