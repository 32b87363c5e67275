"""The report of several runs: the settings in which they differ, status, and metrics as a table and figures."""

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
"""Most lines of learning curves; more runs are grouped by a swept key, of which at most as many values are shown."""
MOST_VALUES = 12
"""Most values of a swept key in the table of differences."""


def _list_differences(runs: Sequence[Run], swept: Swept) -> list[PageElement]:
    """Tabulate the values of each key in which runs differ, and the keys that vary together with it."""

    def list_values(key: str) -> str:
        values = list(dict.fromkeys(format_setting(run.settings.get(key)) for run in runs if run.settings))
        more = f", ... ({len(values)} values)" if len(values) > MOST_VALUES else ""
        return ", ".join(values[:MOST_VALUES]) + more

    linked = {
        key: "; ".join(f"{name}: {list_values(name)}" for name in linked_keys)
        for key, linked_keys in swept.linked.items()
    }
    rows = [[key, list_values(key), linked.get(key, "")] for key in swept.all_keys]
    if rows:
        count = 3 if swept.linked else 2
        titles = ["key", "values", "keys that vary with it"][:count]
        return [Table(titles, [row[:count] for row in rows], "What differs between the runs")]
    same = "These runs have the same config, apart from settings that do not change the results."
    return [same] if len(runs) > 1 and all(run.settings for run in runs) else []


def _list_stopped(runs: Sequence[Run]) -> list[PageElement]:
    """Tabulate the runs that did not complete, with the reason; empty if all did."""
    rows = [
        [name, run.outcome.status, run.outcome.cause]
        for name, run in zip(make_names(runs), runs, strict=True)
        if not run.completed
    ]
    caption = "Runs that did not complete; figures show only those that fell or diverged"
    return [Table(["run", "status", "reason"], rows, caption)] if rows else []


def _group_by(runs: Sequence[Run], key: str) -> dict[Any, list[Run]]:
    """Group runs by the value of a config key; the groups are sorted if all values are numbers."""
    groups: dict[Any, list[Run]] = {}
    for run in runs:
        value = run.settings.get(key)
        groups.setdefault(format_setting(value) if isinstance(value, list) else value, []).append(run)
    return {value: groups[value] for value in sorted(groups)} if is_numeric(list(groups)) else groups


def _make_file_name(prefix: str, key: str) -> str:
    """Make the file name of a figure of a config key."""
    return f"{prefix}-{re.sub('[^A-Za-z0-9]+', '-', key).strip('-')}"


def _read_names(run: Run, keys: Sequence[str]) -> dict[str, str]:
    """Return the axis label of each config key: key and unit."""
    fields = describe_fields(run.config)
    return {key: f"{key}, {fields[key].unit}".rstrip(", ") if key in fields else key for key in keys}


def draw_learning_curves(runs: Sequence[Run], keys: Sequence[str]) -> list[Drawing]:
    """Draw the main metrics over the cycles, a line per run with a complete cycle; none if no run has two.

    More than MOST_LINES runs are grouped instead: one figure for each of the first two keys, a line per value.
    """
    begun = [run for run in runs if run.cycles_done]
    if max((run.cycles_done for run in begun), default=0) < 2:
        return []
    if len(begun) <= MOST_LINES:
        ends = ["" if run.completed else f", {run.outcome.status}" for run in runs]
        named_runs = zip(name_runs(runs, keys), ends, runs, strict=True)
        lines = {f"{name}{end}": [run] for name, end, run in named_runs if run.cycles_done}
        return [_draw_learning("learning", "one line for each run", lines, "")]
    drawings = []
    for key, title in _read_names(begun[0], keys[:2]).items():
        groups = list(_group_by(begun, key).items())
        chosen = dict(groups[round(index)] for index in np.linspace(0, len(groups) - 1, MOST_LINES))
        some = f"; {len(chosen)} of {len(groups)} values are shown" if len(chosen) < len(groups) else ""
        what = f"median and range of the runs with the same {key}{some}"
        drawings.append(_draw_learning(_make_file_name("learning", key), what, chosen, title))
    return drawings


def _draw_learning(file: str, what: str, groups: Mapping[Any, Sequence[Run]], title: str) -> Drawing:
    """Draw the main metrics over the cycles, a line per group of runs; keys of ``groups`` are names in the legend."""
    panels = []
    for name in JUDGED:
        histories = {
            value: [
                run.pooled[name] if name in run.pooled and shows(run, name) else np.full(run.cycles_done, np.nan)
                for run in group
            ]
            for value, group in groups.items()
        }
        if any(np.isfinite(history[-1]) for group in histories.values() for history in group):
            panels.append(replace(over_cycles(name, histories), title=f"{MAIN[name].title} ({name})"))
    return Drawing(file, draw(panels, legend_title=title), f"Metrics of each whole cycle: {what}.")


def _read_finals(runs: Sequence[Run], key: str, name: str) -> dict[Any, Array]:
    """Return the defined values of a metric in the last cycle, (runs,) in its display unit, by the value of a key."""
    finals = {value: np.array([run.final(name) for run in group]) for value, group in _group_by(runs, key).items()}
    defined = {value: MAIN[name].factor * sample[np.isfinite(sample)] for value, sample in finals.items()}
    return {value: sample for value, sample in defined.items() if sample.size}


def draw_over_key(runs: Sequence[Run], key: str, keys: Sequence[str]) -> list[Drawing]:
    """Draw the main metrics of the last cycle over a swept key.

    If exactly one other key of ``keys`` varies, with at most seven values, each of its values has a line.
    """
    completed = [run for run in runs if run.completed]
    values = list(_group_by(runs, key))
    other_keys = [other for other in keys if other != key]
    second = other_keys[0] if len(other_keys) == 1 and len(_group_by(completed, other_keys[0])) <= 7 else ""
    lines = _group_by(completed, second) if second else {"last cycle": completed}
    stopped: list[Any] = [run.settings.get(key) for run in runs if not run.completed]
    labels = _read_names(runs[0], keys)
    numeric = is_numeric(values)
    panels = []
    for name in JUDGED:
        finals = np.array([value for run in completed if np.isfinite(value := run.final(name))])
        varies = finals.size and np.ptp(finals) > 1e-9 * np.abs(finals).max()
        if not varies or not all(shows(run, name) for run in completed):
            continue
        groups = {line: _read_finals(group, key, name) for line, group in lines.items()}
        display = MAIN[name]
        panel = over_setting(
            groups,
            labels[key],
            f"{display.title}, {display.unit}",
            kind="lines" if numeric else "scatter",
            log=None,
            title=f"{display.title} ({name})",
            order=values,
        )
        crosses = stopped if numeric else [panel.ticks.index(format_setting(value)) for value in stopped]
        panels.append(replace(panel, from_zero=display.from_zero, crosses=crosses))
    if not panels:
        return []
    caption = f"Metrics of the last cycle over {key}" + (f", a line for each {second}" if second else "")
    rest = [other for other in other_keys if other != second]
    also = f"; {', '.join(rest)} also varies: values are means, bands are the range" if rest else ""
    figure = draw(panels, legend_title=labels.get(second, ""))
    return [Drawing(_make_file_name("over", key), figure, f"{caption}{also}.")]


def make_sweep_report(runs: Sequence[Run], title: str, resume: str = "") -> Report:
    """Make the report of several runs, or of one run without a trace.

    ``resume`` is the command that continues an unfinished sweep; empty if there is nothing to continue.
    """
    swept = find_swept(runs)
    keys = swept.all_keys
    results = [run for run in runs if run.outcome.is_result]
    final = Table(*format_runs(runs, keys), "Metrics of the last whole cycle, pooled over the legs")
    base = os.path.commonpath([run.folder.resolve().parent for run in runs])
    are_several = len(runs) > 1
    has_pages = are_several and any(run.folder.is_dir() for run in runs)
    pages = [f"Runs are folders below {base}. {HOW_TO_REPORT}"] if has_pages else []
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
    request = {"runs": [str(run.folder.resolve()) for run in runs]}
    return Report(title, summary, [Section(heading, parts) for heading, parts in sections.items() if parts], request)
