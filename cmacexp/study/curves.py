"""Panels of results: a metric over cycles or over a setting, a series for each value of another setting."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from cmacexp.metrics.metric import Shown
from cmacexp.metrics.registry import ALL_METRICS, SHOWN
from cmacexp.report.figures import Panel, Series
from cmacexp.report.run_summary import format_value
from cmacexp.study.interval import estimate
from cmacexp.study.results import Results
from cmacexp.typing import Array


def _appearance(name: str) -> Shown:
    """How a metric appears; one that tables do not show, under its name and in its unit."""
    return SHOWN.get(name) or Shown(name.replace("_", " "), ALL_METRICS[name].unit)


def over_cycles(results: Results, name: str, by: str, log: str = "") -> Panel:
    """A metric in every cycle: the median over runs with the same value of ``by``, and their range as a band."""
    shown = _appearance(name)
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
    y = f"{shown.title}, {shown.unit}".rstrip(", ")
    return Panel(shown.title, "cycle", y, series, log=log, from_zero=shown.from_zero)


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
) -> Panel:
    """An estimate with its interval, if the sample has a spread, against a numeric setting.

    Args:
        results: to draw.
        key: setting on the x axis.
        y: name and unit of the y axis.
        sample: a value for each run.
        by: a setting with a series for each of its values.
        title: of the panel.
        log: logarithmic axes.
        kind: of the panel.
    """
    groups: dict[Any, Results] = results.by(by) if by else {"": results}
    series = []
    for name, own in groups.items():
        parts = {float(value): part for value, part in own.by(key).items()}
        x = sorted(parts)
        found = [estimate(sample(parts[value])) for value in x]
        spread = [each.has_spread for each in found]
        low = [each.low if wide else each.value for each, wide in zip(found, spread, strict=True)]
        high = [each.high if wide else each.value for each, wide in zip(found, spread, strict=True)]
        band = (low, high) if any(spread) else (None, None)
        series.append(Series(format_value(name), x, [each.value for each in found], *band))
    return Panel(title, key, y, series, kind=kind, log=log)
