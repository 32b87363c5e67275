"""Many runs as one table: those of a sweep, from disk, or run in memory on all cores."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from cmacexp.data.discovery import runs_below
from cmacexp.data.run import Run, sort_folders
from cmacexp.engine.equal_results import Outcome, find_idle_keys, make_outcome
from cmacexp.engine.pool import start_workers
from cmacexp.engine.sweep_tables import (
    concat_metrics,
    join_runs,
    join_scores,
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
        ``body_metrics.parquet``, see ``docs/metrics.md``. A job without metrics has one row, which lacks them. Runs
        whose folders are not numbered, as jobs are, have the numbers 0, 1, ... in the order of their folders.

    Raises:
        BadRun: there is no run, or one is not intact.
    """
    root = Path(folder).resolve()
    if known := read_runs(root):
        runs, metrics = known
        index = np.searchsorted(runs["run"], metrics["run"])
        return join_runs(runs, metrics.drop_columns("run"), index).to_pandas()
    stored = [Run(path) for path in sort_folders(runs_below(root))]
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
        WithoutEffect: of each key without effect, see ``docs/sweeps.md``; runs with ``warn=false`` do not count.
    """
    if keep not in KEPT:
        raise BadInput("keep", keep, f"choose from {', '.join(KEPT)}")
    for overrides in runs:
        if isinstance(overrides, str):
            raise BadInput("runs", overrides, f"must be a list of lists of overrides: [[{overrides!r}]]")
    if not runs:
        raise BadInput("runs", list(runs), "must have at least one run")
    with start_workers(processes) as parallel_map:
        done = parallel_map("running", _run, [(list(overrides), keep, len(runs)) for overrides in runs])
    settings, (ends, tables, outcomes, others) = parse_overrides(runs), zip(*done, strict=True)
    for other in dict.fromkeys(filter(None, others)):
        warnings.warn(other, OtherModel, stacklevel=2)
    for kind, text in find_idle_keys(settings, outcomes, list(map(str, range(len(runs)))), "runs"):
        if kind == "warning":
            warnings.warn(text, WithoutEffect, stacklevel=2)
        else:
            print_line(f"{kind}: {text}", error=True)
    rows = [{"run": i, **values, "status": end} for i, (values, end) in enumerate(zip(settings, ends, strict=True))]
    return join_runs(make_table(rows), *concat_metrics(tables)).to_pandas()


def _run(overrides: list[str], keep: str, runs: int) -> tuple[str, pa.Table, Outcome | None, str]:
    """How one of so many runs ended, what is kept of it, what shows idle keys, and that its robot is another one."""
    from cmacexp.config.compose import compose_config
    from cmacexp.config.machine import describe_other_model
    from cmacexp.engine.run import score_scenario
    from cmacexp.jit.compiler import expect_runs
    from cmacexp.loop.scenario import make_scenario

    expect_runs(runs)
    traces = list[pa.Table]()
    config = compose_config(overrides)
    scenario = make_scenario(config)
    end, scorer = score_scenario(scenario, lambda new: traces.append(new.table) if keep == TRACE else None)
    outcome = make_outcome(config, end.status, end.steps, scorer.scores)
    table = pa.concat_tables(traces) if traces else join_scores(scorer.scores)
    return end.status, table, outcome, describe_other_model(config.machine)
