"""Drawings over several runs: learning curves, and the main metrics over what was swept."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.metrics.summary import COLUMNS
from cmacexp.report.comparison import Job, text_of
from cmacexp.report.figure_data import legend_below, logarithmic, mark, spans_decades
from cmacexp.report.page import Drawing
from cmacexp.report.per_cycle import MOST_MARKED, scale
from cmacexp.report.style import DASHES, MARKERS, SERIES, label, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINES = 12
"""Runs that have a name each in learning curves; more are coloured by what was swept."""
MOST_FAMILY = 7
"""Values of a second key that have a line each."""
MOST_PANELS = 6
PANELS = {
    "transfer_rmse_x": "error along x in transfer, RMS",
    "transfer_rmse_y": "error along y in transfer, RMS",
    "force_rmse": "force error in support, RMS",
    "force_rmse_three_feet": "force error on three feet, RMS",
    "force_steady_state_error": "steady-state force error",
    "force_overshoot": "overshoot of the force",
    "feedforward_share": "share of the feedforward",
    "tilt_max": "largest tilt of the body",
    "force_settling_time": "settling time of the force",
    "force_itae": "ITAE of the force",
}
"""Metrics that are drawn, the first :data:`MOST_PANELS` of those that runs have."""
STOPPED: dict[str, Any] = {"color": "#000000", "marker": "x", "linestyle": "none", "ms": 6, "clip_on": False}


def is_numeric(values: Sequence[Any]) -> bool:
    """Whether values can stand on an axis of numbers."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _varying(jobs: Sequence[Job], names: Sequence[str]) -> list[str]:
    """The metrics that differ between runs."""
    finals = {name: [job.final(name) for job in jobs] for name in names}
    known = {name: np.array(values)[np.isfinite(values)] for name, values in finals.items()}
    return [name for name, values in known.items() if values.size and np.ptp(values) > 1e-9 * np.abs(values).max()]


def _colours(jobs: Sequence[Job], key: str) -> tuple[list[dict[str, Any]], Any]:
    """A style for each of many runs by the value of a key, and what to make a colour bar or legend of."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    values: list[Any] = [job.config.get(key) for job in jobs]
    if is_numeric(values):
        norm = (LogNorm if spans_decades(values) else Normalize)(min(values), max(values))
        mappable = ScalarMappable(norm, matplotlib.colormaps["cividis"])
        return [{"color": mappable.to_rgba(value), "alpha": 0.8} for value in values], mappable
    kinds = list(dict.fromkeys(map(text_of, values)))
    return [mark(kinds.index(text_of(value))) for value in values], None


def _styles(jobs: Sequence[Job], keys: Sequence[str]) -> list[dict[str, Any]]:
    """A style for each of a few runs: with two swept keys colours tell the second, dashes the first."""
    texts = [[text_of(job.config.get(key)) for job in jobs] for key in keys]
    kinds = [list(dict.fromkeys(values)) for values in texts]
    if len(keys) != 2 or max(map(len, kinds)) > len(SERIES):
        return [mark(index) for index in range(len(jobs))]
    dashes, colours = ([kind.index(value) for value in values] for kind, values in zip(kinds, texts, strict=True))
    return [{"color": SERIES[c], "linestyle": DASHES[d]} for c, d in zip(colours, dashes, strict=True)]


def learning_curves(jobs: Sequence[Job], names: Sequence[str], keys: Sequence[str]) -> list[Drawing]:
    """The main metrics per cycle, a line for each run that has a whole one; none if no run has two.

    Args:
        jobs: results.
        names: of the jobs, as the legend says them.
        keys: what was swept.
    """
    begun = [index for index, job in enumerate(jobs) if job.cycles]
    jobs, names = [jobs[i] for i in begun], [names[i] for i in begun]
    if not jobs or max(len(job.cycles) for job in jobs) < 2:
        return []
    if len(jobs) <= MOST_LINES:
        figure = _learning_figure(jobs, _styles(jobs, keys), names)
        return [
            Drawing("learning", figure, f"Metrics of each whole cycle, one line for each run.{_about_crosses(jobs)}")
        ]
    drawings = []
    for key in keys[:2]:
        styles, mappable = _colours(jobs, key)
        figure = _learning_figure(jobs, styles, [text_of(job.config.get(key)) for job in jobs], key, mappable)
        caption = f"Metrics of each whole cycle, one line for each run, coloured by {key}.{_about_crosses(jobs)}"
        drawings.append(Drawing(f"learning-{file_name(key)}", figure, caption))
    return drawings


def file_name(key: str) -> str:
    """A config key as part of the name of a file."""
    return key.replace(".", "-").replace("_", "-").strip("-")


def _about_crosses(jobs: Sequence[Job]) -> str:
    stopped = any(job.status != "completed" for job in jobs)
    return " A cross: the run fell or diverged in the cycle after." if stopped else ""


def _learning_figure(
    jobs: Sequence[Job], styles: Sequence[dict[str, Any]], said: Sequence[str], title: str = "", mappable: Any = None
) -> "Figure":
    shown = [name for name in PANELS if any(np.isfinite(job.final(name)) for job in jobs)][:MOST_PANELS]
    figure, axes = new_figure(-(-len(shown) // 2), 2, 2.4)
    for ax, name in zip(axes, shown, strict=False):
        _curves(ax, jobs, name, styles, said, max(len(job.cycles) for job in jobs))
    for ax in axes[len(shown) :]:
        ax.remove()
    if mappable is not None:
        figure.colorbar(mappable, ax=axes[: len(shown)], label=title, location="bottom", aspect=50, shrink=0.6)
    else:
        legend_below(figure, axes[0], title=title)
    return figure


def _curves(
    axes: "Axes", jobs: Sequence[Job], name: str, styles: Sequence[dict[str, Any]], said: Sequence[str], last: int
) -> None:
    how = COLUMNS[name]
    everything: list[float] = []
    for job, style, who in zip(jobs, styles, said, strict=True):
        values = [how.factor * row.get(name, np.nan) for row in job.cycles]
        cycles = [row["cycle"] for row in job.cycles]
        everything += values
        axes.plot(cycles, values, label=who, marker="." if len(cycles) <= MOST_MARKED else None, **style)
        if job.status != "completed" and values:
            axes.plot(cycles[-1:], values[-1:], **STOPPED)
    scale(axes, last, np.array(everything))
    label(axes, PANELS[name], "cycle", how.unit)


def _positions(values: Sequence[Any]) -> tuple[list[float], list[str]]:
    """Where values stand on an axis, and the names of its ticks if they are no numbers."""
    if is_numeric(values):
        return [float(value) for value in values], []
    kinds = list(dict.fromkeys(map(text_of, values)))
    return [float(kinds.index(text_of(value))) for value in values], kinds


def _x_axis(axes: "Axes", key: str, places: Sequence[float], kinds: Sequence[str]) -> None:
    axes.set_xlabel(key)
    if kinds:
        axes.set_xticks(range(len(kinds)), kinds, rotation=0 if max(map(len, kinds)) * len(kinds) < 36 else 25)
        axes.set_xlim(-0.5, len(kinds) - 0.5)
        return
    ticks = sorted(set(places))
    if spans_decades(places):
        logarithmic(axes, "x", places)
    if len(ticks) <= 6:
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()


def _mean_line(places: Sequence[float], values: Sequence[float]) -> tuple[list[float], list[float]]:
    """Mean of the values at each place, in order."""
    at: dict[float, list[float]] = {}
    for place, value in zip(places, values, strict=True):
        if np.isfinite(value):
            at.setdefault(place, []).append(value)
    return sorted(at), [float(np.mean(at[place])) for place in sorted(at)]


def _family(axes: "Axes", places: Sequence[float], values: Sequence[float], joined: bool, **style: Any) -> None:
    """Dots for all runs and, if ``joined``, a line through their means."""
    x, y = _mean_line(places, values)
    axes.plot(x, y, **style if joined else style | {"linestyle": "none"})
    if len(x) < len(places):
        axes.plot(places, values, marker=style["marker"], ms=3, color=style["color"], alpha=0.5, linestyle="none")


def _mark_stopped(axes: "Axes", places: Sequence[float]) -> None:
    if places:
        axes.plot(
            places, [0.0] * len(places), transform=axes.get_xaxis_transform(), label="fell or diverged", **STOPPED
        )


def _one_key(axes: "Axes", jobs: Sequence[Job], places: Sequence[float], name: str, joined: bool) -> list[float]:
    """Final and best values of a metric; all that was drawn."""
    factor = COLUMNS[name].factor
    final = [factor * job.final(name) for job in jobs]
    best = [factor * job.best(name) for job in jobs]
    if np.isfinite(best).any() and any(len(job.cycles) > 1 for job in jobs):
        style = mark(1) | {"marker": MARKERS[1], "ms": 8, "mfc": "white", "lw": 1.0}
        _family(axes, places, best, joined, label="best cycle", **style)
    _family(axes, places, final, joined, label="last cycle", marker=MARKERS[0], ms=4, **mark(0))
    return [*final, *best]


def _by_second(
    axes: "Axes", jobs: Sequence[Job], places: Sequence[float], name: str, second: str, joined: bool
) -> list[float]:
    """Final values of a metric, a line for each value of a second key; all that was drawn."""
    final = [COLUMNS[name].factor * job.final(name) for job in jobs]
    values: list[Any] = [job.config.get(second) for job in jobs]
    kinds = sorted(set(values), key=float) if is_numeric(values) else list(dict.fromkeys(values))
    for index, kind in enumerate(kinds):
        own = [i for i, value in enumerate(values) if value == kind]
        aside = 0.0 if joined else 0.1 * (index - (len(kinds) - 1) / 2)
        style = mark(index) | {"marker": MARKERS[index], "ms": 5, "label": text_of(kind)}
        _family(axes, [places[i] + aside for i in own], [final[i] for i in own], joined, **style)
    return final


def over_key(jobs: Sequence[Job], key: str, keys: Sequence[str]) -> list[Drawing]:
    """The main metrics over a swept key: final and best, or with a second key a line for each of its values.

    Args:
        jobs: results.
        key: the one along the axis.
        keys: all that was swept.
    """
    ended = [job for job in jobs if job.status == "completed"]
    names = _varying(ended, list(PANELS))[:MOST_PANELS]
    if not names:
        return []
    places, kinds = _positions([job.config.get(key) for job in jobs])
    at = dict(zip((job.folder for job in jobs), places, strict=True))
    second = _second_key(ended, key, keys)
    figure, axes = new_figure(-(-len(names) // 2), 2, 2.4)
    for ax, name in zip(axes, names, strict=False):
        own = [at[job.folder] for job in ended]
        drawn = (
            _by_second(ax, ended, own, name, second, not kinds)
            if second
            else _one_key(ax, ended, own, name, not kinds)
        )
        if spans_decades(drawn):
            logarithmic(ax, "y", drawn)
        label(ax, PANELS[name], "", COLUMNS[name].unit)
        _x_axis(ax, key, places, kinds)
        _mark_stopped(ax, [at[job.folder] for job in jobs if job.status != "completed"])
    for ax in axes[len(names) :]:
        ax.remove()
    legend_below(figure, axes[0], 7, second)
    what = f"Metrics of the last cycle over {key}, a line for each {second}" if second else f"Metrics over {key}"
    others = [other for other in keys if other not in (key, second)]
    rest = f"; {', '.join(others)} varies as well: lines join the means" if others else ""
    return [Drawing(f"over-{file_name(key)}", figure, f"{what}{rest}.")]


def _second_key(jobs: Sequence[Job], key: str, keys: Sequence[str]) -> str:
    """The key whose values become lines, if exactly two were swept and it has few enough; else empty."""
    others = [other for other in keys if other != key]
    if len(others) != 1 or len({repr(job.config.get(others[0])) for job in jobs}) > MOST_FAMILY:
        return ""
    return others[0]
