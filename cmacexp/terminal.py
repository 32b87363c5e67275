"""What a person sees in the terminal: a progress bar while a run lasts, a table when it ends."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from cmacexp.config import Config
from cmacexp.keep import RECORDING, Scores
from cmacexp.run import RunResult

Row = dict[str, Any]

MEAN, RMS, LARGEST = "mean", "rms", "largest"
COLUMNS = {
    "transfer_rmse_x": ("transfer x", "mm", 1e3, RMS),
    "transfer_rmse_y": ("transfer y", "mm", 1e3, RMS),
    "force_rmse": ("force rmse", "N", 1.0, RMS),
    "force_rmse_three_feet": ("three feet", "N", 1.0, RMS),
    "force_settled": ("settled force", "N", 1.0, MEAN),
    "force_steady_state_error": ("error", "%", 100.0, MEAN),
    "force_overshoot": ("overshoot", "%", 100.0, LARGEST),
    "force_settling_time": ("settling", "s", 1.0, LARGEST),
    "force_itae": ("ITAE", "N s²", 1.0, MEAN),
    "feedforward_share": ("feedforward", "%", 100.0, MEAN),
    "tilt_max": ("tilt", "mrad", 1e3, LARGEST),
    "height_mean": ("height", "mm", 1e3, MEAN),
    "margin_rear_min": ("rear margin", "mm", 1e3, MEAN),
}
"""Metrics of the table: title, unit, factor, and how those of several legs become one."""
ONE_LEG_ONLY = ("force_settled", "force_steady_state_error", "force_overshoot", "force_settling_time", "force_itae")
"""Metrics that mean little over several legs, which are to press differently."""
MOST_ROWS = 24
"""A longer table shows its first and last rows."""


@contextmanager
def progress(config: Config) -> Iterator[Callable[[int], None]]:
    """A progress bar over the cycles of a run, when a person watches; else nothing."""
    if not sys.stderr.isatty():
        yield lambda cycle: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("cycles"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(config.scenario, total=config.cycles)
        yield lambda cycle: bar.update(task, completed=cycle)


def _pool(values: list[float], how: str) -> float:
    """One number for several legs; NaN only if it is undefined for all of them."""
    values = [value for value in values if not math.isnan(value)]
    if not values:
        return math.nan
    if how == LARGEST:
        return max(values)
    if how == RMS:
        return math.sqrt(sum(value**2 for value in values) / len(values))
    return sum(values) / len(values)


def _rows(scores: Scores) -> list[Row]:
    """One row per cycle, the metrics of several legs pooled, with those of the body beside them."""
    by_cycle: dict[int, list[Row]] = {}
    for row in scores.legs.to_pylist():
        by_cycle.setdefault(row["cycle"], []).append(row)
    body = {row["cycle"]: row for row in scores.body.to_pylist()} if scores.body is not None else {}
    rows = []
    for cycle, legs in by_cycle.items():
        pooled: Row = {"cycle": cycle, **body.get(cycle, {})}
        for name, (_, _, _, how) in COLUMNS.items():
            if name in legs[0] and not (len(legs) > 1 and name in ONE_LEG_ONLY):
                pooled[name] = _pool([leg[name] for leg in legs], how)
        rows.append(pooled)
    return rows


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"


def scores_table(scores: Scores) -> None:
    """Print the metrics per cycle, pooled over the legs, without columns that are undefined throughout."""
    from rich.console import Console
    from rich.table import Table

    rows = _rows(scores)
    shown = {k: v for k, v in COLUMNS.items() if any(not math.isnan(row.get(k, math.nan)) for row in rows)}
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ["cycle", *(f"{title}\n{unit}" for title, unit, _, _ in shown.values())]:
        table.add_column(title, justify="right")
    skipped = len(rows) - MOST_ROWS
    for index, row in enumerate(rows):
        if skipped > 0 and MOST_ROWS // 2 <= index < MOST_ROWS // 2 + skipped:
            if index == MOST_ROWS // 2:
                table.add_row("...")
            continue
        table.add_row(str(row["cycle"]), *(_number(row[k] * factor) for k, (_, _, factor, _) in shown.items()))
    Console(highlight=False, width=None if sys.stdout.isatty() else 120).print(table)


def summary(result: RunResult) -> None:
    """Print what a run gave and where it is kept."""
    manifest = result.manifest
    if result.scores.legs.num_rows:
        scores_table(result.scores)
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    print(f"{result.status}{cause}: {steps} steps in {manifest['wall_seconds']:.2f} s{per_step}")
    if RECORDING in manifest["files"]:
        from cmacexp.recording import every_of

        if (every := every_of(steps)) > 1:
            print(f"{RECORDING}: one step in {every} of {steps}; python -m cmacexp.replay DIR --every 1 shows all")
    print(result.folder)
