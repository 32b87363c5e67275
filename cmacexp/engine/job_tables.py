"""Jobs of a sweep as rows of two tables: ``runs.parquet``, and ``metrics.parquet`` with the metrics of all of them.

While the sweep runs, ``.jobs`` in its folder has both for the jobs that a worker has handed over, as one part: a kill
loses no other. Jobs with ``record=metrics`` leave nothing else; a trace is in the folder of its job.
"""

import json
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import JOBS_FOLDER, RUNS_FILE, runs_below
from cmacexp.data.files import open_file, write_atomically
from cmacexp.data.parquet import arrow, as_array, select_rows
from cmacexp.data.run import Outcome, Run, sort_folders
from cmacexp.data.tables import Scores
from cmacexp.engine.sweep_tables import FINGERPRINT, read_tables
from cmacexp.errors import BadRun
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS

HASHES = ("config_hash", "code_hash", "custom_code", "start_weights", "model_hash")
"""Of the manifest of a job: where all are the same, so is the result."""


class JobTables(NamedTuple):
    """Jobs, a row each, and their metrics; both have the number of the job in ``run``, and are in its order."""

    jobs: pa.Table
    metrics: pa.Table


class JobRun(Run):
    """A job that is a row of such tables; its folder exists only if it keeps more than metrics."""

    is_checked = False

    def __init__(self, root: Path, tables: JobTables, index: int):
        self.tables, self.index = tables, index
        super().__init__(root / self.read("folder"))

    def read(self, name: str) -> Any:
        """Its value in a column of the jobs."""
        return self.tables.jobs[name][self.index].as_py()

    @cached_property
    def manifest(self) -> manifests.Manifest:
        """As of a run in a folder; the hashes of its files are those of its metrics if it has none."""
        manifest: manifests.Manifest = json.loads(self.read("manifest"))
        return manifest

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        return Outcome(self.read("status"), self.read("cause"))

    @cached_property
    def scores(self) -> Scores:
        """Its metrics."""
        first, end = np.searchsorted(as_array(self.tables.metrics, "run"), self.read("run") + np.arange(2))
        own = self.tables.metrics.slice(first, end - first).drop_columns("run").combine_chunks()
        own = own.select([name for name in own.column_names if not own[name].null_count])
        names = [name for name in own.column_names if name in BODY_METRICS or name in ESTIMATE_METRICS]
        body = select_rows(own, as_array(own, "leg") == 1).select(["cycle", *names]) if names else None
        return Scores(own.drop_columns(names), body)


def write_part(root: Path, tables: JobTables) -> None:
    """Write a part of the tables of a sweep; raises OSError."""
    (root / JOBS_FOLDER).mkdir(exist_ok=True)
    with write_atomically(root / JOBS_FOLDER / token_hex(8), durable=False) as path, path.open("wb") as file:
        for table in tables:
            with pa.ipc.new_stream(file, table.schema) as writer:
                writer.write_table(table)


def _read(path: Path) -> JobTables:
    """A part of the tables, or those that a sweep has left at its end."""
    if path.name == RUNS_FILE:
        jobs, metrics = read_tables(path.parent)
        names = jobs.column_names
        own = ["run", "folder", "overrides", "manifest"]  # without settings, whose columns stand before the status
        return JobTables(jobs.select(list(dict.fromkeys([*own, *names[names.index("status") :]]))), metrics)
    with open_file(path) as file:
        return JobTables(*(pa.ipc.open_stream(file).read_all() for _ in JobTables._fields))


def list_jobs(root: Path) -> list[JobRun]:
    """The jobs in the tables of a sweep, whether it has ended or not, in the order of their numbers.

    Of several with one number the last one counts. A part that a power failure has cut short is left out.
    """
    parts, known = list[JobTables](), np.empty(0)
    newest_first = sorted((root / JOBS_FOLDER).glob("[!.]*"), key=lambda path: path.lstat().st_mtime_ns, reverse=True)
    for path in [*newest_first, root / RUNS_FILE]:
        with suppress(OSError, KeyError, TypeError, ValueError, pa.ArrowException):
            part = _read(path)
            numbers = np.setdiff1d(as_array(part.jobs, "run"), known)
            known = np.append(known, numbers)
            parts.append(JobTables(*(select_rows(table, np.isin(as_array(table, "run"), numbers)) for table in part)))
    if not known.size:
        return []
    parts = [part for part in parts if part.jobs.num_rows]
    parts.sort(key=lambda part: as_array(part.jobs, "run").min())  # so that columns have always the same order
    tables = JobTables(*(_join(each) for each in zip(*parts, strict=True)))
    return [JobRun(root, tables, index) for index in range(tables.jobs.num_rows)]


def _join(tables: tuple[pa.Table, ...]) -> pa.Table:
    table = pa.concat_tables(tables, promote_options="permissive")
    numbers = as_array(table, "run")
    if (np.diff(numbers) < 0).any():  # else a copy less of what ten thousand jobs have left
        table = table.take(arrow(numbers.argsort(kind="stable"), pa.int64()))
    return table.combine_chunks()


def find_runs(folder: Path) -> list[Run]:
    """All runs below a folder: in folders, or jobs of a sweep that have none; raises BadRun if there is nothing."""
    jobs = [run for run in list_jobs(folder) if not run.read(FINGERPRINT)]
    try:
        return [*jobs, *map(Run, sort_folders(runs_below(folder)))]
    except BadRun:
        if not jobs:
            raise
        return list(jobs)
