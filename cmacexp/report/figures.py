"""The elements of all figures: panels of lines, points and bars, in one style.

Reports of runs, sweeps and studies take their panels of metrics over cycles, and over a setting, from here.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import require
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, SHOWN, format_setting
from cmacexp.report.style import (
    DESIRED,
    MARKERS,
    STYLE,
    WIDTH,
    add_legend,
    as_plain,
    include_zero,
    logarithmic,
    mark,
    nested,
    spans_decades,
)
from cmacexp.typing import Array, Axes, Figure

KINDS = ("lines", "scatter", "bars")
LOG_AXES = ("", "x", "y", "xy", None)
Reduce = Callable[[Array], tuple[float, float, float]]
"""Function of a sample (runs,) that returns its value, and the lower and upper end of its band."""
Values = Sequence[float] | NDArray[Any]
LIMIT: dict[str, Any] = {"color": "#555555", "linestyle": ":", "linewidth": 1.0, "zorder": 0}
SHADE: dict[str, Any] = {"color": "#F1F1F1", "linewidth": 0, "zorder": 0}
DESIRED_LINE: dict[str, Any] = {"color": DESIRED, "linestyle": "-", "linewidth": 2.6, "alpha": 0.6, "zorder": 1.9}
"""Style of desired values, drawn behind actual ones."""
STOPPED: dict[str, Any] = {"color": "#000000", "marker": "x", "linestyle": "none", "ms": 6, "clip_on": False}


@dataclass(frozen=True)
class Series:
    """Named values over x; the same name has the same colour in all panels that share a legend."""

    name: str
    x: Values
    y: Values
    low: Values | None = None
    """Lower end of a band or of error bars up to ``high``, e.g. of a confidence interval over seeds."""
    high: Values | None = None
    style: Mapping[str, Any] = field(default_factory=dict)
    """Matplotlib line properties that override those given by the order in the legend."""


@dataclass(frozen=True)
class Panel:
    """Axes with series.

    Raises:
        BadInput: ``kind`` or ``log`` is not one of the values below.
    """

    title: str
    x: str
    """Name and unit of the axis."""
    y: str
    series: Sequence[Series]
    kind: str = "lines"
    """``lines``; ``scatter``: only points; ``bars``: ``x`` is the index of a group, which ``ticks`` name."""
    log: str | None = ""
    """Logarithmic axes: ``x``, ``y`` or ``xy``; None: the axes whose values span decades."""
    ticks: Sequence[str] = ()
    """Names of the positions 0, 1, ... on the x axis."""
    x_limits: Sequence[float] = ()
    """Values of x with a vertical dotted line."""
    y_limits: Sequence[float] = ()
    """Values of y with a horizontal dotted line."""
    from_zero: bool = True
    """True if a linear y axis includes zero; else it spans at least a small fraction of the largest value."""
    x_range: tuple[float, float] | None = None
    """Limits of the x axis; None: from the values."""
    y_range: tuple[float, float] | None = None
    """Limits of the y axis; None: from the values and ``from_zero``."""
    shaded: Sequence[tuple[float, float]] = ()
    """Intervals of x with a grey background."""
    equal: bool = False
    """True if both axes have the same scale."""
    y_down: bool = False
    """True if the y axis points down."""
    crosses: Sequence[float] = ()
    """Values of x at which a run fell or diverged, marked by crosses on the x axis."""

    def __post_init__(self) -> None:
        for name, value, allowed in (("kind", self.kind, KINDS), ("log", self.log, LOG_AXES)):
            require(value in allowed, name, value, f"choose from {', '.join(map(repr, allowed))}")


def draw(
    panels: Sequence[Panel],
    columns: int = 2,
    height: float = 2.4,
    *,
    share: str = "",
    legend_title: str = "",
) -> Figure:
    """Draw panels in rows of ``columns``, each ``height`` inches high, with one legend below the figure.

    ``share`` names the axes that all panels share: ``x``, ``y``, ``xy`` or none.
    """
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(STYLE)
    columns = min(columns, len(panels)) or 1
    rows = -(-len(panels) // columns) or 1
    figure = Figure(figsize=(WIDTH, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex="x" in share, sharey="y" in share).ravel().tolist()
    for unused in axes[len(panels) :]:
        unused.remove()
    names = list(dict.fromkeys(series.name for panel in panels for series in panel.series))
    for ax, panel in zip(axes, panels, strict=False):
        draw_panel(ax, panel, names)
        ax.tick_params(labelbottom=True, labelleft=True)  # each panel can be read without its neighbours
        ax.set(title=as_plain(panel.title), xlabel=as_plain(panel.x), ylabel=as_plain(panel.y))
    add_legend(figure, axes[: len(panels)], legend_title)
    return figure


def _draw_series(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    for position, series in enumerate(panel.series):
        index = names.index(series.name)
        style = {**mark(index), "marker": MARKERS[index % len(MARKERS)], "label": series.name, **series.style}
        if panel.kind == "bars":
            _bars(axes, series, style, position, len(panel.series))
        elif panel.kind == "scatter":
            axes.plot(series.x, series.y, **{"ms": 4, **style, "linestyle": "none"})
            _error_bars(axes, np.asarray(series.x), series)
        else:
            _line(axes, series, style)


def draw_panel(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    """Draw a panel without its title and axis labels; ``names`` are those of all series of the figure."""
    from matplotlib.ticker import MaxNLocator

    _draw_series(axes, panel, names)
    if panel.crosses:
        axes.plot(
            panel.crosses,
            [0.0] * len(panel.crosses),
            transform=axes.get_xaxis_transform(),
            label="fell or diverged",
            **STOPPED,
        )
    for limit in panel.y_limits:
        axes.axhline(limit, **LIMIT)
    for limit in panel.x_limits:
        axes.axvline(limit, **LIMIT)
    for begin, end in panel.shaded:
        axes.axvspan(begin, end, **SHADE)
    for axis in "xy" if panel.series and panel.log != "" else "":
        values = np.concatenate(
            [np.asarray(series.x if axis == "x" else series.y, dtype=float) for series in panel.series]
        )
        if spans_decades(values) if panel.log is None else axis in panel.log:
            logarithmic(axes, axis, values)
    whole = all(np.issubdtype(np.asarray(series.x).dtype, np.integer) for series in panel.series)
    if whole and axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True))  # no tick between two cycles
    _set_ranges(axes, panel)
    if panel.ticks:
        turned: dict[str, Any] = {"rotation": 30, "ha": "right"} if sum(map(len, panel.ticks)) > 50 else {}
        axes.set_xticks(range(len(panel.ticks)), list(map(as_plain, panel.ticks)), **turned)


def _set_ranges(axes: Axes, panel: Panel) -> None:
    if panel.equal:
        shared = axes.get_shared_x_axes().get_siblings(axes)
        axes.set_aspect("equal", adjustable="box" if len(shared) > 1 else "datalim")
    elif panel.kind != "bars" and panel.y_range is None:
        include_zero(axes, [float(y) for series in panel.series for y in series.y], panel.from_zero)
    if panel.x_range is not None:
        axes.set_xlim(panel.x_range)
    if panel.y_range is not None:
        axes.set_ylim(panel.y_range)
    if panel.y_down and not axes.yaxis_inverted():
        axes.invert_yaxis()


def _line(axes: Axes, series: Series, style: dict[str, Any]) -> None:
    if len(series.x) > 30 and style["linestyle"] != "none":
        style["marker"] = None
    axes.plot(series.x, series.y, **{"ms": 3, **style})
    if series.low is not None and series.high is not None:
        band: dict[str, Any] = {"alpha": 0.15, "color": style["color"], "lw": 0}
        bitmap = len(series.x) > 1000  # SVG keeps all points of a band, but not those of a line
        axes.fill_between(series.x, series.low, series.high, rasterized=bitmap, **band)


def _bars(axes: Axes, series: Series, style: dict[str, Any], position: int, count: int) -> None:
    width = 0.8 / count
    x = np.asarray(series.x, dtype=float) + width * (position - (count - 1) / 2.0)
    axes.bar(x, series.y, width, **({"color": style["color"], "label": series.name} | dict(series.style)))
    _error_bars(axes, x, series)


def _error_bars(axes: Axes, x: Array, series: Series) -> None:
    if series.low is not None and series.high is not None:
        y = np.asarray(series.y, dtype=float)
        lengths = [y - np.asarray(series.low), np.asarray(series.high) - y]
        axes.errorbar(x, y, lengths, fmt="none", ecolor="#333333", elinewidth=0.8, capsize=2)


def is_numeric(values: Sequence[Any]) -> bool:
    """Check whether all values are numbers, and none is a bool."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def over_cycles(name: str, groups: Mapping[Any, Sequence[Array]], log: str | None = None, title: str = "") -> Panel:
    """Make a panel of a metric over the cycles: the median of each group of runs, with their range as a band.

    Args:
        name: name of the metric; one that tables do not show appears under this name and in its unit.
        groups: histories (cycles,) of the runs of each group, in SI units, by the value that these runs share.
        log: logarithmic axes, see :class:`Panel`.
        title: title of the panel; empty: that of the metric.
    """
    display = SHOWN.get(name) or MetricDisplay(name.replace("_", " "), ALL_METRICS[name].unit)
    title = title or display.title
    series = []
    for index, (value, histories) in enumerate(groups.items()):
        if not histories:  # no run completed a cycle; the other groups keep their styles
            continue
        length = max(map(len, histories))
        padded = (
            np.array([np.pad(h, (0, length - len(h)), constant_values=np.nan) for h in histories]) * display.factor
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a cycle in which no run defines the metric
            middle, low, high = np.nanmedian(padded, 0), np.nanmin(padded, 0), np.nanmax(padded, 0)
        series.append(
            Series(format_setting(value), np.arange(1, length + 1), middle, low, high, nested(index, len(groups)))
        )
    return Panel(
        title, "cycle", f"{title}, {display.unit}".rstrip(", "), series, log=log, from_zero=display.from_zero
    )


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
    """Make a panel of a result over a setting, reduced over the runs with the same value of the setting.

    Args:
        groups: for each line and each value of the setting, the results (runs,).
        x: label of the axis of the setting, with its unit.
        y: label of the axis of the result, with its unit.
        reduce: reduction of the results, by default to their mean and range; infinite values are not drawn.
        kind: see :class:`Panel`; only ``lines`` needs settings that are numbers.
        log: logarithmic axes, see :class:`Panel`.
        title: title of the panel.
        order: order of settings that are not numbers, by default that in ``groups``.
    """
    values = order or [value for by_value in groups.values() for value in by_value]
    ticks = list(dict.fromkeys(map(format_setting, values)))
    series = []
    for index, (name, by_value) in enumerate(groups.items()):
        if not by_value:  # the other groups keep their styles
            continue
        if kind == "lines":
            samples = {value: by_value[value] for value in sorted(by_value)}
        else:
            samples = {float(ticks.index(format_setting(value))): sample for value, sample in by_value.items()}
        reduced = np.array([reduce(sample) for sample in samples.values()]).T
        middle, low, high = np.where(np.isfinite(reduced), reduced, np.nan)
        spread = reduced[2] > reduced[1]
        band = (np.where(spread, low, middle), np.where(spread, high, middle)) if spread.any() else (None, None)
        series.append(
            Series(format_setting(name), list(samples), middle, band[0], band[1], nested(index, len(groups)))
        )
    return Panel(title, x, y, series, kind=kind, log=log, ticks=() if kind == "lines" else ticks)
