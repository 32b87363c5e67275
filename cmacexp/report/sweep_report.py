"""The report of several runs: in which settings they differ, how each ended, their metrics as a table and figures."""

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.config.describe import describe_fields
from cmacexp.data.run import Run
from cmacexp.metrics.registry import JUDGED, MAIN, format_runs, format_setting, make_names, shows
from cmacexp.metrics.swept import Swept, find_swept, name_runs
from cmacexp.report.figures import draw, is_numeric, over_cycles, over_setting
from cmacexp.report.page import HOW_TO_REPORT, Drawing, PageElement, Report, Section, Table
from cmacexp.typing import Array

MOST_LINES = 12
"""Lines of learning curves: more runs are grouped by a swept value, of which as many are shown, evenly spaced."""
MOST_VALUES = 12
"""Values of a swept key that the table of differences lists."""


def _list_differences(runs: Sequence[Run], swept: Swept) -> list[PageElement]:
    """The values of each key in which runs differ, and the keys that vary with it."""

    def list_values(key: str) -> str:
        values = list(dict.fromkeys(format_setting(run.settings.get(key)) for run in runs if run.settings))
        more = f", ... ({len(values)} values)" if len(values) > MOST_VALUES else ""
        return ", ".join(values[:MOST_VALUES]) + more

    linked = {
        key: "; ".join(f"{other}: {list_values(other)}" for other in others) for key, others in swept.linked.items()
    }
    rows = [[key, list_values(key), linked.get(key, "")] for key in swept.all_keys]
    if rows:
        count = 3 if swept.linked else 2
        titles = ["key", "values", "keys that vary with it"][:count]
        return [Table(titles, [row[:count] for row in rows], "What differs between the runs")]
    same = "These runs have the same config, apart from settings that do not change the results."
    return [same] if len(runs) > 1 and all(run.settings for run in runs) else []


def _list_stopped(runs: Sequence[Run]) -> list[PageElement]:
    """Runs that stopped or are broken, each with its reason."""
    rows = [
        [name, run.outcome.status, run.outcome.cause]
        for name, run in zip(make_names(runs), runs, strict=True)
        if not run.completed
    ]
    caption = "Runs that did not complete; figures show only those that fell or diverged"
    return [Table(["run", "status", "reason"], rows, caption)] if rows else []


def _group_by(runs: Sequence[Run], key: str) -> dict[Any, list[Run]]:
    """Runs by the value of a config key; numbers in their order."""
    groups: dict[Any, list[Run]] = {}
    for run in runs:
        value = run.settings.get(key)
        groups.setdefault(format_setting(value) if isinstance(value, list) else value, []).append(run)
    return {value: groups[value] for value in sorted(groups)} if is_numeric(list(groups)) else groups


def _make_file_name(prefix: str, key: str) -> str:
    """The name of a figure about a config key."""
    return f"{prefix}-{re.sub('[^A-Za-z0-9]+', '-', key).strip('-')}"


def _read_names(run: Run, keys: Sequence[str]) -> dict[str, str]:
    """Config keys as names of axes, with their units."""
    fields = describe_fields(run.config)
    return {key: f"{key}, {fields[key].unit}".rstrip(", ") if key in fields else key for key in keys}


def draw_learning_curves(runs: Sequence[Run], keys: Sequence[str]) -> list[Drawing]:
    """The main metrics per cycle, a line for each run that has a whole one; none if no run has two.

    Of many runs each of the first two swept keys has a figure with a line for each of its values.
    """
    begun = [run for run in runs if run.cycles_done]
    if max((run.cycles_done for run in begun), default=0) < 2:
        return []
    if len(begun) <= MOST_LINES:
        ends = ["" if run.completed else f", {run.outcome.status}" for run in runs]
        named = zip(name_runs(runs, keys), ends, runs, strict=True)
        lines = {f"{name}{end}": [run] for name, end, run in named if run.cycles_done}
        return [_draw_learning("learning", "one line for each run", lines, "")]
    drawings = []
    for key, title in _read_names(begun[0], keys[:2]).items():
        groups = list(_group_by(begun, key).items())
        chosen = dict(groups[round(place)] for place in np.linspace(0, len(groups) - 1, MOST_LINES))
        some = f"; {len(chosen)} of {len(groups)} values are shown" if len(chosen) < len(groups) else ""
        what = f"median and range of the runs with the same {key}{some}"
        drawings.append(_draw_learning(_make_file_name("learning", key), what, chosen, title))
    return drawings


def _draw_learning(file: str, what: str, groups: Mapping[Any, Sequence[Run]], title: str) -> Drawing:
    """The main metrics per cycle, a line for each group; its name is that of the legend's entry."""
    panels = []
    for name in JUDGED:
        histories = {
            value: [
                run.pooled[name] if name in run.pooled and shows(run, name) else np.full(run.cycles_done, np.nan)
                for run in group
            ]
            for value, group in groups.items()
        }
        if any(np.isfinite(own[-1]) for group in histories.values() for own in group):
            panels.append(replace(over_cycles(name, histories), title=f"{MAIN[name].title} ({name})"))
    return Drawing(file, draw(panels, legend_title=title), f"Metrics of each whole cycle: {what}.")


def _read_finals(runs: Sequence[Run], key: str, name: str) -> dict[Any, Array]:
    """Defined values of a metric in the last cycle, in the unit that is shown, by the value of a key."""
    finals = {value: np.array([run.final(name) for run in group]) for value, group in _group_by(runs, key).items()}
    known = {value: MAIN[name].factor * sample[np.isfinite(sample)] for value, sample in finals.items()}
    return {value: sample for value, sample in known.items() if sample.size}


def draw_over_key(runs: Sequence[Run], key: str, keys: Sequence[str]) -> list[Drawing]:
    """The main metrics of the last cycle over a swept key; with a second key a line for each of its values."""
    ended = [run for run in runs if run.completed]
    values = list(_group_by(runs, key))
    others = [other for other in keys if other != key]
    second = others[0] if len(others) == 1 and len(_group_by(ended, others[0])) <= 7 else ""
    lines = _group_by(ended, second) if second else {"last cycle": ended}
    stopped: list[Any] = [run.settings.get(key) for run in runs if not run.completed]
    panels, names, numeric = [], _read_names(runs[0], keys), is_numeric(values)
    for name in JUDGED:
        known = np.array([value for run in ended if np.isfinite(value := run.final(name))])
        varies = known.size and np.ptp(known) > 1e-9 * np.abs(known).max()
        if not varies or not all(shows(run, name) for run in ended):
            continue
        groups = {line: _read_finals(group, key, name) for line, group in lines.items()}
        shown, kind = MAIN[name], "lines" if numeric else "scatter"
        axes, title = (names[key], f"{shown.title}, {shown.unit}"), f"{shown.title} ({name})"
        panel = over_setting(groups, *axes, kind=kind, log=None, title=title, order=values)
        crosses = stopped if numeric else [panel.ticks.index(format_setting(value)) for value in stopped]
        panels.append(replace(panel, from_zero=shown.from_zero, crosses=crosses))
    if not panels:
        return []
    caption = f"Metrics of the last cycle over {key}" + (f", a line for each {second}" if second else "")
    rest = [other for other in others if other != second]
    also = f"; {', '.join(rest)} also varies: values are means, bands are the range" if rest else ""
    figure = draw(panels, legend_title=names.get(second, ""))
    return [Drawing(_make_file_name("over", key), figure, f"{caption}{also}.")]


def make_sweep_report(runs: Sequence[Run], title: str, resume: str = "") -> Report:
    """The report of several runs, or of one that keeps metrics alone.

    ``resume`` says how an unfinished sweep is continued.
    """
    swept, results = find_swept(runs), [run for run in runs if run.outcome.is_result]
    keys = swept.all_keys
    final = Table(*format_runs(runs, keys), "Metrics of the last whole cycle, pooled over the legs")
    place = os.path.commonpath([run.folder.resolve().parent for run in runs])
    are_several, have_folders = len(runs) > 1, any(run.folder.is_dir() for run in runs)
    pages = [f"Runs are folders below {place}. {HOW_TO_REPORT}"] if are_several and have_folders else []
    sections: dict[str, Sequence[PageElement]] = {
        "The runs": [*_list_differences(runs, swept), final, *pages, *_list_stopped(runs)],
        "Metrics over the swept keys": [
            drawing for key in swept.keys[:4] for drawing in draw_over_key(results, key, swept.keys)
        ],
        "Learning curves": draw_learning_curves(results, keys),
    }
    ends = ", ".join(f"{count} {status}" for status, count in Counter(run.outcome.status for run in runs).items())
    summary = f"{len(runs)} run{'s' * are_several}: {ends}."
    if keys or (are_several and all(run.settings for run in runs)):
        summary += f" What differs between them: {', '.join(keys) or 'nothing'}."
    summary += f" To continue: {resume}." if resume else ""
    asked_for = {"runs": [str(run.folder.resolve()) for run in runs]}
    return Report(title, summary, [Section(*each) for each in sections.items() if each[1]], asked_for)
