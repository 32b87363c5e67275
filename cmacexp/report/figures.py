"""A small vocabulary of figures: panels of lines, points and bars, and heat maps, in one style."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput
from cmacexp.report.figure_data import logarithmic, mark, put_legend_below, widen
from cmacexp.report.style import MARKERS, label, new_grid
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_MARKED = 30
"""Points up to which a line has a marker at each."""
MOST_VECTOR = 1000
"""Points from which on a band is a bitmap in SVG: unlike a line, it is never simplified."""
MOST_LEVEL = 5
"""Names of ticks up to which they stand level."""
KINDS, LOG = ("lines", "scatter", "bars"), ("", "x", "y", "xy")
Values = Sequence[float] | Array | NDArray[np.integer]
LIMIT: dict[str, Any] = {"color": "#555555", "linestyle": ":", "linewidth": 1.0, "zorder": 0}


@dataclass(frozen=True)
class Series:
    """Named values; the same name has the same colour in all panels of a figure."""

    name: str
    x: Values
    y: Values
    low: Values | None = None
    """With ``high``: a band or error bars, e.g. an interval over seeds."""
    high: Values | None = None


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
    log: str = ""
    """Logarithmic axes: ``x``, ``y`` or ``xy``."""
    ticks: Sequence[str] = ()
    """Names of the positions 0, 1, ... on the x axis."""
    x_limits: Sequence[float] = ()
    """Vertical dotted lines."""
    y_limits: Sequence[float] = ()
    """Horizontal dotted lines."""
    from_zero: bool = True
    """Whether a linear y axis includes zero; else it spans at least a small part of the values."""

    def __post_init__(self) -> None:
        for name, value, allowed in (("kind", self.kind, KINDS), ("log", self.log, LOG)):
            if value not in allowed:
                raise BadInput(name, value, f"choose from {', '.join(map(repr, allowed))}")


@dataclass(frozen=True)
class HeatMap:
    """Axes with a value for every pair."""

    title: str
    x: str
    y: str
    columns: Sequence[str]
    rows: Sequence[str]
    values: Array
    """(rows, columns); NaN stays empty."""
    unit: str = ""
    log: bool = False
    marks: Sequence[tuple[int, int]] = field(default=())
    """Row and column of fields that are marked with a dot."""


def draw(panels: Sequence[Panel | HeatMap], columns: int = 2, height: float = 2.4) -> "Figure":
    """A figure of panels, with one legend below.

    Args:
        panels: in rows.
        columns: of panels.
        height: of a panel, inches.
    """
    figure, axes = new_grid(len(panels), min(columns, len(panels)), height)
    names = list(dict.fromkeys(s.name for panel in panels if isinstance(panel, Panel) for s in panel.series))
    for one, panel in zip(axes, panels, strict=True):
        if isinstance(panel, HeatMap):
            _heat_map(figure, one, panel)
        else:
            _panel(one, panel, names)
    put_legend_below(figure, {name: _legend_handle(panels, name, index) for index, name in enumerate(names)})
    return figure


def _legend_handle(panels: "Sequence[Panel | HeatMap]", name: str, index: int) -> Any:
    """What stands for a series in the legend: a patch, a point, or a line with a marker if one is drawn."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    drawn = [(panel.kind, s) for panel in panels if isinstance(panel, Panel) for s in panel.series if s.name == name]
    kinds, style = {kind for kind, _ in drawn}, _style(index)
    if kinds == {"bars"}:
        return Patch(color=style["color"])
    if kinds == {"scatter"}:
        style["linestyle"] = "none"
    elif all(len(series.x) > MOST_MARKED for _, series in drawn):
        style["marker"] = None
    return Line2D([], [], ms=4, **style)


def _style(index: int) -> dict[str, Any]:
    """Colour, dash and marker of the series with this place in the legend."""
    return {**mark(index), "marker": MARKERS[index % len(MARKERS)]}


def _panel(axes: "Axes", panel: Panel, names: Sequence[str]) -> None:
    from matplotlib.ticker import MaxNLocator

    for place, series in enumerate(panel.series):
        style = _style(names.index(series.name))
        if panel.kind == "bars":
            _bars(axes, series, style["color"], place, len(panel.series))
        elif panel.kind == "scatter":
            axes.plot(series.x, series.y, ms=4, **{**style, "linestyle": "none"})
            _error_bars(axes, np.asarray(series.x), series)
        else:
            _line(axes, series, style)
    for limit in panel.y_limits:
        axes.axhline(limit, **LIMIT)
    for limit in panel.x_limits:
        axes.axvline(limit, **LIMIT)
    for axis in panel.log:
        shown = [np.asarray(s.x if axis == "x" else s.y, dtype=float) for s in panel.series]
        logarithmic(axes, axis, np.concatenate(shown))
    if "x" not in panel.log and all(np.issubdtype(np.asarray(s.x).dtype, np.integer) for s in panel.series):
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True))  # no tick between two cycles
    if panel.kind != "bars":
        widen(axes, [float(y) for series in panel.series for y in series.y], panel.from_zero)
    if panel.ticks:
        turned: dict[str, Any] = {"rotation": 30, "ha": "right"} if len(panel.ticks) > MOST_LEVEL else {}
        axes.set_xticks(range(len(panel.ticks)), panel.ticks, **turned)
    label(axes, panel.title, panel.x, panel.y)


def _line(axes: "Axes", series: Series, style: dict[str, Any]) -> None:
    few = len(series.x) <= MOST_MARKED
    axes.plot(series.x, series.y, ms=3, **{**style, "marker": style["marker"] if few else None})
    if series.low is not None and series.high is not None:
        band: dict[str, Any] = {"alpha": 0.15, "color": style["color"], "lw": 0}
        axes.fill_between(series.x, series.low, series.high, rasterized=len(series.x) > MOST_VECTOR, **band)


def _bars(axes: "Axes", series: Series, colour: str, place: int, count: int) -> None:
    width = 0.8 / count
    x = np.asarray(series.x, dtype=float) + width * (place - (count - 1) / 2.0)
    axes.bar(x, series.y, width, color=colour)
    _error_bars(axes, x, series)


def _error_bars(axes: "Axes", x: Array, series: Series) -> None:
    if series.low is not None and series.high is not None:
        y = np.asarray(series.y, dtype=float)
        reach = [y - np.asarray(series.low), np.asarray(series.high) - y]
        axes.errorbar(x, y, reach, fmt="none", ecolor="#333333", elinewidth=0.8, capsize=2)


def _heat_map(figure: "Figure", axes: "Axes", panel: HeatMap) -> None:
    from matplotlib.colors import LogNorm, Normalize

    known = panel.values[np.isfinite(panel.values)]
    norm = (LogNorm if panel.log else Normalize)(known.min(), known.max()) if known.size else None
    image = axes.imshow(panel.values, cmap="cividis", norm=norm, aspect="auto", origin="lower")
    axes.set_xticks(range(len(panel.columns)), panel.columns)
    axes.set_yticks(range(len(panel.rows)), panel.rows)
    axes.grid(visible=False)
    if panel.marks:
        rows, columns = zip(*panel.marks, strict=True)
        axes.plot(columns, rows, "o", color="#FFFFFF", markeredgecolor="#000000", ms=5)
    bar = figure.colorbar(image, ax=axes, label=panel.unit)
    if panel.log and known.size:
        logarithmic(bar.ax, "y", known)
    label(axes, panel.title, panel.x, panel.y)
