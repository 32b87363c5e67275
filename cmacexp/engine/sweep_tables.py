"""Tables of many runs: their settings as typed columns, their metrics, and both as a sweep leaves them on disk.

A sweep writes ``runs.parquet``, a row for each job: number, folder, overrides, how it ended, a hash of what it left;
and ``metrics.parquet``, the metrics of all of them, each row with the number of its job in ``run``. One file is read
much faster than a thousand. Where jobs have folders, these stay the truth: the tables count while the hashes fit.

While the sweep runs, ``.jobs`` in its folder has both for the jobs that a worker has handed over, as one part: a kill
loses no other. Jobs with ``record=metrics`` leave nothing else; a trace is in the folder of its job.
"""

import hashlib
import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.data.files import open_file, sha256, write_atomically
from cmacexp.data.manifest import JOBS_FOLDER, MANIFEST, RUNS_FILE, Manifest, is_run, runs_below, walk
from cmacexp.data.manifest_fields import fill
from cmacexp.data.run import Outcome, Run, sort_folders
from cmacexp.data.tables import (
    BODY_METRICS_FILE,
    IN_THIS_THREAD,
    METRICS_FILE,
    Scores,
    arrow,
    arrow_strings,
    as_array,
    open_parquet,
    select_rows,
    write_table,
)
from cmacexp.errors import BadRun
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.terminal.output import print_line
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

FINGERPRINT = "fingerprint"
"""The table of jobs, and its column of hashes."""
Row = dict[str, Any]


def make_labels(folders: Sequence[str]) -> dict[str, pa.Array]:
    """Columns: the number of each run as ``run``, an integer in every table of runs, and its ``folder``.

    A folder whose name is a number, as those of jobs are, gives it; if any has another name, or a number comes
    again, runs are counted from 0 in the order of their folders.
    """
    numbers = [int(folder) for folder in folders if folder.isdecimal()]
    numbers = numbers if len(set(numbers)) == len(folders) else list(range(len(folders)))
    return {"run": make_column(numbers), "folder": make_column(folders)}


def select_run_overrides(overrides: Sequence[str]) -> list[str]:
    """The overrides of the run of a job, without those of the sweep."""
    return [text for text in overrides if re.split(r"[=./]", text)[0] not in ("sweep", "optimize", "hydra")]


def collect_settings(settings: Iterable[Row]) -> dict[str, list[Any]]:
    """What runs set, by key: a value of each run, "null" for null, None where it does not set the key."""
    columns, count = defaultdict[str, list[Any]](list), 0
    for count, values in enumerate(settings, 1):
        for key, value in values.items():
            columns[key] += [None] * (count - 1 - len(columns[key]))
            columns[key].append("null" if value is None else value)
    return {key: values + [None] * (count - len(values)) for key, values in columns.items()}


def tabulate_settings(settings: Mapping[str, Sequence[Any]]) -> dict[str, pa.Array]:
    """What :func:`collect_settings` gives as columns of a table; null, as text, where a run does not set a key."""
    return {key: make_column(values) for key, values in settings.items()}


def read_settings(overrides: Sequence[str]) -> Row:
    """The keys that overrides set, with their values."""
    typed = (text.lstrip("+").partition("=") for text in overrides)
    return {key: parse_value(value) for key, _, value in typed}


@lru_cache(1 << 12)
def parse_value(text: str) -> Any:
    """A value as typed on the command line: a number, true, false, null, else text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return None if text == "null" else text.strip("'\"")


def make_column(values: Sequence[Any]) -> pa.Array:
    """Values as an Arrow column: of integers, floats or booleans if all are, else of text."""
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        packed = np.packbits(
            np.array(values), bitorder="little"
        )  # a cast would import what takes longer than ten runs
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, pa.py_buffer(packed)])
    if kinds == {int} and max(map(abs, values)) < 2**63:
        return arrow(np.array(values), pa.int64())
    if kinds <= {int, float}:
        return arrow(np.array(values, dtype=float), pa.float64())
    return arrow_strings(["null" if value is None else str(value) for value in values])


def make_table(rows: Sequence[Row]) -> pa.Table:
    """Rows as a table; a number that some of them lack is NaN there."""
    names = dict.fromkeys(name for row in rows for name in row)
    return pa.table({name: make_column([row.get(name, math.nan) for row in rows]) for name in names})


def join_scores(scores: Scores) -> pa.Table:
    """Metrics of a run, with those of its body for each leg."""
    table, body = scores
    if body is not None and table.num_rows:
        rows = np.searchsorted(as_array(body, "cycle"), as_array(table, "cycle"))
        for name in body.column_names:
            if name not in table.column_names:
                table = table.append_column(name, body[name].take(rows))
    return table


def read_metrics(run: Run) -> pa.Table | None:
    """:func:`join_scores` of a stored run; None if it has no metrics. Raises BadRun."""
    return join_scores(run.scores) if run.wrote(METRICS_FILE) else None


def concat_metrics(tables: Sequence[pa.Table | None]) -> tuple[pa.Table, Any]:
    """The metrics of runs as one table, and the index of the run of each row; a run without has a row of nothing."""
    filled = [pa.table({"cycle": pa.nulls(1)}) if table is None else table for table in tables]
    index = np.repeat(np.arange(len(filled)), [table.num_rows for table in filled])
    return pa.concat_tables(filled, promote_options="default"), index


def find_fingerprint(folder: Path) -> str:
    """SHA-256 over the manifest and the metrics of a run, so far as it has them; raises OSError."""
    digest = hashlib.sha256()
    for name in (MANIFEST, METRICS_FILE, BODY_METRICS_FILE):
        with suppress(FileNotFoundError), open_file(folder / name) as file:
            digest.update(file.read())
    return digest.hexdigest()


def write_runs(root: Path, runs: pa.Table, metrics: pa.Table) -> None:
    """Write the tables of a sweep: a row for each of its jobs, and their metrics."""
    with write_atomically(root / RUNS_FILE) as path, write_atomically(root / METRICS_FILE) as own:
        write_table(metrics, own)
        write_table(runs.replace_schema_metadata({METRICS_FILE: sha256(own)}), path)


def read_tables(root: Path, columns: Sequence[str] = ()) -> tuple[pa.Table, pa.Table]:
    """What :func:`write_runs` wrote; of the jobs all columns up to the status, and some of the later ones, if asked.

    Raises OSError, KeyError, TypeError or ArrowException unless both are of one sweep.
    """
    with open_file(root / RUNS_FILE) as file:
        table = open_parquet(file)
        schema = table.schema_arrow
        if schema.metadata[METRICS_FILE.encode()].decode() != sha256(root / METRICS_FILE):
            raise KeyError(METRICS_FILE)
        first = schema.names[: schema.names.index("status") + 1]
        runs = table.read(columns=[*first, *columns] if columns else None, **IN_THIS_THREAD)
    with open_file(root / METRICS_FILE) as file:
        return runs, open_parquet(file).read(**IN_THIS_THREAD)


def read_runs(root: Path) -> tuple[pa.Table, pa.Table] | None:
    """The tables of a sweep, without hashes; None unless the runs below ``root`` are as it left them."""
    try:
        runs, metrics = read_tables(root, [FINGERPRINT])
        hashes = dict(zip(runs["folder"].to_pylist(), runs[FINGERPRINT].to_pylist(), strict=True))
        hashes = {root / folder: digest for folder, digest in hashes.items() if digest}  # of jobs with folders
        added = {place for place in walk(root) if (place / MANIFEST).exists()} - hashes.keys()
        is_changed = any(find_fingerprint(folder) != digest for folder, digest in hashes.items())
        runs = runs.drop_columns(["overrides", FINGERPRINT])
        return None if is_changed or any(map(is_run, added)) else (runs, metrics)
    except (OSError, KeyError, TypeError, ValueError, pa.ArrowException):
        return None


def join_runs(runs: pa.Table, metrics: pa.Table, index: Array) -> pa.Table:
    """Metrics of runs, each row with the values of its run, whose ``index`` in ``runs`` is given, before it."""
    joined = runs.take(arrow(index, pa.int64()))
    for name in metrics.column_names:
        joined = joined.append_column(name, metrics[name])
    return joined


MOST_PARTS = 64
"""Parts of a sweep that are in memory at a time: a small table takes several times what its values do."""
HASHES = ("config_hash", "code_hash", "custom_code", "start_weights", "model_hash")
"""Entries of the manifest of a job: where all are the same, so is the result."""


class JobItem(NamedTuple):
    """A job of a sweep."""

    overrides: list[str]
    values: list[str]
    """Those of its overrides that are set in what Hydra composed for jobs of the same keys and options."""
    number: int
    folder: str
    """Its folder, in that of the sweep."""
    known: tuple[str, ...]
    """:data:`HASHES` of a result that the tables of the sweep have; empty without one."""


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
    def manifest(self) -> Manifest:
        """The manifest as of a run in a folder; the hashes of its files are those of its metrics if it has none."""
        return fill(json.loads(self.read("manifest")))

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
        own = ["run", "folder", "overrides"]  # without settings, whose columns stand before the status
        jobs = jobs.select(list(dict.fromkeys([*own, *names[names.index("status") :]])))
        return JobTables(jobs.replace_schema_metadata(), metrics)
    with open_file(path) as file:
        return JobTables(*(pa.ipc.open_stream(file).read_all() for _ in JobTables._fields))


def list_jobs(root: Path) -> list[JobRun]:
    """The jobs in the tables of a sweep, whether it has ended or not, in the order of their numbers.

    Of several with one number the last one counts. A part that a power failure has cut short is left out.
    """
    found, known = list[tuple[list[int], Path]](), set[int]()
    newest_first = sorted((root / JOBS_FOLDER).glob("[!.]*"), key=lambda path: path.lstat().st_mtime_ns, reverse=True)
    for path in [*newest_first, root / RUNS_FILE]:
        with suppress(OSError, KeyError, TypeError, ValueError, pa.ArrowException):
            numbers = sorted(set(as_array(_read(path).jobs, "run").tolist()) - known)
            known.update(numbers)
            found += [(numbers, path)] if numbers else []
    if not found:
        return []
    found.sort(key=lambda part: part[0][0])  # so that columns have always the same order
    batches = [found[at : at + MOST_PARTS] for at in range(0, len(found), MOST_PARTS)]
    parts = (_join(_select(_read(path), numbers) for numbers, path in batch) for batch in batches)
    # Manifests, which are the most of it, are not copied again.
    jobs, metrics = _join(JobTables(*(table.combine_chunks() for table in tables)) for tables in parts)
    tables = JobTables(jobs, metrics.combine_chunks())
    return [JobRun(root, tables, index) for index in range(jobs.num_rows)]


def _select(part: JobTables, numbers: list[int]) -> JobTables:
    return JobTables(*(select_rows(table, np.isin(as_array(table, "run"), numbers)) for table in part))


def _join(parts: Iterable[JobTables]) -> JobTables:
    """Parts as one, in the order of their numbers; not copied unless that takes sorting."""
    joined = list[pa.Table]()
    for tables in zip(*parts, strict=True):
        table = pa.concat_tables(tables, promote_options="permissive")
        numbers = as_array(table, "run")
        if (np.diff(numbers) < 0).any():
            table = table.take(arrow(numbers.argsort(kind="stable"), pa.int64()))
        joined.append(table)
    return JobTables(*joined)


def find_runs(folder: Path) -> list[Run]:
    """All runs below a folder, in folders or jobs of a sweep that have none; raises BadRun if there is nothing.

    Of the folder of a sweep they are its own jobs: a warning says what else is there, e.g. jobs of an earlier sweep.
    """
    jobs = list_jobs(folder)
    listed = {run.folder.resolve() for run in jobs if run.read(FINGERPRINT)}
    lean: list[Run] = [run for run in jobs if not run.read(FINGERPRINT)]
    try:
        found = sort_folders(runs_below(folder))
    except BadRun:
        if not lean:
            raise
        return lean
    own = [*lean, *(Run(path) for path in found if path in listed)]
    if others := [path.name for path in found if own and path not in listed]:
        reason = "are not of its last sweep and left out; name their folders to include them"
        print_line(f"warning: {folder}: runs in it ({len(others)}, e.g. {others[0]}) {reason}", error=True)
    return own or [*map(Run, found)]


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
    labels = make_labels([run.folder.relative_to(root).as_posix() for run in stored])
    settings = tabulate_settings(collect_settings(read_settings(run.manifest["overrides"] or ()) for run in stored))
    runs = pa.table({**labels, **settings, "status": make_column([run.status for run in stored])})
    return join_runs(runs, metrics, index).to_pandas()
