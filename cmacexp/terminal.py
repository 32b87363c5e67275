"""What a person sees in the terminal: a progress bar while a run lasts, a table when it ends."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pyarrow as pa

from cmacexp.config import Config
from cmacexp.run import RunResult

COLUMNS = {
    "transfer_rmse_x": ("transfer x", "mm", 1e3),
    "transfer_rmse_y": ("transfer y", "mm", 1e3),
    "force_rmse": ("force rmse", "N", 1.0),
    "force_settled": ("settled force", "N", 1.0),
    "force_steady_state_error": ("error", "%", 100.0),
    "force_overshoot": ("overshoot", "%", 100.0),
    "force_settling_time": ("settling", "s", 1.0),
    "force_itae": ("ITAE", "N s²", 1.0),
    "feedforward_share": ("feedforward", "%", 100.0),
}
"""Metrics of the table: title, unit, factor."""
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


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"


def metrics_table(metrics: pa.Table) -> None:
    """Print the metrics per cycle (and leg, if several), without columns that are undefined throughout."""
    from rich.console import Console
    from rich.table import Table

    rows = metrics.to_pylist()
    several = any(row["leg"] > 1 for row in rows)
    shown = {k: v for k, v in COLUMNS.items() if any(not math.isnan(row[k]) for row in rows)}
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ["cycle", *(["leg"] if several else []), *(f"{t}\n{unit}" for t, unit, _ in shown.values())]:
        table.add_column(title, justify="right")
    skipped = len(rows) - MOST_ROWS
    for index, row in enumerate(rows):
        if skipped > 0 and MOST_ROWS // 2 <= index < MOST_ROWS // 2 + skipped:
            if index == MOST_ROWS // 2:
                table.add_row("...")
            continue
        cells = [str(row["cycle"]), *([str(row["leg"])] if several else [])]
        table.add_row(*cells, *(_number(row[k] * factor) for k, (_, _, factor) in shown.items()))
    Console(highlight=False, width=None if sys.stdout.isatty() else 120).print(table)


def summary(result: RunResult) -> None:
    """Print what a run gave and where it is kept."""
    manifest = result.manifest
    if result.metrics.num_rows:
        metrics_table(result.metrics)
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    print(f"{result.status}{cause}: {steps} steps in {manifest['wall_seconds']:.2f} s{per_step}")
    print(result.folder)
