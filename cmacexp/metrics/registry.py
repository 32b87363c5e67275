"""All metrics, with the order of their columns, pooled over the legs, as tables and as text.

The single source for the terminal, reports, tables of sweeps, `optimize` and the documentation. A table has one row
per cycle, or one row per run: its settings, status and metrics. The final value of a metric is its median over the
last cycles of a run.
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
"""Pattern of a cell with a number or a range, with a unit or a remark, or with the mark of an undefined value."""


def format_number(value: float, unit: str = "", digits: int = DIGITS) -> str:
    """Format a number with its unit, with ``digits`` significant digits and an exponent only where needed.

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
    """Format a number for a column of a table: ``decimals`` decimals below 10, fewer above; a dash for NaN.

    >>> format_cell(0.12345), format_cell(123.45), format_cell(float("nan"))
    ('0.123', '123.5', '-')
    """
    if math.isnan(value):
        return "-"
    size = abs(value)
    return f"{value:.{decimals}f}" if size < 10 else f"{value:.1f}" if size < 1e5 else f"{value:.2e}"


def format_setting(value: Any) -> str:
    """Format a value of a config for display: floats with six digits, a class of this package by its name only.

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
    """Return the indices of the columns that contain only numbers; tables align them to the right."""
    columns = zip(*rows, strict=True)
    return frozenset(i for i, cells in enumerate(columns) if all(NUMBER.fullmatch(cell) for cell in cells))


OF_A_CYCLE: dict[str, Metric[Block]] = {**TRACKING, **FORCE, **TORQUE}
"""Metrics that are computed from the trace of a single cycle."""
LEG_METRICS: dict[str, Metric[Any]] = {**OF_A_CYCLE, **LEARNING, **MEMORY_METRICS}
"""Columns of ``metrics.parquet`` after ``cycle`` and ``leg``; for a robot those of SPATIAL follow."""
ALL_METRICS: dict[str, Metric[Any]] = {**TRACKING, **SPATIAL, **LEG_METRICS, **BODY_METRICS, **ESTIMATE_METRICS}
"""All metrics of legs and, from ``body_metrics.parquet``, of the body."""
SHOWN: dict[str, MetricDisplay] = {name: metric.shown for name, metric in ALL_METRICS.items() if metric.shown}
"""Appearance of metrics in tables and figures, by name."""
MAIN: dict[str, MetricDisplay] = {name: display for name, display in SHOWN.items() if display.main}
"""Columns of the tables of main metrics."""
JUDGED: dict[str, MetricDisplay] = {
    name: display for name, display in MAIN.items() if ALL_METRICS[name].better != NEITHER
}
"""Main metrics of which one direction is better."""
RANKED = [name for name in SHOWN if ALL_METRICS[name].better != NEITHER]
"""Metrics whose best value is a column of the table of a sweep."""


MOST_ROWS = 24
"""Rows of the longest table that is printed in full."""
END_ROWS = 6
"""Rows shown from each end of a longer table."""
MIDDLE_ROWS = 8
"""Rows shown between these, evenly spaced."""
Row = TypeVar("Row")


def count_legs(scores: Scores) -> int:
    """Return the number of legs in the metrics."""
    return Trace(scores.legs).legs


def pool_legs(scores: Scores) -> dict[str, Array]:
    """Pool every metric over the legs: (cycles,) by name, in SI units; NaN where it is undefined for all legs."""
    pooled = dict[str, Array]()
    for values in [Trace(table) for table in scores if table is not None]:
        names = [name for name in values.names if name in ALL_METRICS]
        pooled |= dict.fromkeys(names, np.empty(0))  # to keep their order
        for pooling in {ALL_METRICS[name].pooling for name in names}:  # one call for many metrics
            same_pooling = [name for name in names if ALL_METRICS[name].pooling is pooling]
            legs = np.stack([values[name] for name in same_pooling]).reshape(
                len(same_pooling), values.steps, max(values.legs, 1)
            )
            pooled |= zip(same_pooling, pooling.pool(legs), strict=True)
    return pooled


def is_shown(name: str, values: Container[str], legs: int) -> bool:
    """Check whether tables and figures show a metric for a run with ``legs`` legs and the metrics ``values``."""
    return (legs == 1 or SHOWN[name].over_legs) and SHOWN[name].instead not in values


def select_main(values: Mapping[str, Array], legs: int) -> dict[str, MetricDisplay]:
    """Select the main metrics that are defined in at least one cycle of a run with ``legs`` legs."""
    return {
        name: display
        for name, display in MAIN.items()
        if is_shown(name, values, legs) and not np.isnan(values.get(name, np.nan)).all()
    }


def shorten(rows: Sequence[Row]) -> list[Row]:
    """Select the rows of a table to print: all of a short one, else those at both ends and some between."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    gap = (len(rows) - 2 * END_ROWS + 1) / (MIDDLE_ROWS + 1)
    middle = [rows[round(END_ROWS - 1 + gap * (index + 1))] for index in range(MIDDLE_ROWS)]
    return [*rows[:END_ROWS], *middle, *rows[-END_ROWS:]]


def tabulate_cycles(scores: Scores) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """Tabulate the main metrics of a run, pooled over the legs, one row of text per cycle.

    Returns the metrics that are defined in at least one cycle, by name, and the rows: the number of the cycle, then
    the metrics.
    """
    pooled = pool_legs(scores)
    main = select_main(pooled, count_legs(scores))
    columns = [map(format_cell, pooled[name] * display.factor) for name, display in main.items()]
    cycles = range(1, len(next(iter(pooled.values()))) + 1)
    return main, [list(row) for row in zip(map(str, cycles), *columns, strict=True)]


def shows(run: Run, name: str) -> bool:
    """Check whether tables and figures show a main metric for a run."""
    return is_shown(name, run.pooled, run.legs)


def make_names(runs: Sequence[Run]) -> list[str]:
    """Make short names of runs: the paths of their folders relative to their common parent folder."""
    folders = [run.folder.resolve() for run in runs]
    base = os.path.commonpath([folder.parent for folder in folders])
    return [folder.relative_to(base).as_posix() for folder in folders]


def make_rows(runs: Sequence[Run], keys: Sequence[str]) -> list[dict[str, Any]]:
    """Make one flat row per run: the value of each key, the status, and the metrics.

    The status is in ``status``, ``cause`` and ``cycles_done`` (complete cycles). Metrics are in SI units under
    ``final_NAME`` (last complete cycle) and ``best_NAME`` (over all complete cycles), NaN where undefined.
    """
    absent = {
        name for name in SPATIAL if not any(name in run.pooled for run in runs)
    }  # metrics of robots, if there is no robot
    main, ranked = ([name for name in names if name not in absent] for names in (MAIN, RANKED))
    rows = []
    for run in runs:
        row = {key: run.settings.get(key) for key in keys}
        row |= {"status": run.outcome.status, "cause": run.outcome.cause, "cycles_done": run.cycles_done}
        row |= {f"final_{name}": run.final(name) for name in dict.fromkeys([*run.pooled, *main])}
        best = {name: ALL_METRICS[name].find_best(run.pooled.get(name, np.empty(0))) for name in ranked}
        rows.append(row | {f"best_{name}": value for name, value in best.items()})
    return rows


def tabulate_runs(runs: Sequence[Run], keys: Sequence[str]) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """Tabulate the main metrics of several runs, one row of text per run.

    Returns the metrics that are defined in at least one run, by name, and the rows: name, values of ``keys``, status,
    number of complete cycles, and the metrics of the last of these.
    """
    columns = {
        name: [display.factor * run.final(name) if shows(run, name) else math.nan for run in runs]
        for name, display in MAIN.items()
    }
    main = {name: display for name, display in MAIN.items() if not np.isnan(columns[name]).all()}
    rows = []
    for index, (name, run) in enumerate(zip(make_names(runs), runs, strict=True)):
        settings = [format_setting(run.settings.get(key)) for key in keys]
        cells = [format_cell(columns[metric][index]) for metric in main]
        rows.append([name, *settings, run.outcome.status, str(run.cycles_done), *cells])
    return main, rows


def format_runs(runs: Sequence[Run], keys: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Return the titles, with units after a line break, and the rows of :func:`tabulate_runs`."""
    main, rows = tabulate_runs(runs, keys)
    return [
        "run",
        *keys,
        "status",
        "cycles done",
        *(f"{display.title}\n{display.unit}" for display in main.values()),
    ], rows


FINAL_CYCLES = 10
"""Cycles at the end of a run over which the final value is the median, unless a study declares another number."""
TRANSFER = "transfer_rmse"
"""RMS position error of the feet in transfer over all axes: a column for robots, computed for other machines."""


def compute_final(values: Array, cycles: int = FINAL_CYCLES) -> float:
    """Compute the final value of a metric: its median over the last ``cycles``, or over all if there are fewer.

    Args:
        values: (complete cycles,), in the unit of the metric, of a completed run; a run that stopped has no final
            value.
        cycles: number of cycles at the end.
    """
    return float(np.median(values[-cycles:]))


def find_history(pooled: Mapping[str, Array], name: str) -> Array:
    """Return a metric in every complete cycle, (cycles,), pooled over the legs; empty if the run does not have it.

    Args:
        pooled: the metrics of a run, (cycles,) each, in SI units.
        name: name of the metric; ``TRANSFER`` is the root sum of squares over the axes where it is not a column.
    """
    if name == TRANSFER and name not in pooled:
        axes = [pooled[f"{name}_{axis}"] for axis in "xy" if f"{name}_{axis}" in pooled]
        return np.hypot(*axes) if axes else np.empty(0)
    return pooled.get(name, np.empty(0))
