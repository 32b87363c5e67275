"""Many runs as one table: those of a sweep, from disk, or run in memory on all cores."""

import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.engine.chunk import RunEnd, run_chunk
from cmacexp.engine.equal_results import Outcome, find_idle_keys, hash_overrides
from cmacexp.engine.job_tables import find_runs
from cmacexp.engine.pool import choose_size, count_processes, start_workers
from cmacexp.engine.sweep_tables import (
    concat_metrics,
    join_runs,
    make_labels,
    make_table,
    parse_overrides,
    read_metrics,
    read_runs,
)
from cmacexp.errors import BadInput, OtherModel, WithoutEffect
from cmacexp.terminal.output import print_line

if TYPE_CHECKING:
    import pandas as pd

METRICS, TRACE = KEPT = ("metrics", "trace")


def load_sweep(folder: str | Path) -> "pd.DataFrame":
    """All metrics of all jobs of a sweep, or of all runs below a folder.

    Returns:
        A row for each job, cycle and leg: ``run``, the number of the job; ``folder``, its place below ``folder``; a
        column for each key that some job overrides; ``status``; the columns of ``metrics.parquet`` and of
        ``body_metrics.parquet``, see ``docs/files.md``. A job without metrics has one row, which lacks them. Runs
        whose folders are not numbered, as jobs are, have the numbers 0, 1, ... in the order of their folders.

    Raises:
        BadRun: there is no run, or one is not intact.
    """
    root = Path(folder).resolve()
    if known := read_runs(root):
        runs, metrics = known
        index = np.searchsorted(runs["run"], metrics["run"])
        return join_runs(runs, metrics.drop_columns("run"), index).to_pandas()
    stored = find_runs(root)
    metrics, index = concat_metrics([read_metrics(run) for run in stored])
    settings = parse_overrides([run.manifest.get("overrides", []) for run in stored])
    labels = make_labels([run.folder.relative_to(root).as_posix() for run in stored])
    rows = [a | b | {"status": run.status} for a, b, run in zip(labels, settings, stored, strict=True)]
    return join_runs(make_table(rows), metrics, index).to_pandas()


def run_many(runs: Sequence[Sequence[str]], keep: str = METRICS, processes: int | None = None) -> "pd.DataFrame":
    """Run many configs in memory, in processes on all cores, compiled where that pays off for all of them together.

    Args:
        runs: overrides of each run, as :func:`run` takes them.
        keep: ``metrics``, a row for each run, cycle and leg, or ``trace``, a row for each run, step and leg.
        processes: how many; None: one for each core that this process may use.

    Returns:
        A table: ``run``, its number; a column for each key that some run overrides; ``status``; the columns of
        ``metrics.parquet`` and ``body_metrics.parquet``, or of ``trace.parquet``.

    Raises:
        CmacexpError: one of them cannot be run; nothing is returned then.

    Warns:
        OtherModel: of each robot whose model is not the one that results were measured with.
        WithoutEffect: of each key without effect, see ``docs/runs.md``; runs with ``warn=false`` do not count.
    """
    if keep not in KEPT:
        raise BadInput("keep", keep, f"choose from {', '.join(KEPT)}")
    for overrides in runs:
        if isinstance(overrides, str):
            raise BadInput("runs", overrides, f"must be a list of lists of overrides: [[{overrides!r}]]")
    if not runs:
        raise BadInput("runs", list(runs), "must have at least one run")
    count = count_processes(processes)
    size = choose_size(len(runs), count)
    listed = [list(overrides) for overrides in runs]
    chunks = [(listed[at : at + size], keep == TRACE, len(runs)) for at in range(0, len(runs), size)]
    with start_workers(count) as parallel_map:
        done = parallel_map("running", run_chunk, chunks)
    ends: list[RunEnd] = [end for chunk, _ in done for end in chunk]
    for other in dict.fromkeys(filter(None, (end.other_model for end in ends))):
        warnings.warn(other, OtherModel, stacklevel=2)
    settings = parse_overrides(runs)
    outcomes = [
        Outcome(partial(hash_overrides, overrides), end.result) if end.result else None
        for overrides, end in zip(listed, ends, strict=True)
    ]
    for kind, text in find_idle_keys(settings, outcomes, list(map(str, range(len(runs)))), "runs"):
        if kind == "warning":
            warnings.warn(text, WithoutEffect, stacklevel=2)
        else:
            print_line(f"{kind}: {text}", error=True)
    rows = [{"run": i, **own, "status": end.status} for i, (own, end) in enumerate(zip(settings, ends, strict=True))]
    table, _ = concat_metrics([table for _, table in done])
    return join_runs(make_table(rows), table, np.repeat(np.arange(len(runs)), [end.rows for end in ends])).to_pandas()
