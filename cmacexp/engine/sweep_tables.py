"""Tables of many runs: their settings as typed columns, beside their metrics."""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence, Set
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from cmacexp.config.compose import parse_value
from cmacexp.data.manifest import runs_below
from cmacexp.data.run import Run, sort_folders
from cmacexp.data.tables import METRICS_FILE, Scores, arrow, arrow_strings, as_array
from cmacexp.engine.job_store import FINGERPRINT, list_jobs, read_runs
from cmacexp.errors import BadRun
from cmacexp.terminal.output import print_line
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

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
    """Select the overrides of the run of a job, without those of the sweep."""
    return [text for text in overrides if re.split(r"[=./]", text)[0] not in ("sweep", "optimize", "hydra")]


class Names:
    """Names of columns in the order of the numbers of runs that have them, whatever the order in which runs end."""

    def __init__(self) -> None:
        self._first = dict[str, tuple[int, int]]()

    def add(self, names: Iterable[str], number: int) -> None:
        """Add the names that the run with a number has, in their order."""
        for position, name in enumerate(names):
            self._first[name] = min((number, position), self._first.get(name, (number, position)))

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._first, key=self._first.__getitem__))


class Settings:
    """Settings of many runs as typed columns; it holds the type of each column, not the values."""

    def __init__(self) -> None:
        self.keys = Names()
        self._types = defaultdict[str, set[type]](set)
        self._counts = Counter[str]()
        self._values = dict[str, str]()
        self._varied = set[str]()
        self._runs = 0

    def add(self, settings: Row, number: int) -> None:
        """Note what the run with this number sets."""
        self._runs += 1
        self.keys.add(settings, number)
        self._counts.update([*settings])
        for key, value in settings.items():
            self._types[key].add(type(value))
            if self._values.setdefault(key, str(value)) != str(value):
                self._varied.add(key)

    def list_varied(self) -> list[str]:
        """List the keys that have several values, or that not all runs set."""
        return [key for key in self.keys if key in self._varied or self._counts[key] < self._runs]

    def tabulate(self, rows: Sequence[Row]) -> dict[str, pa.Array]:
        """Make a column of each key for some of these runs; of text, "null" where one of all does not set it."""
        columns = {}
        for key in self.keys:
            types = self._types[key] | ({type(None)} if self._counts[key] < self._runs else set())
            columns[key] = make_column([row.get(key) for row in rows], types)
        return columns


def tabulate_settings(rows: Sequence[Row]) -> dict[str, pa.Array]:
    """Make a column of each key that some of all runs set."""
    settings = Settings()
    for number, row in enumerate(rows):
        settings.add(row, number)
    return settings.tabulate(rows)


def read_settings(overrides: Sequence[str]) -> Row:
    """Read the keys that overrides set, with their values."""
    pairs = (text.lstrip("+").partition("=") for text in overrides)
    return {key: parse_value(value) for key, _, value in pairs}


def make_column(values: Sequence[Any], types: Set[type] | None = None) -> pa.Array:
    """Make an Arrow column: of booleans, int64 or float64 (also integers with floats), else of text, "null" for None.

    If ``values`` are a part of a column, ``types`` are the types in the whole column, so that parts agree.
    """
    types = {*map(type, values)} if types is None else types
    if types == {bool}:
        # A cast would import what takes longer than ten runs.
        packed = np.packbits(np.array(values, dtype=bool), bitorder="little")
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, pa.py_buffer(packed)])
    if types == {int} and max(map(abs, values), default=0) < 2**63:
        return arrow(np.array(values, dtype=int), pa.int64())
    if types <= {int, float}:
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
        fields = [field for field in body.schema if field.name not in table.column_names]
        columns = [arrow(as_array(body, field.name)[rows], field.type) for field in fields]
        return pa.Table.from_arrays([*table.columns, *columns], schema=pa.schema([*table.schema, *fields]))
    return table


def read_metrics(run: Run) -> pa.Table | None:
    """:func:`join_scores` of a stored run; None if it has no metrics. Raises BadRun."""
    return join_scores(run.scores) if run.wrote(METRICS_FILE) else None


def concat_metrics(tables: Sequence[pa.Table | None]) -> tuple[pa.Table, Any]:
    """Concatenate the metrics of runs; returns also the index of the run of each row; none has an empty row."""
    filled = [pa.table({"cycle": pa.nulls(1)}) if table is None else table for table in tables]
    index = np.repeat(np.arange(len(filled)), [table.num_rows for table in filled])
    return pa.concat_tables(filled, promote_options="default"), index


def join_runs(runs: pa.Table, metrics: pa.Table, index: Array) -> pa.Table:
    """Metrics of runs, each row with the values of its run, whose ``index`` in ``runs`` is given, before it."""
    joined = runs.take(arrow(index, pa.int64()))
    for name in metrics.column_names:
        joined = joined.append_column(name, metrics[name])
    return joined


def find_runs(folder: Path) -> list[Run]:
    """Find all runs below a folder, also jobs of a sweep without folders; raises BadRun if there are none.

    Of the folder of a sweep they are its own jobs: a warning says what else is there, e.g. jobs of an earlier sweep.
    """
    jobs = list_jobs(folder)
    listed = {run.folder.resolve() for run in jobs if run.read(FINGERPRINT)}
    lean: list[Run] = [run for run in jobs if not run.read(FINGERPRINT)]
    try:
        folders = sort_folders(runs_below(folder))
    except BadRun:
        if not lean:
            raise
        return lean
    jobs_found = [*lean, *(Run(path) for path in folders if path in listed)]
    if left_out := [path.name for path in folders if jobs_found and path not in listed]:
        reason = "are not of its last sweep and left out; name their folders to include them"
        print_line(f"warning: {folder}: runs in it ({len(left_out)}, e.g. {left_out[0]}) {reason}", error=True)
    return jobs_found or [*map(Run, folders)]


def load_sweep(folder: str | Path) -> "pd.DataFrame":
    """Load all metrics of all jobs of a sweep, or of all runs below a folder.

    Returns:
        A row for each job, cycle and leg: ``run``, the number of the job; ``folder``, its place below ``folder``; a
        column for each key that some job overrides; ``status``; the columns of ``metrics.parquet`` and of
        ``body_metrics.parquet``, see ``docs/files.md``. A job without metrics has one row, which lacks them. Runs
        whose folders are not numbered, as jobs are, have the numbers 0, 1, ... in the order of their folders.

    Raises:
        BadRun: there is no run, or one is not intact.
    """
    root = Path(folder).resolve()
    if tables := read_runs(root):
        runs, metrics = tables
        index = np.searchsorted(runs["run"], metrics["run"])
        return join_runs(runs, metrics.drop_columns("run"), index).to_pandas()
    stored = find_runs(root)
    metrics, index = concat_metrics([read_metrics(run) for run in stored])
    labels = make_labels([run.folder.relative_to(root).as_posix() for run in stored])
    settings = tabulate_settings([read_settings(run.manifest["overrides"] or ()) for run in stored])
    runs = pa.table({**labels, **settings, "status": make_column([run.status for run in stored])})
    return join_runs(runs, metrics, index).to_pandas()
