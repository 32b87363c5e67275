"""The report of several runs: their differences, how each ended, and their metrics."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cmacexp.metrics.text import format_setting
from cmacexp.report.comparison import format_runs, make_names
from cmacexp.report.page import HOW_TO_REPORT, Report
from cmacexp.report.parts import Folded, Section, Table
from cmacexp.report.run_summary import TABLES, RunSummary
from cmacexp.report.sweep_figures import draw_learning_curves, draw_over_key
from cmacexp.report.swept import Swept, find_swept

MOST_KEYS = 4
"""Swept keys that metrics are drawn over."""


def _list_stopped(runs: Sequence[RunSummary]) -> list[Any]:
    """Runs that stopped or are broken, each with its reason."""
    named = zip(make_names(runs), runs, strict=True)
    rows = [[name, run.status, run.cause] for name, run in named if run.status != "completed"]
    caption = "Runs that stopped early; those that failed or are not intact are in no figure"
    return [Table(["run", "status", "reason"], rows, caption)] if rows else []


def _list_differences(runs: Sequence[RunSummary], swept: Swept) -> list[Any]:
    rows = []
    for key in [*swept.keys, *swept.seeds]:
        values = list(dict.fromkeys(format_setting(run.config.get(key)) for run in runs if run.config))
        listed = ", ".join(values[:12]) + (f", ... ({len(values)} values)" if len(values) > 12 else "")
        rows.append([key, listed, *([", ".join(swept.linked.get(key, []))] if swept.linked else [])])
    if not rows:
        return ["These runs have the same config, apart from settings that do not change the results."]
    titles = ["key", "values", *(["keys that vary with it"] if swept.linked else [])]
    return [Table(titles, rows, "What differs between the runs")]


def _make_line_names(runs: Sequence[RunSummary], keys: Sequence[str]) -> list[str]:
    """Names of the runs in legends: the values of the swept keys, or else their folders."""
    named = [
        ", ".join(f"{key.rpartition('.')[2]} {format_setting(run.config.get(key))}" for key in keys) for run in runs
    ]
    return named if keys and len(keys) <= 3 and len(set(named)) == len(runs) else make_names(runs)


def make_sweep_report(runs: Sequence[RunSummary], title: str) -> Report:
    """The report of several runs.

    Args:
        runs: two or more.
        title: of the page.
    """
    swept = find_swept(runs)
    results = [run for run in runs if run.is_result]
    keys = [*swept.keys, *swept.seeds]
    names = _make_line_names(results, keys)
    curves = draw_learning_curves(results, names, keys or ["scenario"])
    over = [drawing for key in swept.keys[:MOST_KEYS] for drawing in draw_over_key(results, key, swept.keys)]
    final = Table(*format_runs(runs, keys), "Metrics of the last whole cycle, pooled over the legs")
    best = "Best values over all whole cycles: smallest error, largest share"
    folded = Folded(best, [Table(*format_runs(runs, keys, RunSummary.best))])
    place = os.path.commonpath([run.folder.resolve().parent for run in runs])
    pages = f"Runs are folders below {place}. {HOW_TO_REPORT}"
    sections = [Section("The runs", [*_list_differences(runs, swept), final, pages, *_list_stopped(runs), folded])]
    sections += [Section("Metrics over the swept keys", over)] if over else []
    sections += [Section("Learning curves", curves)] if curves else []
    ends = ", ".join(f"{count} {status}" for status, count in Counter(run.status for run in runs).items())
    summary = f"{len(runs)} runs: {ends}. What differs between them: {', '.join(keys) or 'nothing'}."
    inputs = [run.folder / name for run in results for name in TABLES if (run.folder / name).exists()]
    return Report(title, summary, sections, inputs, {"runs": [str(Path(run.folder).resolve()) for run in runs]})
