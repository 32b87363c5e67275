"""Runs as rows of one table: settings, how each ended, and its metrics, for terminal, sweep, study and report."""

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.pooling import is_shown
from cmacexp.metrics.registry import ALL_METRICS, MAIN, RANKED
from cmacexp.metrics.text import format_cell, format_setting


def shows(run: Run, name: str) -> bool:
    """Whether tables and figures show one of the main metrics for this run."""
    return is_shown(name, run.pooled, run.legs)


def make_names(runs: Sequence[Run]) -> list[str]:
    """Short names of runs: the paths of their folders below the one that holds them all."""
    folders = [run.folder.resolve() for run in runs]
    base = os.path.commonpath([folder.parent for folder in folders])
    return [folder.relative_to(base).as_posix() for folder in folders]


def make_rows(runs: Sequence[Run], keys: Sequence[str]) -> list[dict[str, Any]]:
    """One flat row per run: the value of each key, how it ended, and its metrics.

    How it ended: ``status``, ``cause`` and ``cycles_done``, the whole ones. Metrics are in SI units under
    ``final_NAME`` (of the last whole cycle) and ``best_NAME`` (over all whole cycles), NaN where undefined.
    """
    own = {name for name in SPATIAL if not any(name in run.pooled for run in runs)}  # of robots, and none is one
    rows, (main, ranked) = [], ([name for name in names if name not in own] for names in (MAIN, RANKED))
    for run in runs:
        row = {key: run.settings.get(key) for key in keys}
        row |= {"status": run.outcome.status, "cause": run.outcome.cause, "cycles_done": run.cycles_done}
        row |= {f"final_{name}": run.final(name) for name in dict.fromkeys([*run.pooled, *main])}
        best = {name: ALL_METRICS[name].find_best(run.pooled.get(name, np.empty(0))) for name in ranked}
        rows.append(row | {f"best_{name}": value for name, value in best.items()})
    return rows


def tabulate_runs(runs: Sequence[Run], keys: Sequence[str]) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """The main metrics that at least one run defines, by name, and one row of text for each run.

    A row has the run's name, the values of ``keys``, the status, the number of whole cycles, and the metrics of the
    last of them.
    """
    columns = {
        name: [shown.factor * run.final(name) if shows(run, name) else math.nan for run in runs]
        for name, shown in MAIN.items()
    }
    main = {name: shown for name, shown in MAIN.items() if not np.isnan(columns[name]).all()}
    rows = []
    for index, (name, run) in enumerate(zip(make_names(runs), runs, strict=True)):
        settings = [format_setting(run.settings.get(key)) for key in keys]
        cells = [format_cell(columns[metric][index]) for metric in main]
        rows.append([name, *settings, run.outcome.status, str(run.cycles_done), *cells])
    return main, rows


def format_runs(runs: Sequence[Run], keys: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Titles, whose units follow a line break, and the rows of :func:`tabulate_runs`."""
    main, rows = tabulate_runs(runs, keys)
    return ["run", *keys, "status", "cycles done", *(f"{s.title}\n{s.unit}" for s in main.values())], rows
