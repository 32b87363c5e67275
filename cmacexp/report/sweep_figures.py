"""Figures of several runs: metrics over the cycles and over the swept keys."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.config.describe import describe_fields
from cmacexp.data.run import Run
from cmacexp.metrics.registry import JUDGED, MAIN
from cmacexp.metrics.run_table import shows
from cmacexp.metrics.text import format_setting
from cmacexp.report.captions import describe_change, describe_effect
from cmacexp.report.curves import is_numeric, over_cycles, over_setting
from cmacexp.report.figures import draw
from cmacexp.report.page_elements import Drawing
from cmacexp.report.style import DASHES, MARKERS, SERIES
from cmacexp.typing import Array

MOST_LINES = 12
"""Lines of learning curves: more runs are grouped by a swept value, of which as many are shown, evenly spaced."""


def make_file_name(key: str) -> str:
    """A config key as part of the name of a file."""
    return key.replace(".", "-").replace("_", "-").strip("-")


def group_by(runs: Sequence[Run], key: str) -> dict[Any, list[Run]]:
    """Runs by the value of a config key; numbers in their order."""
    groups: dict[Any, list[Run]] = {}
    for run in runs:
        value = run.settings.get(key)
        groups.setdefault(format_setting(value) if isinstance(value, list) else value, []).append(run)
    return {value: groups[value] for value in sorted(groups)} if is_numeric(list(groups)) else groups


def read_names(run: Run, keys: Sequence[str]) -> dict[str, str]:
    """Config keys as names of axes, with their units."""
    fields = describe_fields(run.config)
    return {key: f"{key}, {fields[key].unit}".rstrip(", ") if key in fields else key for key in keys}


def draw_learning_curves(runs: Sequence[Run], names: Sequence[str], keys: Sequence[str]) -> list[Drawing]:
    """The main metrics per cycle, a line for each run that has a whole one; none if no run has two.

    Of many runs each of the first two swept keys has a figure with a line for each of its values.
    """
    ends = ["" if run.completed else f", {run.outcome.status}" for run in runs]
    begun = {name + end: [run] for name, end, run in zip(names, ends, runs, strict=True) if run.cycles_done}
    shown = [run for (run,) in begun.values()]
    if max((run.cycles_done for run in shown), default=0) < 2:
        return []
    if len(shown) > MOST_LINES:
        return [_draw_grouped(shown, key) for key in keys[:2]]
    styles = _style_lines(begun, keys) if len(keys) == 2 else {}
    return [_draw_learning("learning", "one line for each run", begun, "", styles)]


def _style_lines(named: Mapping[str, Sequence[Run]], keys: Sequence[str]) -> dict[Any, dict[str, Any]]:
    """Of two swept keys the first has a colour for each value, the second a dash and a mark."""
    places = [list(group_by([run for (run,) in named.values()], key)) for key in keys]
    styles = {}
    for name, (run,) in named.items():
        colour, dash = (values.index(run.settings.get(key)) % 7 for values, key in zip(places, keys, strict=True))
        styles[name] = {"color": SERIES[colour], "linestyle": DASHES[dash], "marker": MARKERS[dash]}
    return styles


def _draw_grouped(runs: Sequence[Run], key: str) -> Drawing:
    groups = group_by(runs, key)
    values = list(groups)
    chosen = sorted({round(place) for place in np.linspace(0, len(values) - 1, MOST_LINES)})
    some = f"; {len(chosen)} of {len(values)} values are shown" if len(chosen) < len(values) else ""
    lines = {values[index]: groups[values[index]] for index in chosen}
    what = f"median and range of the runs with the same {key}{some}"
    return _draw_learning(f"learning-{make_file_name(key)}", what, lines, read_names(runs[0], [key])[key], {})


def _draw_learning(
    file: str, what: str, groups: Mapping[Any, Sequence[Run]], title: str, styles: Mapping[Any, dict[str, Any]]
) -> Drawing:
    runs = [run for group in groups.values() for run in group]
    panels, ends = [], {}
    for name in JUDGED:
        if not any(shows(run, name) and np.isfinite(run.final(name)) for run in runs):
            continue
        histories = {value: [_history(run, name) for run in group] for value, group in groups.items()}
        panel = over_cycles(name, histories)
        series = [replace(line, style={**line.style, **styles.get(line.name, {})}) for line in panel.series]
        panels.append(replace(panel, series=series, title=f"{MAIN[name].title} ({name})"))
        both = np.array([own[[0, -1]] for group in histories.values() for own in group]).T
        ends[name] = np.array([np.median(known) for own in both if (known := own[np.isfinite(own)]).size])
    caption = f"Metrics of each whole cycle: {what}.{describe_change(ends)}"
    return Drawing(file, draw(panels, legend_title=title), f"{caption} Numbers are medians of the runs.")


def _history(run: Run, name: str) -> Array:
    undefined = np.full(run.cycles_done, np.nan)
    return run.pooled.get(name, undefined) if shows(run, name) else undefined


def draw_over_key(runs: Sequence[Run], key: str, keys: Sequence[str]) -> list[Drawing]:
    """The main metrics of the last cycle over a swept key; with a second key a line for each of its values."""
    ended = [run for run in runs if run.completed]
    values = list(group_by(runs, key))
    others = [other for other in keys if other != key]
    second = others[0] if len(others) == 1 and len(group_by(ended, others[0])) <= 7 else ""
    lines = group_by(ended, second) if second else {"last cycle": ended}
    stopped: list[Any] = [run.settings.get(key) for run in runs if not run.completed]
    panels, changed, names = [], {}, read_names(runs[0], keys)
    for name in JUDGED:
        known = np.array([value for run in ended if np.isfinite(value := run.final(name))])
        if (
            not all(shows(run, name) for run in ended)
            or not known.size
            or np.ptp(known) <= 1e-9 * np.abs(known).max()
        ):
            continue
        groups = {line: _over(group, key, name) for line, group in lines.items()}
        shown, numeric = MAIN[name], is_numeric(values)
        changed[name] = list(_over(ended, key, name).values())
        kind, title = "lines" if numeric else "scatter", f"{shown.title} ({name})"
        panel = over_setting(
            groups, names[key], f"{shown.title}, {shown.unit}", kind=kind, log=None, title=title, order=values
        )
        if numeric and "x" not in panel.log:  # the same for all, also where few values have a metric
            margin = 0.05 * (values[-1] - values[0] or 1.0)
            panel = replace(panel, x_range=(values[0] - margin, values[-1] + margin))
        crosses = stopped if numeric else [panel.ticks.index(format_setting(value)) for value in stopped]
        panels.append(replace(panel, from_zero=shown.from_zero, crosses=crosses))
    if not panels:
        return []
    caption = f"Metrics of the last cycle over {key}" + (f", a line for each {second}" if second else "")
    rest = [other for other in others if other != second]
    also = f"; {', '.join(rest)} also varies: values are means, bands are the range" if rest else ""
    figure = draw(panels, legend_title=names.get(second, ""))
    return [Drawing(f"over-{make_file_name(key)}", figure, f"{caption}{also}.{describe_effect(changed)}")]


def _over(runs: Sequence[Run], key: str, name: str) -> dict[Any, Array]:
    """Defined values of a metric in the unit that is shown, by the value of a key."""
    samples = {
        value: np.array([MAIN[name].factor * run.final(name) for run in group])
        for value, group in group_by(runs, key).items()
    }
    known = {value: sample[np.isfinite(sample)] for value, sample in samples.items()}
    return {value: sample for value, sample in known.items() if sample.size}
