"""The store of the jobs of a sweep: tables that it leaves at its end, parts of them while it runs.

A sweep writes ``runs.parquet``, a row for each job: number, folder, overrides, how it ended, a hash of what it left;
and ``metrics.parquet``, the metrics of all of them, each row with the number of its job in ``run``. One file is read
much faster than a thousand. The manifest of the sweep has the hashes of both. Where jobs have folders, these stay the
truth: the tables count while the hashes of the folders fit.

While the sweep runs, ``.jobs`` in its folder has both for the jobs that a worker has handed over, as one part, whose
name has its hash: a kill loses no other. Jobs with ``record=metrics`` leave nothing else; a trace is in the folder of
its job. A sweep takes its own parts, a resumed one those of all sweeps there; readers take tables, else parts.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.data.files import open_file, write_atomically
from cmacexp.data.integrity import is_whole_part
from cmacexp.data.manifest import (
    JOBS_FOLDER,
    MANIFEST,
    RUNS_FILE,
    Manifest,
    has_tables,
    is_run,
    list_job_parts,
    name_job_part,
    parse,
    read_sweep,
    walk,
)
from cmacexp.data.manifest_fields import fill_entries
from cmacexp.data.records import RunEnd
from cmacexp.data.run import Run
from cmacexp.data.tables import (
    BODY_METRICS_FILE,
    METRICS_FILE,
    Scores,
    arrow,
    as_array,
    check_schema,
    read_schema,
    read_table,
    select_rows,
)
from cmacexp.errors import BadRun
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.terminal.output import print_line
from cmacexp.typing import ENDS, Array

FINGERPRINT = "fingerprint"
"""The column of hashes in the table of jobs; empty for a job without a folder."""
MOST_JOBS = 1 << 10
"""Jobs of a sweep that are in memory at a time while its tables are written."""
HASHES = ("config_hash", "code_hash", "custom_code", "start_weights", "model_hash")
"""Entries of the manifest of a job: where all are the same, so is the result."""


JOB_COLUMNS = {
    "run": pa.int64(),
    "bad_input": pa.bool_(),
    **dict.fromkeys(("folder", "status", "cause", "overrides", *HASHES, FINGERPRINT, "manifest"), pa.string()),
}
"""Columns of the table of jobs that readers use, besides settings and final metrics."""
COMPRESSED = pa.ipc.IpcWriteOptions(compression="zstd")
"""Of parts: manifests repeat each other."""
ALWAYS = ("run", "folder", "status", FINGERPRINT)
"""Those that are read whatever else is."""


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
    """A job that is a row of such tables; its folder exists only if it keeps more than metrics.

    Args:
        root: the folder of the sweep.
        tables: of all its jobs.
        index: the row of the job.
        is_own: whether the sweep that goes on has read it; what others wrote is checked as a manifest in a folder is,
            which takes seconds for a thousand jobs.
    """

    is_checked = False

    def __init__(self, root: Path, tables: JobTables, index: int, is_own: bool):
        self.root = root
        self.tables = tables
        self.index = index
        self.is_own = is_own
        super().__init__(root / self.read("folder"))

    def read(self, name: str) -> Any:
        """Read its value in a column of the table of jobs."""
        return self.tables.jobs[name][self.index].as_py()

    @property
    def idle(self) -> dict[str, str]:
        """Keys without effect in the run of the job, each with the reason; of earlier versions not known."""
        is_known = "idle" in self.tables.jobs.column_names
        return json.loads(self.read("idle") or "{}") if is_known else {}  # type: ignore[no-any-return]

    @cached_property
    def manifest(self) -> Manifest:
        """The manifest as of a run in a folder; the hashes of its files are those of its metrics if it has none."""
        text = self.read("manifest")
        table = self.root / RUNS_FILE
        if self.is_own:
            return fill_entries(json.loads(text))
        manifest = parse(text, table)
        fits = manifest.get("status") == self.read("status") and "kind" not in manifest
        BadRun.unless(fits, f"{table}: the manifest of job {self.read('run')} is not its own; run the sweep again")
        return manifest

    @property
    def outcome(self) -> RunEnd:
        """How it ended."""
        return RunEnd(self.read("status"), self.read("cause")) if self.is_own else super().outcome

    @cached_property
    def scores(self) -> Scores:
        """Its metrics."""
        first, end = np.searchsorted(as_array(self.tables.metrics, "run"), self.read("run") + np.arange(2))
        metrics = self.tables.metrics.slice(first, end - first).drop_columns("run").combine_chunks()
        metrics = metrics.select([name for name in metrics.column_names if not metrics[name].null_count])
        names = [name for name in metrics.column_names if name in BODY_METRICS or name in ESTIMATE_METRICS]
        body = select_rows(metrics, as_array(metrics, "leg") == 1).select(["cycle", *names]) if names else None
        return Scores(metrics.drop_columns(names), body)


def find_fingerprint(folder: Path) -> str:
    """SHA-256 over the manifest and the metrics of a run, so far as it has them; raises OSError."""
    digest = hashlib.sha256()
    for name in (MANIFEST, METRICS_FILE, BODY_METRICS_FILE):
        with suppress(FileNotFoundError), open_file(folder / name) as file:
            digest.update(file.read())
    return digest.hexdigest()


def write_part(root: Path, sweep: str, tables: JobTables) -> Path:
    """Write a part of the tables of the sweep of this name; raises OSError."""
    (root / JOBS_FOLDER).mkdir(exist_ok=True)
    content = pa.BufferOutputStream()
    for table in tables:
        with pa.ipc.new_stream(content, table.schema, options=COMPRESSED) as writer:
            writer.write_table(table)
    content = content.getvalue()
    path = root / JOBS_FOLDER / name_job_part(sweep, content)
    with write_atomically(path, durable=False) as temporary:
        temporary.write_bytes(content)
    return path


def read_part(path: Path) -> JobTables:
    """Read a part of tables as it stands; raises OSError, ValueError or ArrowException."""
    with open_file(path) as file:
        return JobTables(*(pa.ipc.open_stream(file).read_all() for _ in JobTables._fields))


def read_whole(path: Path) -> JobTables:
    """Read a part of the tables, or those that a sweep has left at its end; raises BadRun."""
    if path.name == RUNS_FILE:
        jobs, metrics = read_tables(path.parent)
        names = jobs.column_names
        first_names = ["run", "folder", "overrides"]  # without settings, whose columns stand before the status
        return JobTables(jobs.select(list(dict.fromkeys([*first_names, *names[names.index("status") :]]))), metrics)
    BadRun.unless(is_whole_part(path), f"{path}: changed since it was written")
    try:
        tables = read_part(path)
        for table in tables:
            table.validate(full=True)
    except (OSError, ValueError, pa.ArrowException) as error:
        raise BadRun(f"{path}: cannot be read ({str(error).splitlines()[0]})") from None
    check_schema(path, tables.metrics.schema, texts=False)
    return _check_jobs(path, tables)


def list_sources(root: Path) -> list[Path]:
    """List the files that hold the jobs of the sweep in a folder: its tables, or parts of them while it runs."""
    if has_tables(root):
        return [root / RUNS_FILE]
    names = (read_sweep(root) or {}).get("sweeps") or [""]  # of earlier versions all
    return [path for name in names for path in list_job_parts(root, name)]


def list_whole(root: Path) -> list[Path]:
    """List what a resumed sweep starts from: parts, the newest first, and tables; a warning names a damaged one."""
    whole = []
    for path in (*list_job_parts(root), *([root / RUNS_FILE] if has_tables(root) else [])):
        try:
            read_whole(path)
            whole.append(path)
        except BadRun as error:
            print_line(f"warning: {error}; its jobs run again", error=True)
    return whole


def iterate_jobs(
    sources: Iterable[Path], most: int = MOST_JOBS, read: Callable[[Path], JobTables] = read_whole
) -> Iterator[JobTables]:
    """Yield the jobs in parts or tables of a sweep in the order of their numbers, ``most`` at a time.

    Of several with one number that in the first source counts. Raises BadRun if a source is not as it was written.
    """
    listed = set[int]()
    parts = list[tuple[Array, Path]]()
    for path in sources:
        jobs, _ = read(path)
        numbers = np.array([number for number in as_array(jobs, "run").tolist() if number not in listed])
        listed.update(numbers.tolist())
        parts += [(np.sort(numbers), path)] if len(numbers) else []
    parts.sort(key=lambda part: part[0][0])  # so that columns have always the same order
    in_order = sorted(listed)
    for start in range(0, len(in_order), most):
        low = in_order[start]
        high = in_order[min(start + most, len(in_order)) - 1]
        chosen = [(numbers[(numbers >= low) & (numbers <= high)], path) for numbers, path in parts]
        yield concat_jobs(select_jobs(read(path), numbers) for numbers, path in chosen if len(numbers))


def list_jobs(root: Path, sources: Sequence[Path] | None = None) -> list[JobRun]:
    """List the jobs of the sweep in a folder, whether it has ended or not, in the order of their numbers.

    They are those in :func:`list_sources`, or in the ``sources`` of a sweep that goes on.
    Raises BadRun if one of these is not as it was written.
    """
    is_own = sources is not None
    chosen = list_sources(root) if sources is None else sources
    return [
        JobRun(root, tables, index, is_own)
        for tables in iterate_jobs(chosen)
        for index in range(tables.jobs.num_rows)
    ]


def select_jobs(part: JobTables, numbers: Sequence[int] | Array) -> JobTables:
    """Copy the jobs with these numbers, and their metrics."""
    return JobTables(*(select_rows(table, np.isin(as_array(table, "run"), numbers)) for table in part))


def concat_jobs(parts: Iterable[JobTables]) -> JobTables:
    """Concatenate parts in the order of their numbers; copies only if that takes sorting."""
    joined = list[pa.Table]()
    for tables in zip(*parts, strict=True):
        table = pa.concat_tables(tables, promote_options="permissive")
        numbers = as_array(table, "run")
        if (np.diff(numbers) < 0).any():
            table = table.take(arrow(numbers.argsort(kind="stable"), pa.int64()))
        joined.append(table)
    return JobTables(*(table.combine_chunks() for table in joined))


def read_tables(root: Path, columns: Sequence[str] = ()) -> JobTables:
    """Read the tables of a sweep; of the jobs all columns up to the status, and some of the later ones, if asked.

    Raises BadRun unless they are as the sweep left them, and hold what tables of a sweep do.
    """
    path = root / RUNS_FILE
    wanted = None
    if columns:
        names = read_schema(path).names
        BadRun.unless("status" in names, f"{path}: lacks the column status; run the sweep again")
        wanted = [*names[: names.index("status") + 1], *columns]
    tables = JobTables(read_table(path, True, wanted), read_table(root / METRICS_FILE))
    return _check_jobs(path, tables, is_sorted=True)


def _check_jobs(path: Path, tables: JobTables, is_sorted: bool = False) -> JobTables:
    """Check that tables in the file ``path`` hold what readers use of the jobs of a sweep; raises BadRun."""

    def check(holds: object, what: str) -> None:
        BadRun.unless(holds, f"{path}: {what}: not a table of a sweep; run the sweep again")

    jobs, metrics = tables
    for table, kinds in ((jobs, JOB_COLUMNS), (metrics, {"run": pa.int64()})):
        for name, kind in kinds.items():
            index = table.schema.get_field_index(name)
            check(index >= 0 or name not in ALWAYS, f"lacks the column {name}")
            if index >= 0:
                column = table.column(index)
                check(column.type == kind and not column.null_count, f"its column {name} must hold {kind}")
    numbers = as_array(jobs, "run")
    metrics_numbers = as_array(metrics, "run")
    check("cycle" in metrics.column_names, "its metrics lack the column cycle")
    check(len(np.unique(numbers)) == len(numbers) and np.isin(metrics_numbers, numbers).all(), "its runs do not fit")
    check(
        not is_sorted or ((np.diff(numbers) > 0).all() and (np.diff(metrics_numbers) >= 0).all()),
        "its runs are not in order",
    )
    check(set(jobs["status"].to_pylist()) <= set(ENDS), f"its column status must be one of {', '.join(ENDS)}")
    for folder in jobs["folder"].to_pylist():
        parts = PurePosixPath(folder).parts
        is_inside = parts and parts[0] != "/" and ".." not in parts and "\0" not in folder
        check(is_inside, f"its folder {folder!r} must be inside")
    return tables


def read_runs(root: Path) -> tuple[pa.Table, pa.Table] | None:
    """Read the tables of a sweep, without hashes; None unless the runs below ``root`` are as it left them.

    Raises BadRun if the tables are not.
    """
    if not has_tables(root):
        return None
    runs, metrics = read_tables(root, [FINGERPRINT])
    hashes = dict(zip(runs["folder"].to_pylist(), runs[FINGERPRINT].to_pylist(), strict=True))
    hashes = {root / folder: digest for folder, digest in hashes.items() if digest}  # of jobs with folders
    added = {folder for folder in walk(root) if (folder / MANIFEST).exists()} - hashes.keys()
    try:
        is_changed = any(find_fingerprint(folder) != digest for folder, digest in hashes.items())
    except OSError:
        return None
    return None if is_changed or any(map(is_run, added)) else (runs.drop_columns(["overrides", FINGERPRINT]), metrics)
