"""All metrics as they are shown: the order of their columns, pooled over legs, as tables, and as text.

Terminal, reports, sweep tables, `optimize` and docs read this alone. A table has one value per cycle, or one row per
run: its settings, how it ended, and its metrics. The error at the end of a run is the median over its last cycles.
"""

import math
import os
import re
from collections.abc import Container, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from cmacexp.config.component import is_shipped
from cmacexp.data.run import Run
from cmacexp.data.tables import Scores
from cmacexp.data.trace import Trace
from cmacexp.metrics.block import Block
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.metrics.drift import LEARNING, MEMORY_METRICS
from cmacexp.metrics.leg import FORCE, SPATIAL, TORQUE, TRACKING
from cmacexp.metrics.metric import NEITHER, Metric, MetricDisplay
from cmacexp.typing import Array

DIGITS = 3
NUMBER = re.compile(r"([-+]?(\d[\d.]*(e[-+]?\d+|-\d+)?|infinite)( .*)?|-|undefined)?")
"""A cell that is a number or a range, with its unit or a remark, or says that there is none."""


def format_number(value: float, unit: str = "", digits: int = DIGITS) -> str:
    """A number with so many significant digits, without exponents where they can be avoided, and its unit.

    >>> format_number(0.123456), format_number(12345.6, "N"), format_number(-5e-7), format_number(float("nan"))
    ('0.123', '12300 N', '-5e-07', 'undefined')
    >>> format_number(3), format_number(float("inf"))
    ('3', 'infinite')
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    short = f"{value:.{digits}g}"
    if isinstance(value, int):
        text = str(value)
    elif "e" in short and 1.0 <= abs(value) < 1e6:
        text = f"{float(short):.0f}"
    else:
        text = short
    return f"{text} {unit}".rstrip()


def format_cell(value: float, decimals: int = 3) -> str:
    """A number in a column of a table, with so many decimals if it is small; a dash where it is undefined.

    >>> format_cell(0.12345), format_cell(123.45), format_cell(float("nan"))
    ('0.123', '123.5', '-')
    """
    if math.isnan(value):
        return "-"
    size = abs(value)
    return f"{value:.{decimals}f}" if size < 10 else f"{value:.1f}" if size < 1e5 else f"{value:.2e}"


def format_setting(value: Any) -> str:
    """A value of a config as it is typed on the command line: short numbers, a shipped class by its name.

    >>> [format_setting(value) for value in (None, True, 1 / 3, [1, 2], "cmacexp.plants.analytic.Analytic")]
    ['null', 'true', '0.333333', '[1, 2]', 'Analytic']
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    text = f"[{', '.join(map(format_setting, value))}]" if isinstance(value, list) else str(value)
    return text.rpartition(".")[2] if is_shipped(text) else text


def find_numeric(rows: Sequence[Sequence[str]]) -> frozenset[int]:
    """The columns of a table that hold numbers only, which are aligned to the right."""
    columns = zip(*rows, strict=True)
    return frozenset(i for i, cells in enumerate(columns) if all(NUMBER.fullmatch(cell) for cell in cells))


OF_A_CYCLE: dict[str, Metric[Block]] = {**TRACKING, **FORCE, **TORQUE}
"""Those that follow from the trace of one cycle."""
LEG_METRICS: dict[str, Metric[Any]] = {**OF_A_CYCLE, **LEARNING, **MEMORY_METRICS}
"""Columns of ``metrics.parquet`` after ``cycle`` and ``leg``; of a robot those of SPATIAL follow."""
ALL_METRICS: dict[str, Metric[Any]] = {**TRACKING, **SPATIAL, **LEG_METRICS, **BODY_METRICS, **ESTIMATE_METRICS}
"""All of these, and those of ``body_metrics.parquet``."""
SHOWN: dict[str, MetricDisplay] = {name: metric.shown for name, metric in ALL_METRICS.items() if metric.shown}
"""How metrics appear in tables and figures."""
MAIN: dict[str, MetricDisplay] = {name: shown for name, shown in SHOWN.items() if shown.main}
"""The columns of tables of main metrics."""
JUDGED: dict[str, MetricDisplay] = {
    name: shown for name, shown in MAIN.items() if ALL_METRICS[name].better != NEITHER
}
"""The main metrics of which one direction is better."""
RANKED = [name for name in SHOWN if ALL_METRICS[name].better != NEITHER]
"""Metrics of which the table of a sweep has the best value."""


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
            legs = np.stack([values[name] for name in alike]).reshape(len(alike), values.steps, max(values.legs, 1))
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


FINAL_CYCLES = 10
"""Cycles at the end of a run whose median is its final value, unless a study declares another number."""
TRANSFER = "transfer_rmse"
"""Distance of the feet from their path in transfer, over all axes: a column of robots, computed of other machines."""


def compute_final(values: Array, cycles: int = FINAL_CYCLES) -> float:
    """The final value of a metric: its median over the last ``cycles``, or over all if there are fewer.

    Args:
        values: (whole cycles,), in the metric's unit; of a run that completed, since a run that ended early has none.
        cycles: number of cycles at the end.
    """
    return float(np.median(values[-cycles:]))


def find_history(pooled: Mapping[str, Array], name: str) -> Array:
    """A metric in every whole cycle, (cycles,), legs pooled; empty if the run does not have it.

    Args:
        pooled: the metrics of a run, (cycles,) each, in SI units.
        name: of the metric; ``TRANSFER`` is the root of the sum of squares of the axes where it is no column.
    """
    if name == TRANSFER and name not in pooled:
        axes = [pooled[f"{name}_{axis}"] for axis in "xy" if f"{name}_{axis}" in pooled]
        return np.hypot(*axes) if axes else np.empty(0)
    return pooled.get(name, np.empty(0))
