"""Metrics of runs as tables: one value per cycle, several legs pooled as the registry says; or one row per run.

The rows of runs have settings, how each ended, and its metrics, for terminal, sweep, study and report.
"""

import math
import os
from collections.abc import Container, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from cmacexp.data.run import Run
from cmacexp.data.tables import Scores
from cmacexp.data.trace import Trace
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, MAIN, RANKED, SHOWN
from cmacexp.metrics.text import format_cell, format_setting
from cmacexp.typing import Array

MOST_ROWS = 24
"""A longer table shows its first and last ENDS rows, and BETWEEN of the others."""
ENDS, BETWEEN = 6, 8
Row = TypeVar("Row")


def count_legs(scores: Scores) -> int:
    """Number of legs that were scored."""
    return Trace(scores.legs).legs


def pool_legs(scores: Scores) -> dict[str, Array]:
    """Every metric of legs and body by name, one value per cycle, in SI units; NaN where no leg defines it."""
    pooled = dict[str, Array]()
    for values in [Trace(table) for table in scores if table is not None]:
        names = [name for name in values.names if name in ALL_METRICS]
        pooled |= dict.fromkeys(names, np.empty(0))  # so that they keep their order
        for pooling in {ALL_METRICS[name].pooling for name in names}:  # at once: else most of it is numpy's calls
            alike = [name for name in names if ALL_METRICS[name].pooling is pooling]
            legs = np.stack([values[name].reshape(values.steps, -1) for name in alike])
            pooled |= zip(alike, pooling.pool(legs), strict=True)
    return pooled


def is_shown(name: str, values: Container[str], legs: int) -> bool:
    """Whether tables and figures show a metric for a run that has these metrics, and so many legs."""
    return (legs == 1 or SHOWN[name].over_legs) and SHOWN[name].instead not in values


def select_main(values: Mapping[str, Array], legs: int) -> dict[str, MetricDisplay]:
    """The main metrics that at least one cycle defines, for a run of so many legs."""
    return {
        name: shown
        for name, shown in MAIN.items()
        if is_shown(name, values, legs) and not np.isnan(values.get(name, np.nan)).all()
    }


def shorten(rows: Sequence[Row]) -> list[Row]:
    """The rows of a table; of a long one the first, some between, evenly spaced, and the last."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    gap = (len(rows) - 2 * ENDS + 1) / (BETWEEN + 1)
    between = [rows[round(ENDS - 1 + gap * (index + 1))] for index in range(BETWEEN)]
    return [*rows[:ENDS], *between, *rows[-ENDS:]]


def tabulate_cycles(scores: Scores) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """The main metrics that at least one cycle defines, by name, and a row of text per cycle, its number first."""
    pooled = pool_legs(scores)
    main = select_main(pooled, count_legs(scores))
    columns = [map(format_cell, pooled[name] * shown.factor) for name, shown in main.items()]
    cycles = range(1, len(next(iter(pooled.values()))) + 1)
    return main, [list(row) for row in zip(map(str, cycles), *columns, strict=True)]


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
