"""Several runs as a table: one row for each with its swept settings, how it ended, and its main metrics."""

import math
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import in_one_line
from cmacexp.metrics.metric import Shown
from cmacexp.metrics.registry import MAIN, OF_A_ROBOT, RANKED
from cmacexp.metrics.summary import shorten
from cmacexp.metrics.text import format_cell, format_setting
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.terminal_tables import head, print_key, print_table

Row = dict[str, Any]


def make_names(runs: Sequence[RunSummary]) -> list[str]:
    """Short names of runs: the paths of their folders below the one that holds them all."""
    folders = [run.folder.resolve() for run in runs]
    base = os.path.commonpath([folder.parent for folder in folders])
    return [folder.relative_to(base).as_posix() for folder in folders]


def make_rows(runs: Sequence[RunSummary], keys: Sequence[str]) -> list[Row]:
    """One flat row per run: ``run``, the value of each key, how it ended, and its metrics.

    How it ended: ``status``, ``cause`` and ``cycles_done``, the whole ones. Metrics are in SI units under
    ``final_NAME`` (of the last whole cycle) and ``best_NAME`` (over all whole cycles), NaN where undefined.
    """
    rows, (main, ranked) = [], (_omit_robots(runs, names) for names in (MAIN, RANKED))
    for name, run in zip(make_names(runs), runs, strict=True):
        row: Row = {"run": name, **{key: run.config.get(key) for key in keys}}
        row |= {"status": run.status, "cause": run.cause, "cycles_done": run.cycles}
        final = dict.fromkeys([*run.metrics, *main])
        row |= {f"final_{metric}": run.final(metric) for metric in final}
        rows.append(row | {f"best_{metric}": run.best(metric) for metric in ranked})
    return rows


def _omit_robots(runs: Sequence[RunSummary], names: Iterable[str]) -> list[str]:
    """Names of metrics without those that robots alone have, if no run is one of a robot."""
    return [name for name in names if name not in OF_A_ROBOT or any(name in run.metrics for run in runs)]


Take = Callable[[RunSummary, str], float]


def tabulate_runs(
    runs: Sequence[RunSummary], keys: Sequence[str], take: Take = RunSummary.final
) -> tuple[dict[str, Shown], list[list[str]]]:
    """The main metrics that at least one run defines, by name, and one row of text for each run.

    A row has the run's name, the values of ``keys``, the status, the number of whole cycles, and the metrics.

    Args:
        runs: to compare.
        keys: in which they differ.
        take: gives a metric of a run: the final or the best one.
    """
    columns = {
        name: [shown.factor * take(run, name) if run.shows(name) else math.nan for run in runs]
        for name, shown in MAIN.items()
    }
    main = {name: shown for name, shown in MAIN.items() if not np.isnan(columns[name]).all()}
    rows = []
    for index, (name, run) in enumerate(zip(make_names(runs), runs, strict=True)):
        settings = [format_setting(run.config.get(key)) for key in keys]
        rows.append([name, *settings, run.status, str(run.cycles), *(format_cell(columns[m][index]) for m in main)])
    return main, rows


def format_runs(
    runs: Sequence[RunSummary], keys: Sequence[str], take: Take = RunSummary.final
) -> tuple[list[str], list[list[str]]]:
    """Titles, whose units follow a line break, and the rows of :func:`tabulate_runs`."""
    main, rows = tabulate_runs(runs, keys, take)
    return ["run", *keys, "status", "cycles done", *(f"{s.title}\n{s.unit}" for s in main.values())], rows


def print_runs(runs: Sequence[RunSummary], keys: Sequence[str], all_in: Path) -> None:
    """Print a table of runs and its key; of many runs some, and where all are."""
    main, rows = tabulate_runs(runs, keys)
    shown = shorten(rows)
    heads = [key.replace(".", ".\n") + "\n" for key in keys]
    print_table(["run\n", *heads, "status\n", "cycles\ndone\n", *map(head, main.values())], shown)
    if len(shown) < len(rows):
        print(in_one_line(f"{len(shown)} of {len(rows)} runs; all are in {all_in}"))
    if main:
        print("metrics are those of the last whole cycle")
        print_key(main, max(run.legs for run in runs))
        print()
