"""The report of several runs: what differs between them, how each ended, and what became of the metrics."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cmacexp.report.comparison import TABLES, Job, Swept, find_swept, names_of, table_of_jobs, text_of
from cmacexp.report.page import Report, Section, Table, Text
from cmacexp.report.side_by_side import side_by_side
from cmacexp.report.sweep_plots import learning_curves, over_key

MOST_KEYS = 4
"""Swept keys that metrics are drawn over."""


def _html_table(jobs: Sequence[Job], swept: Swept, prefix: str, caption: str) -> Table:
    titles, rows = table_of_jobs(jobs, [*swept.keys, *swept.repeats], prefix)
    return Table([title.replace("\n", ", ") for title in titles], rows, caption)


def _not_shown(jobs: Sequence[Job]) -> list[Any]:
    """Runs that stopped or are broken, each with its reason."""
    told = [job for job in jobs if job.status != "completed"]
    if not told:
        return []
    names = dict(zip((job.folder for job in jobs), names_of([job.folder for job in jobs]), strict=True))
    rows = [[names[job.folder], job.status, job.cause] for job in told]
    caption = "Runs that did not come to their end; those that failed or are not whole are in no figure"
    return [Table(["run", "status", "reason"], rows, caption, 3)]


def _what_differs(jobs: Sequence[Job], swept: Swept) -> list[Any]:
    rows = []
    for key in [*swept.keys, *swept.repeats]:
        values = list(dict.fromkeys(text_of(job.config.get(key)) for job in jobs if job.config))
        listed = ", ".join(values[:12]) + (f", ... ({len(values)} values)" if len(values) > 12 else "")
        rows.append([key, listed, ", ".join(swept.along.get(key, []))])
    if not rows:
        return [Text("The configs of these runs are the same: they differ in nothing that changes the results.")]
    return [Table(["key", "values", "differs together with it"], rows, "What differs between the runs", 3)]


def _line_names(jobs: Sequence[Job], keys: Sequence[str]) -> list[str]:
    """What legends call the runs: the values of what was swept, or else their folders."""
    named = [", ".join(f"{key.rpartition('.')[2]} {text_of(job.config.get(key))}" for key in keys) for job in jobs]
    return (
        named if keys and len(keys) <= 3 and len(set(named)) == len(jobs) else names_of([job.folder for job in jobs])
    )


def sweep_report(jobs: Sequence[Job], title: str) -> Report:
    """All that is worth seeing of several runs.

    Args:
        jobs: two or more.
        title: of the page.
    """
    swept = find_swept(jobs)
    results = [job for job in jobs if job.is_result]
    keys = [*swept.keys, *swept.repeats]
    names = _line_names(results, keys)
    curves = learning_curves(results, names, keys or ["scenario"])
    beside = side_by_side(results, names)
    over = [drawing for key in swept.keys[:MOST_KEYS] for drawing in over_key(results, key, swept.keys)]
    final = _html_table(jobs, swept, "final_", "Metrics of the last whole cycle, pooled over the legs")
    best = _html_table(jobs, swept, "best_", "Best value over all whole cycles: least error, largest share")
    sections = [Section("The runs", [*_what_differs(jobs, swept), final, best, *_not_shown(jobs)])]
    sections += [Section("Over what was swept", over)] if over else []
    sections += [Section("Learning curves", curves)] if curves else []
    sections += [Section("Side by side", beside)] if beside else []
    ended = {status: sum(job.status == status for job in jobs) for status in dict.fromkeys(j.status for j in jobs)}
    ends = ", ".join(f"{count} {status}" for status, count in ended.items())
    summary = f"{len(jobs)} runs: {ends}. What differs between them: {', '.join(keys) or 'nothing'}."
    inputs = [job.folder / name for job in results for name in TABLES if (job.folder / name).exists()]
    return Report(title, summary, sections, inputs, {"runs": [str(Path(job.folder).resolve()) for job in jobs]})
