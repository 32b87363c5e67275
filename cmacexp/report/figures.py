"""The vocabulary of all figures: panels of lines, points and bars, in one style.

Panels of metrics over the cycles and over a setting are made here for reports of runs, sweeps and studies.
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

KINDS, LOG = ("lines", "scatter", "bars"), ("", "x", "y", "xy", None)
Reduce = Callable[[Array], tuple[float, float, float]]
"""The value of a sample, and the ends of its band."""
Values = Sequence[float] | NDArray[Any]
LIMIT: dict[str, Any] = {"color": "#555555", "linestyle": ":", "linewidth": 1.0, "zorder": 0}
SHADE: dict[str, Any] = {"color": "#F1F1F1", "linewidth": 0, "zorder": 0}
DESIRED_LINE: dict[str, Any] = {"color": DESIRED, "linestyle": "-", "linewidth": 2.6, "alpha": 0.6, "zorder": 1.9}
"""Style of what should be, behind what is."""
STOPPED: dict[str, Any] = {"color": "#000000", "marker": "x", "linestyle": "none", "ms": 6, "clip_on": False}


@dataclass(frozen=True)
class Series:
    """Named values; the same name has the same colour in all panels that share a legend."""

    name: str
    x: Values
    y: Values
    low: Values | None = None
    """Lower end of a band or of error bars, to ``high``, e.g. of an interval over seeds."""
    high: Values | None = None
    style: Mapping[str, Any] = field(default_factory=dict)
    """Properties of lines of matplotlib that differ from those of the place in the legend."""


@dataclass(frozen=True)
class Panel:
    """Axes with series.

    Raises:
        BadInput: ``kind`` or ``log`` is none of those below.
    """

    title: str
    x: str
    """Name and unit of the axis."""
    y: str
    series: Sequence[Series]
    kind: str = "lines"
    """``lines``; ``scatter``: points alone; ``bars``: ``x`` counts groups from 0, which ``ticks`` name."""
    log: str | None = ""
    """Logarithmic axes: ``x``, ``y`` or ``xy``; None: those whose values span decades."""
    ticks: Sequence[str] = ()
    """Names of the positions 0, 1, ... on the x axis."""
    x_limits: Sequence[float] = ()
    """Vertical dotted lines."""
    y_limits: Sequence[float] = ()
    """Horizontal dotted lines."""
    from_zero: bool = True
    """Whether a linear y axis includes zero; else it spans at least a small part of the values."""
    x_range: tuple[float, float] | None = None
    """Ends of the x axis; None: of the values."""
    y_range: tuple[float, float] | None = None
    """Ends of the y axis; None: as ``from_zero`` says."""
    shaded: Sequence[tuple[float, float]] = ()
    """Spans of the x axis with a grey background."""
    equal: bool = False
    """Whether both axes have the same scale."""
    y_down: bool = False
    """Whether the y axis points down."""
    crosses: Sequence[float] = ()
    """Places on the x axis with a cross: there a run fell or diverged."""

    def __post_init__(self) -> None:
        for name, value, allowed in (("kind", self.kind, KINDS), ("log", self.log, LOG)):
            require(value in allowed, name, value, f"choose from {', '.join(map(repr, allowed))}")


def draw(
    panels: Sequence[Panel],
    columns: int = 2,
    height: float = 2.4,
    *,
    share: str = "",
    legend_title: str = "",
) -> Figure:
    """A figure of panels, in rows of so many ``columns``, each so many inches high.

    All share the axes ``x`` or ``xy`` of ``share``; the legend below the figure is that of all.
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
        ax.tick_params(labelbottom=True, labelleft=True)  # each panel can stand alone
        ax.set(title=as_plain(panel.title), xlabel=as_plain(panel.x), ylabel=as_plain(panel.y))
    add_legend(figure, axes[: len(panels)], legend_title)
    return figure


def draw_panel(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    """Draw a panel, but for its title and the names of its axes; ``names`` are those of all series of the figure."""
    from matplotlib.ticker import MaxNLocator

    for place, series in enumerate(panel.series):
        index = names.index(series.name)
        style = {**mark(index), "marker": MARKERS[index % len(MARKERS)], "label": series.name, **series.style}
        if panel.kind == "bars":
            _bars(axes, series, style, place, len(panel.series))
        elif panel.kind == "scatter":
            axes.plot(series.x, series.y, **{"ms": 4, **style, "linestyle": "none"})
            _error_bars(axes, np.asarray(series.x), series)
        else:
            _line(axes, series, style)
    if panel.crosses:
        heights = [0.0] * len(panel.crosses)
        axes.plot(panel.crosses, heights, transform=axes.get_xaxis_transform(), label="fell or diverged", **STOPPED)
    for limit in panel.y_limits:
        axes.axhline(limit, **LIMIT)
    for limit in panel.x_limits:
        axes.axvline(limit, **LIMIT)
    for begin, end in panel.shaded:
        axes.axvspan(begin, end, **SHADE)
    for axis in "xy" if panel.series and panel.log != "" else "":
        shown = np.concatenate([np.asarray(each.x if axis == "x" else each.y, dtype=float) for each in panel.series])
        if spans_decades(shown) if panel.log is None else axis in panel.log:
            logarithmic(axes, axis, shown)
    whole = all(np.issubdtype(np.asarray(series.x).dtype, np.integer) for series in panel.series)
    if whole and axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True))  # no tick between two cycles
    _set_ranges(axes, panel)
    if panel.ticks:
        characters = sum(map(len, panel.ticks))
        turned: dict[str, Any] = {"rotation": 30, "ha": "right"} if characters > 50 else {}
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
        bitmap = len(series.x) > 1000  # a band of so many points, unlike a line, is never simplified in SVG
        axes.fill_between(series.x, series.low, series.high, rasterized=bitmap, **band)


def _bars(axes: Axes, series: Series, style: dict[str, Any], place: int, count: int) -> None:
    width = 0.8 / count
    x = np.asarray(series.x, dtype=float) + width * (place - (count - 1) / 2.0)
    axes.bar(x, series.y, width, **({"color": style["color"], "label": series.name} | dict(series.style)))
    _error_bars(axes, x, series)


def _error_bars(axes: Axes, x: Array, series: Series) -> None:
    if series.low is not None and series.high is not None:
        y = np.asarray(series.y, dtype=float)
        reach = [y - np.asarray(series.low), np.asarray(series.high) - y]
        axes.errorbar(x, y, reach, fmt="none", ecolor="#333333", elinewidth=0.8, capsize=2)


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
        if not histories:  # no run reached the end of a cycle; the others keep their styles
            continue
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
