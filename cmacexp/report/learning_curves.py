"""Figures over several runs: the main metrics over the cycles, a line for each run."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.metrics.registry import JUDGED, MAIN
from cmacexp.report.figure_data import legend_below, logarithmic, mark, spans_decades
from cmacexp.report.page import Drawing
from cmacexp.report.per_cycle import MOST_MARKED, scale
from cmacexp.report.run_summary import RunSummary, format_value
from cmacexp.report.style import DASHES, SERIES, label, new_grid
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINES = 12
"""Runs that have a name each in learning curves; more are coloured by the swept value."""
Style = dict[str, Any]
STOPPED: Style = {"color": "#000000", "marker": "x", "linestyle": "none", "ms": 6, "clip_on": False}


def is_numeric(values: Sequence[Any]) -> bool:
    """Whether values can stand on an axis of numbers."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _colours(runs: Sequence[RunSummary], key: str) -> tuple[list[Style], Any]:
    """A style for each of many runs by the value of a key, and the scale of its colour bar if it is numeric."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    values: list[Any] = [run.config.get(key) for run in runs]
    if is_numeric(values):
        norm = (LogNorm if spans_decades(values) else Normalize)(min(values), max(values))
        mappable = ScalarMappable(norm, matplotlib.colormaps["cividis"])
        return [{"color": mappable.to_rgba(value), "alpha": 0.8} for value in values], mappable
    kinds = list(dict.fromkeys(map(format_value, values)))
    return [mark(kinds.index(format_value(value))) for value in values], None


def _styles(runs: Sequence[RunSummary], keys: Sequence[str]) -> list[Style]:
    """A style for each of a few runs: with two swept keys dashes follow the first, colours the second."""
    texts = [[format_value(run.config.get(key)) for run in runs] for key in keys]
    kinds = [list(dict.fromkeys(values)) for values in texts]
    if len(keys) != 2 or max(map(len, kinds)) > len(SERIES):
        return [mark(index) for index in range(len(runs))]
    dashes, colours = ([kind.index(value) for value in values] for kind, values in zip(kinds, texts, strict=True))
    return [{"color": SERIES[c], "linestyle": DASHES[d]} for c, d in zip(colours, dashes, strict=True)]


def draw_learning_curves(runs: Sequence[RunSummary], names: Sequence[str], keys: Sequence[str]) -> list[Drawing]:
    """The main metrics per cycle, a line for each run that has a whole one; none if no run has two.

    Args:
        runs: with results.
        names: of the runs, for the legend.
        keys: that were swept.
    """
    begun = [index for index, run in enumerate(runs) if run.cycles]
    runs, names = [runs[i] for i in begun], [names[i] for i in begun]
    if not runs or max(run.cycles for run in runs) < 2:
        return []
    stopped = any(run.status != "completed" for run in runs)
    crosses = " A cross: the run fell or diverged in the next cycle." if stopped else ""
    caption = "Metrics of each whole cycle, one line for each run"
    if len(runs) <= MOST_LINES:
        figure = _learning_figure(runs, _styles(runs, keys), names)
        return [Drawing("learning", figure, f"{caption}.{crosses}")]
    drawings = []
    for key in keys[:2]:
        styles, mappable = _colours(runs, key)
        figure = _learning_figure(runs, styles, [format_value(run.config.get(key)) for run in runs], key, mappable)
        drawings.append(Drawing(f"learning-{make_file_name(key)}", figure, f"{caption}, coloured by {key}.{crosses}"))
    return drawings


def make_file_name(key: str) -> str:
    """A config key as part of the name of a file."""
    return key.replace(".", "-").replace("_", "-").strip("-")


def _learning_figure(
    runs: Sequence[RunSummary], styles: Sequence[Style], names: Sequence[str], title: str = "", mappable: Any = None
) -> "Figure":
    metrics = [name for name in JUDGED if any(run.shows(name) and np.isfinite(run.final(name)) for run in runs)]
    figure, axes = new_grid(len(metrics), 2, 2.4)
    for ax, name in zip(axes, metrics, strict=True):
        _curves(ax, runs, name, [{**style, "label": text} for style, text in zip(styles, names, strict=True)])
    if mappable is not None:
        bar = figure.colorbar(mappable, ax=axes, label=title, location="bottom", aspect=50, shrink=0.6)
        if bar.ax.get_xscale() == "log":
            logarithmic(bar.ax, "x", [mappable.norm.vmin, mappable.norm.vmax])
    else:
        legend_below(figure, axes[0], title=title)
    return figure


def _curves(axes: "Axes", runs: Sequence[RunSummary], name: str, styles: Sequence[Style]) -> None:
    shown = MAIN[name]
    drawn: list[Array] = []
    for run, style in zip(runs, styles, strict=True):
        undefined = np.full(run.cycles, np.nan)
        values = shown.factor * (run.metrics.get(name, undefined) if run.shows(name) else undefined)
        drawn.append(values)
        axes.plot(range(1, run.cycles + 1), values, marker="." if run.cycles <= MOST_MARKED else None, **style)
        if run.status != "completed":
            axes.plot([run.cycles], values[-1:], **STOPPED)
    scale(axes, max(run.cycles for run in runs), np.concatenate(drawn), shown.from_zero)
    label(axes, f"{shown.title} ({name})", "cycle", f"{shown.title}, {shown.unit}")
