"""Figures over several runs: the main metrics over a swept key."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.metrics.registry import JUDGED, MAIN
from cmacexp.report.figure_data import legend_below, logarithmic, mark, spans_decades, widen
from cmacexp.report.learning_curves import STOPPED, is_numeric, make_file_name
from cmacexp.report.page import Drawing
from cmacexp.report.run_summary import RunSummary, format_value
from cmacexp.report.style import MARKERS, label, new_grid
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_TICKS = 6
"""Values of a key up to which each has a tick."""
CHARACTER = 0.025
"""Width of a character over that of an axis of half the width of a figure."""
MOST_FAMILY = 7
"""Values of a second key that have a line each."""


def _select_varying(runs: Sequence[RunSummary]) -> list[str]:
    """The main metrics whose final values differ between runs."""
    finals = {name: [run.final(name) for run in runs] for name in JUDGED if all(run.shows(name) for run in runs)}
    known = {name: np.array(values)[np.isfinite(values)] for name, values in finals.items()}
    return [name for name, values in known.items() if values.size and np.ptp(values) > 1e-9 * np.abs(values).max()]


def _positions(values: Sequence[Any]) -> tuple[list[float], list[str]]:
    """Positions of values on an axis, and the names of its ticks if they are not numbers."""
    if is_numeric(values):
        return [float(value) for value in values], []
    kinds = list(dict.fromkeys(map(format_value, values)))
    return [float(kinds.index(format_value(value))) for value in values], kinds


def _x_axis(axes: "Axes", key: str, places: Sequence[float], kinds: Sequence[str]) -> None:
    axes.set_xlabel(key)
    if kinds:
        turned: dict[str, Any] = {} if max(map(len, kinds)) * len(kinds) < 36 else {"rotation": 25, "ha": "right"}
        axes.set_xticks(range(len(kinds)), kinds, **turned)
        axes.set_xlim(-0.5, len(kinds) - 0.5)
        return
    ticks = sorted(set(places))
    if spans_decades(places):
        logarithmic(axes, "x", places)
    if len(ticks) <= MOST_TICKS:
        axes.set_xticks(ticks, name_ticks(np.log(ticks) if axes.get_xscale() == "log" else np.array(ticks), ticks))
        axes.minorticks_off()


def name_ticks(places: Array, values: Sequence[float]) -> list[str]:
    """Names of ticks, without those that would overlap; both ends have theirs.

    >>> name_ticks(np.array([1.0, 10.0, 19.0, 20.0]), [1.0, 10.0, 19.0, 20.0])
    ['1', '10', '', '20']
    """
    names, last = [f"{value:g}" for value in values], len(values) - 1
    width = CHARACTER * (np.ptp(places) or 1.0)
    kept: list[int] = []
    for i in [0, last, *range(1, last)]:
        if all(abs(places[i] - places[j]) > width * (2 + (len(names[i]) + len(names[j])) / 2) for j in kept):
            kept.append(i)
    return [name if i in kept else "" for i, name in enumerate(names)]


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


def _one_key(
    axes: "Axes", runs: Sequence[RunSummary], places: Sequence[float], name: str, joined: bool
) -> list[float]:
    """Final and best values of a metric; returns all drawn values."""
    factor = MAIN[name].factor
    final = [factor * run.final(name) for run in runs]
    best = [factor * run.best(name) for run in runs]
    if np.isfinite(best).any() and any(run.cycles > 1 for run in runs):
        style = mark(1) | {"marker": MARKERS[1], "ms": 8, "mfc": "white", "lw": 1.0}
        _family(axes, places, best, joined, label="best cycle", **style)
    _family(axes, places, final, joined, label="last cycle", marker=MARKERS[0], ms=4, **mark(0))
    return [*final, *best]


def _by_second(
    axes: "Axes", runs: Sequence[RunSummary], places: Sequence[float], name: str, second: str, joined: bool
) -> list[float]:
    """Final values of a metric, a line for each value of a second key; returns all drawn values."""
    final = [MAIN[name].factor * run.final(name) for run in runs]
    values: list[Any] = [run.config.get(second) for run in runs]
    kinds = sorted(set(values), key=float) if is_numeric(values) else list(dict.fromkeys(values))
    for index, kind in enumerate(kinds):
        own = [i for i, value in enumerate(values) if value == kind]
        aside = 0.0 if joined else 0.1 * (index - (len(kinds) - 1) / 2)
        style = mark(index) | {"marker": MARKERS[index], "ms": 5, "label": format_value(kind)}
        _family(axes, [places[i] + aside for i in own], [final[i] for i in own], joined, **style)
    return final


def draw_over_key(runs: Sequence[RunSummary], key: str, keys: Sequence[str]) -> list[Drawing]:
    """The main metrics over a swept key: final and best, or with a second key a line for each of its values.

    Args:
        runs: with results.
        key: the one on the axis.
        keys: all that were swept.
    """
    ended = [run for run in runs if run.status == "completed"]
    names = _select_varying(ended)
    if not names:
        return []
    places, kinds = _positions([run.config.get(key) for run in runs])
    at = dict(zip((run.folder for run in runs), places, strict=True))
    second = _find_second_key(ended, key, keys)
    own = [at[run.folder] for run in ended]
    figure, axes = new_grid(len(names), 2, 2.4)
    for ax, name in zip(axes, names, strict=True):
        drawn = (
            _by_second(ax, ended, own, name, second, not kinds)
            if second
            else _one_key(ax, ended, own, name, not kinds)
        )
        if spans_decades(drawn):
            logarithmic(ax, "y", drawn)
        shown = MAIN[name]
        widen(ax, drawn, shown.from_zero)
        label(ax, f"{shown.title} ({name})", "", f"{shown.title}, {shown.unit}")
        _x_axis(ax, key, places, kinds)
        _mark_stopped(ax, [at[run.folder] for run in runs if run.status != "completed"])
    legend_below(figure, axes[0], 7, second)
    caption = f"Metrics of the last cycle over {key}, a line for each {second}" if second else f"Metrics over {key}"
    others = [other for other in keys if other not in (key, second)]
    rest = f"; {', '.join(others)} also varies: lines join the means" if others else ""
    return [Drawing(f"over-{make_file_name(key)}", figure, f"{caption}{rest}.")]


def _find_second_key(runs: Sequence[RunSummary], key: str, keys: Sequence[str]) -> str:
    """The key whose values become lines, if exactly two were swept and it has few enough; else empty."""
    others = [other for other in keys if other != key]
    if len(others) != 1 or len({repr(run.config.get(others[0])) for run in runs}) > MOST_FAMILY:
        return ""
    return others[0]
