"""The end of a sweep: what its jobs have left becomes its tables, a thousand jobs at a time, and is printed."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.files import full_disk_named, sha256, write_atomically
from cmacexp.data.folder import TABLE, TABLE_CSV, make_sweep_manifest
from cmacexp.data.tables import METRICS_FILE, choose_compression, table_writer
from cmacexp.engine.job_store import (
    FINGERPRINT,
    HASHES,
    JobRun,
    JobTables,
    iterate_jobs,
    read_whole,
    select_jobs,
    write_part,
)
from cmacexp.engine.objective import MAXIMIZE, describe_best, read_objective
from cmacexp.engine.sweep_tables import Settings, read_settings
from cmacexp.engine.without_effect import IdleReport
from cmacexp.metrics.registry import shorten
from cmacexp.terminal.messages import describe_resume, print_next, print_runs
from cmacexp.terminal.output import print_line
from cmacexp.typing import RESULTS, Status

MAX_LISTED_FAILURES = 20
MOST_PARTS = 16
"""Parts of the tables of a sweep that are in memory at a time, so that those of a short sweep are read once."""
ONLY_IN_STORE = [*HASHES, "idle", "bad_input", FINGERPRINT, "manifest"]
"""Columns of the table of jobs that the table for users lacks."""


class SweepEnd:
    """How the jobs of a sweep ended, read from what they have left; it holds sums over jobs, not the jobs.

    A job that was killed has left nothing. What an earlier sweep left does not count if it was not planned.

    Args:
        folder: of the sweep.
        sources: parts and tables with its jobs, as :func:`iterate_jobs` takes them.
        planned: overrides of the run of each job, by its number.
        objective: the metric that ``optimize`` names, and the direction of the search; None without one.
    """

    def __init__(
        self,
        folder: Path,
        sources: Sequence[Path],
        planned: Sequence[Sequence[str]],
        objective: tuple[str, str] | None,
    ):
        self.folder = folder
        self.sources = sources
        self.planned = planned
        self.counts = Counter[str]()
        self.failed = list[str]()
        """The first failures, a line for each."""
        self.settings = Settings()
        self.idle = IdleReport()
        self.is_wrong = self.is_lean = False
        self._schemas = list[tuple[pa.Schema, pa.Schema]]()
        self._objective = objective
        self._best: tuple[float, JobRun] | None = None
        self._shown = list[JobRun]()
        self._seen = 0
        self._read = lru_cache(MOST_PARTS)(read_whole)
        is_wrong = set[bool]()
        for tables in self._iterate():
            self._add(tables)
            is_wrong.update(tables.jobs["bad_input"].to_pylist())
        self.is_wrong = is_wrong == {True}

    @property
    def missing(self) -> int:
        """Number of jobs that have left nothing."""
        return len(self.planned) - self.counts.total()

    @property
    def status(self) -> str:
        """How the sweep ended: ``completed``, ``bad input`` if no job could be run, else ``failed``."""
        all_are_results = not self.missing and self.counts.keys() <= {*RESULTS}
        return Status.BAD_INPUT if self.is_wrong else Status.COMPLETED if all_are_results else Status.FAILED

    def _iterate(self) -> Iterator[JobTables]:
        """Yield the planned jobs that have ended, in the order of their numbers."""
        for tables in iterate_jobs(self.sources, read=self._read):
            jobs = zip(tables.jobs["run"].to_pylist(), tables.jobs["overrides"].to_pylist(), strict=True)
            yield select_jobs(tables, [number for number, overrides in jobs if self._is_planned(number, overrides)])

    def _is_planned(self, number: int, overrides: str) -> bool:
        return number < len(self.planned) and " ".join(self.planned[number]) == overrides

    def _read_settings(self, number: int) -> dict[str, Any]:
        return read_settings(self.planned[number])

    def _add(self, tables: JobTables) -> None:
        schemas = tables.jobs.schema, tables.metrics.schema
        self._schemas += [schemas] if schemas not in self._schemas else []
        for index in range(tables.jobs.num_rows):
            run = JobRun(self.folder, tables, index, is_own=True)
            number = run.read("run")
            outcome = run.outcome
            settings = self._read_settings(number)
            self.counts[outcome.status] += 1
            if outcome.is_result:
                self.idle.add(number, settings, run.idle)
            elif len(self.failed) < MAX_LISTED_FAILURES:
                self.failed.append(f"  {run.folder.name} {outcome.status}: {outcome.cause}")
            self.settings.add(settings, number)
            self.is_lean |= not run.read(FINGERPRINT)
            if self._objective is not None:
                self._compare(run, number, *self._objective)

    def _compare(self, run: JobRun, number: int, metric: str, direction: str) -> None:
        value = read_objective(metric, run, direction)
        rank = -value if direction == MAXIMIZE else value
        if self._best is None or rank < self._best[0]:
            self._best = rank, JobRun(self.folder, select_jobs(run.tables, [number]), 0, is_own=True)
            self._best[1].settings = self._read_settings(number)

    def _show(self, tables: JobTables) -> None:
        """Keep copies of the next jobs that are printed: of many the first, some between and the last."""
        positions = {*shorten(range(self.counts.total()))}
        numbers = tables.jobs["run"].to_pylist()
        chosen = [number for position, number in enumerate(numbers, self._seen) if position in positions]
        self._seen += len(numbers)
        copied = select_jobs(tables, chosen)
        for index, number in enumerate(chosen):
            run = JobRun(self.folder, copied, index, is_own=True)
            run.settings = self._read_settings(number)
            self._shown.append(run)

    def write(self, status: str, sweep: str) -> None:
        """Write the tables of the ``sweep`` of this name, and the manifest with its ``status``; raises OSError.

        Until the manifest lists the new tables, the parts of the sweep have all that they will.
        """
        if replaces := manifests.has_tables(self.folder):
            parts = [write_part(self.folder, sweep, tables) for tables in self._iterate()]
            self.sources = parts  # a resumed sweep has some of its jobs from the tables that it replaces
        schemas = [*map(_unify, zip(*self._schemas, strict=True))]
        names = (TABLE, manifests.RUNS_FILE, METRICS_FILE, TABLE_CSV)
        with full_disk_named(self.folder), ExitStack() as stack:
            if replaces:
                manifests.write(self.folder, make_sweep_manifest(Status.UNFINISHED, sweeps=[sweep]))
            paths = {name: stack.enter_context(write_atomically(self.folder / name)) for name in names}
            with ExitStack() as writing:
                writers = dict[str, Any]()
                for tables in self._iterate():
                    self._show(tables)
                    by_name = self._make_tables(tables, schemas)
                    for name, table in by_name.items():
                        if name not in writers:
                            writer = _open_writer(paths[name], table.schema, table.num_rows)
                            writers[name] = writing.enter_context(writer)
                        writers[name].write_table(table)
        files = {name: sha256(self.folder / name) for name in names if name != TABLE_CSV}
        manifests.write(self.folder, make_sweep_manifest(status, files, self.is_lean))
        for path in manifests.list_job_parts(self.folder):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # others have put something into it
            (self.folder / manifests.JOBS_FOLDER).rmdir()

    def _make_tables(self, tables: JobTables, schemas: Sequence[pa.Schema]) -> Mapping[str, pa.Table]:
        """Make the tables of some jobs, by name."""
        jobs, metrics = map(_fit, tables, schemas)
        settings = self.settings.tabulate([self._read_settings(number) for number in jobs["run"].to_pylist()])
        for position, (name, column) in enumerate(settings.items(), 3):
            jobs = jobs.add_column(position, name, column)
        for_users = jobs.drop_columns(ONLY_IN_STORE)
        return {TABLE: for_users, TABLE_CSV: for_users, manifests.RUNS_FILE: jobs, METRICS_FILE: metrics}

    def print(self) -> None:
        """Print a table of jobs, how many ended how, warnings, failures with their causes, and what to do next."""
        for tables in () if self._shown else self._iterate():
            self._show(tables)
        swept = self.settings.list_varied()
        print_runs(self._shown, swept, self.folder / TABLE_CSV, self.counts.total())
        counts = self.counts + Counter({Status.UNFINISHED: self.missing})
        ends = ", ".join(f"{count} {end}" for end, count in counts.items())
        print_line(f"{counts.total()} job{'s' * (counts.total() > 1)}: {ends}")
        for text in self.idle.list_lines():
            print_line(f"warning: {text}", error=True)
        for text in self.failed:
            print_line(text, error=True)
        count = sum(count for end, count in self.counts.items() if end not in RESULTS)
        if count > len(self.failed):
            print_line(f"  and {count - len(self.failed)} more: see {TABLE_CSV}", error=True)
        if self._best is not None and self._objective is not None:
            print_line(f"best:      {describe_best(*self._objective, self._best[1], swept)}")
        if count < self.counts.total():
            print_next(self.folder, {"report": "report"})
        if self.missing or self.counts[Status.INTERRUPTED]:
            print_line(f"continue:  {describe_resume(self.folder)}")


def _open_writer(path: Path, schema: pa.Schema, rows: int) -> Any:
    """Open a table for writing part by part; the first part has this number of rows."""
    if TABLE_CSV in path.name:
        return pa_csv.CSVWriter(path, schema)
    return table_writer(path, schema, choose_compression(rows))


def _unify(schemas: Sequence[pa.Schema]) -> pa.Schema:
    """Unify the schemas of parts."""
    return pa.unify_schemas(schemas, promote_options="permissive")


def _fit(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Give a table all columns of a schema, with null where it lacks one."""
    if table.schema.equals(schema):
        return table.replace_schema_metadata(schema.metadata)
    fitted = pa.concat_tables([schema.empty_table(), table], promote_options="permissive").combine_chunks()
    return fitted.replace_schema_metadata(schema.metadata)
