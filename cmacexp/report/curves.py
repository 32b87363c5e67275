"""Panels of metrics, over the cycles and over a setting, for reports of runs, sweeps and studies."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, SHOWN, format_setting
from cmacexp.report.figures import Panel, Series
from cmacexp.report.style import nested
from cmacexp.typing import Array

Reduce = Callable[[Array], tuple[float, float, float]]
"""The value of a sample, and the ends of its band."""


def is_numeric(values: Sequence[Any]) -> bool:
    """Whether values can stand on an axis of numbers."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def over_cycles(name: str, groups: Mapping[Any, Sequence[Array]], log: str | None = None, title: str = "") -> Panel:
    """A metric in every cycle: the median over the runs of each group, and their range as a band.

    Groups are histories in SI units, by what their runs have in common. Axes are logarithmic, unless ``log`` says
    which, where values span decades. A metric that tables do not show appears under its name and in its unit.
    """
    shown = SHOWN.get(name) or MetricDisplay(name.replace("_", " "), ALL_METRICS[name].unit)
    title, series = title or shown.title, []
    for index, (value, histories) in enumerate(groups.items()):
        length = max(map(len, histories))
        padded = np.array([np.pad(h, (0, length - len(h)), constant_values=np.nan) for h in histories]) * shown.factor
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a cycle in which no run defines the metric
            middle, low, high = np.nanmedian(padded, 0), np.nanmin(padded, 0), np.nanmax(padded, 0)
        series.append(
            Series(format_setting(value), np.arange(1, length + 1), middle, low, high, nested(index, len(groups)))
        )
    return Panel(title, "cycle", f"{title}, {shown.unit}".rstrip(", "), series, log=log, from_zero=shown.from_zero)


def over_setting(
    groups: Mapping[Any, Mapping[Any, Array]],
    x: str,
    y: str,
    reduce: Reduce = lambda values: (float(values.mean()), float(values.min()), float(values.max())),
    *,
    kind: str = "lines",
    log: str | None = "",
    title: str = "",
    order: Sequence[Any] = (),
) -> Panel:
    """What is reduced from the runs with the same value of a setting, against that value; none where it is infinite.

    A group has, for each value of the setting, a number for each run; ``reduce`` gives a value and the ends of its
    band, by default the mean and the range. Axes are named with their units; with ``log=None`` they are logarithmic
    where values span decades. Values that are no numbers have an ``order``, by default that of the groups.
    """
    values = order or [value for by_value in groups.values() for value in by_value]
    series, ticks = [], list(dict.fromkeys(map(format_setting, values)))
    for index, (name, by_value) in enumerate(groups.items()):
        if not by_value:  # the others keep their styles
            continue
        if kind == "lines":
            samples = {value: by_value[value] for value in sorted(by_value)}
        else:
            samples = {float(ticks.index(format_setting(value))): sample for value, sample in by_value.items()}
        found = np.array([reduce(sample) for sample in samples.values()]).T
        middle, low, high = np.where(np.isfinite(found), found, np.nan)
        spread = found[2] > found[1]
        band = (np.where(spread, low, middle), np.where(spread, high, middle)) if spread.any() else (None, None)
        series.append(
            Series(format_setting(name), list(samples), middle, band[0], band[1], nested(index, len(groups)))
        )
    return Panel(title, x, y, series, kind=kind, log=log, ticks=() if kind == "lines" else ticks)
