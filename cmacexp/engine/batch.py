"""Many runs as one table: in memory, or in one file of any size; on all cores, or on an executor of the user."""

import json
import math
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence, Sized
from concurrent.futures import Executor
from contextlib import nullcontext
from functools import partial
from itertools import chain, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from omegaconf import DictConfig

from cmacexp.config.compose import compose_config, compose_untyped, list_texts, refuse_options
from cmacexp.config.machine import describe_other_model
from cmacexp.data.files import write_atomically
from cmacexp.data.manifest import JOBS_FOLDER
from cmacexp.data.tables import as_array, table_writer
from cmacexp.data.trace import concat_traces
from cmacexp.engine.driver import Item, map_runs
from cmacexp.engine.job_store import JobTables, concat_jobs, iterate_jobs, read_part, write_part
from cmacexp.engine.run import score_run
from cmacexp.engine.sweep_tables import (
    Names,
    Settings,
    concat_metrics,
    join_runs,
    join_scores,
    make_column,
    read_settings,
)
from cmacexp.engine.without_effect import IdleKeys, IdleReport
from cmacexp.engine.workers import MOST_RUNS, choose_size, count_processes, start_workers
from cmacexp.errors import OtherModel, WithoutEffect, require, require_name
from cmacexp.jit.compiler import expect_runs
from cmacexp.loop import run_cycles
from cmacexp.loop.scenario import make_scenario
from cmacexp.planning import Recall

if TYPE_CHECKING:
    import pandas as pd

METRICS, TRACE = KEPT = ("metrics", "trace")
AT_ONCE = {METRICS: 1 << 10, TRACE: 1 << 5}
"""Runs that are in memory at a time while their table is written, by what is kept."""
MOST_WORKERS = 16
"""Workers that an executor of the user is taken to have, for the number of runs that one takes at a time."""
NAME = "0" * 8
"""What the parts of a table are called by."""


def run_many(
    runs: Iterable[Sequence[str]],
    keep: str = METRICS,
    processes: int | None = None,
    executor: Executor | None = None,
) -> "pd.DataFrame":
    """Run many configs in memory, in processes on all cores, compiled where that pays off for all of them together.

    Args:
        runs: overrides of each run, as :func:`run` takes them.
        keep: ``metrics``, a row for each run, cycle and leg, or ``trace``, a row for each run, step and leg.
        processes: how many; None: one for each core that this process may use; 1: this process.
        executor: of the user, such as a ``ThreadPoolExecutor`` or that of a Dask client, in place of processes.

    Returns:
        A table: ``run``, its number; a column for each key that some run overrides; ``status``; the columns of
        ``metrics.parquet`` and ``body_metrics.parquet``, or of ``trace.parquet``.

    Raises:
        CmacexpError: one of them cannot be run; nothing is returned then.

    Warns:
        OtherModel: of each robot whose model is not the one that results were measured with.
        WithoutEffect: of each key without effect in all runs that set it; none of runs with ``warn=false``.
    """
    summary = _Summary()
    parts = list[tuple[int, JobTables]]()
    for chunk_tables in _run_chunks(_list_runs(runs), keep, processes, executor, 0):
        parts.append((summary.add(chunk_tables), chunk_tables))
    parts.sort(key=lambda numbered: numbered[0])
    table = summary.join(concat_jobs(chunk_tables for _, chunk_tables in parts))
    _warn(summary)
    return table.to_pandas()


def write_many(
    file: str | Path,
    runs: Iterable[Sequence[str]],
    keep: str = METRICS,
    processes: int | None = None,
    executor: Executor | None = None,
    first: int = 0,
) -> None:
    """Write the table of :func:`run_many` to one Parquet file, in memory that does not grow with the number of runs.

    Args, errors and warnings are the same; a column that a run lacks is null. ``runs`` may be a generator, whose
    runs are checked as they come. ``first`` is the number of the first run, for a program that writes several files.
    The file is whole or absent.
    """
    path = Path(file)
    summary = _Summary()
    require(not path.is_dir(), "file", path, "is a folder: name a file")
    with write_atomically(path) as temporary, TemporaryDirectory(dir=path.parent, prefix=".") as name:
        folder = Path(name)
        for chunk_tables in _run_chunks(_list_runs(runs), keep, processes, executor, first):
            summary.add(chunk_tables)
            write_part(folder, NAME, chunk_tables)
        tables = map(summary.join, iterate_jobs((folder / JOBS_FOLDER).iterdir(), AT_ONCE[keep], read_part))
        table = next(tables)
        with table_writer(temporary, table.schema) as writer:
            for rows in chain([table], tables):
                writer.write_table(rows)
    _warn(summary)


def _check_overrides(overrides: Any) -> list[str]:
    """Check the overrides of one run; raises BadInput unless they are texts without options of the command line."""
    is_list = not isinstance(overrides, str)
    require(is_list, "runs", overrides, f"must be a list of lists of overrides: [[{overrides!r}]]")
    texts = list_texts(overrides)
    refuse_options(texts)
    return texts


def _list_runs(runs: Iterable[Sequence[str]]) -> Iterable[Sequence[str]]:
    """Check the overrides of all runs, but of a generator, which yields them only once; raises BadInput."""
    fits = isinstance(runs, Iterable) and not isinstance(runs, str)
    require(fits, "runs", runs, 'must be a list of lists of overrides, such as [["cycles=3"]]')
    if isinstance(runs, Sized):
        require(len(runs) > 0, "runs", runs, "must have at least one run")
        return [*map(_check_overrides, runs)]
    return runs


def _run_chunks(
    runs: Iterable[Sequence[str]], keep: str, processes: int | None, executor: Executor | None, first: int
) -> Iterator[JobTables]:
    """Yield the tables of some runs after the other, as they end; ``first`` is the number of the first run."""
    require_name("keep", keep, KEPT)
    total = len(runs) if isinstance(runs, Sized) else None
    workers = count_processes(processes) if executor is None else MOST_WORKERS
    size = MOST_RUNS if total is None else choose_size(total, workers)

    def split() -> Iterator[Item]:
        rest = map(_check_overrides, runs)
        number = first
        while chunk := list(islice(rest, size)):
            yield number, chunk, keep, math.inf if total is None else total
            number += len(chunk)

    with start_workers(processes) if executor is None else nullcontext(executor) as chosen:
        for _, chunk_tables in map_runs(
            run_chunk, split(), chosen, total=total, count_runs=lambda item: len(item[1])
        ):
            yield chunk_tables


def run_chunk(first: int, chunk: Sequence[list[str]], keep: str, runs: float) -> JobTables:
    """Run some of ``runs`` runs, the first of them with the number ``first``.

    Returns a row for each run (number, settings and keys without effect as JSON, status, whether its robot is
    another model), and their metrics or traces. Raises CmacexpError if one of them cannot be run.
    """
    expect_runs(runs)
    recall = Recall()
    idle_keys = IdleKeys()
    rows = defaultdict[str, list[Any]](list)
    tables = list[pa.Table]()
    # Twice as fast in a row as between runs.
    configs = [compose_config(overrides, is_shared=True) for overrides in chunk]
    for overrides, config in zip(chunk, configs, strict=True):
        scenario = make_scenario(config, None, recall)
        if keep == TRACE:
            tables.append(concat_traces([*run_cycles(scenario)]).table)
        else:
            tables.append(join_scores(score_run(scenario)))
        rows["settings"].append(json.dumps(read_settings(overrides)))
        rows["status"].append(str(scenario.end.status))
        rows["idle"].append(json.dumps(idle_keys.find(config, overrides, partial(_compose_untyped, overrides))))
        rows["other_model"].append(describe_other_model(config.machine))
    jobs = {"run": range(first, first + len(chunk)), **rows}
    table, index = concat_metrics(tables)
    numbers = make_column((index + first).tolist())
    # A slice is pickled with all that it is a slice of.
    metrics = table.combine_chunks().add_column(0, "run", numbers)
    return JobTables(pa.table({name: make_column(values) for name, values in jobs.items()}), metrics)


def _compose_untyped(overrides: Sequence[str]) -> DictConfig:
    return compose_untyped(overrides)[0]


class _Summary:
    """What the table of many runs has in common, gathered from its parts: its columns, and warnings."""

    def __init__(self) -> None:
        self.settings = Settings()
        self.idle = IdleReport()
        self.other_models = Names()
        self._metrics = Names()
        self._fields = dict[str, pa.Field]()

    def add(self, chunk_tables: JobTables) -> int:
        """Add runs; returns the number of the first of them."""
        for number, settings, idle, other_model in zip(
            *(chunk_tables.jobs[name].to_pylist() for name in ("run", "settings", "idle", "other_model")), strict=True
        ):
            values = json.loads(settings)
            self.settings.add(values, number)
            self.idle.add(number, values, json.loads(idle))
            self.other_models.add([other_model] if other_model else [], number)
        first = int(chunk_tables.jobs["run"][0].as_py())
        self._metrics.add(chunk_tables.metrics.column_names[1:], first)
        self._fields |= {field.name: field for field in chunk_tables.metrics.schema}
        return first

    def join(self, chunk_tables: JobTables) -> pa.Table:
        """Join metrics of runs with the numbers, settings and status of these."""
        jobs, metrics = chunk_tables
        settings = self.settings.tabulate([*map(json.loads, jobs["settings"].to_pylist())])
        labels = pa.table({"run": jobs["run"], **settings, "status": jobs["status"]})
        index: Any = as_array(jobs, "run").searchsorted(as_array(metrics, "run"))
        joined = join_runs(labels, metrics.drop_columns("run"), index)
        schema = pa.schema([*joined.schema][: labels.num_columns] + [self._fields[name] for name in self._metrics])
        return pa.concat_tables([schema.empty_table(), joined], promote_options="default")


def _warn(summary: _Summary) -> None:
    """Issue the warnings of all runs, attributed to the caller of ``run_many``."""
    for other in summary.other_models:
        warnings.warn(other, OtherModel, stacklevel=3)
    for text in summary.idle.list_lines():
        warnings.warn(text, WithoutEffect, stacklevel=3)
