"""The table of a sweep, one row per job: read from disk, whatever processes ran the jobs, and printed at its end."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import walk
from cmacexp.data.files import FAILED
from cmacexp.data.folder import TABLE, TABLE_CSV, write_atomically
from cmacexp.data.parquet import arrow, arrow_strings, write_table
from cmacexp.data.run import UNFINISHED, Run, sort_folders
from cmacexp.engine.equal_results import print_idle_keys
from cmacexp.engine.objective import describe_best
from cmacexp.engine.sweep import Sweep
from cmacexp.errors import BadRun
from cmacexp.metrics.run_table import make_names, make_rows
from cmacexp.terminal.messages import describe_resume, print_next
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.terminal.tables import print_runs

MAX_LISTED_FAILURES = 20
RunRow = dict[str, Any]


def read_results(sweep: Sweep) -> tuple[list[Run], list[RunRow]]:
    """The jobs of a sweep that left a manifest, and their rows; not those that an earlier sweep left in its folder.

    The settings of a job are the values of all keys that some job overrides, as typed, and nothing else.
    """
    missing: Counter[tuple[str, ...]] = Counter(sweep.planned)
    jobs, typed = [], []
    for job, overrides in _read_jobs(sweep.folder):
        if missing[tuple(overrides)] > 0 or not sweep.planned:  # a sweeper that searches need not plan its jobs
            missing[tuple(overrides)] -= 1
            jobs.append(job)
            typed.append(overrides)
    if not jobs:
        return [], []
    configs = parse_overrides(typed)
    for job, config in zip(jobs, configs, strict=True):
        job.settings = config
    labelled = zip(make_labels(make_names(jobs)), typed, make_rows(jobs, list(configs[0])), strict=True)
    return jobs, [{**label, "overrides": " ".join(overrides), **row} for label, overrides, row in labelled]


def _read_jobs(folder: Path) -> Iterator[tuple[Run, list[str]]]:
    """Each job below ``folder`` as its last attempt ended, and its overrides; a job without a manifest was killed."""
    for job in sort_folders(walk(folder)):
        failed = (job / FAILED).exists()
        try:
            manifest = manifests.read_file(job / FAILED) if failed else manifests.read(job)
        except BadRun:
            continue
        if "overrides" in manifest:
            yield Run(job, manifest), manifest["overrides"]


def make_labels(folders: Sequence[str]) -> list[RunRow]:
    """The number of each run as ``run``, an integer in every table of runs, and its ``folder``.

    A folder whose name is a number, as those of jobs are, gives it; if any has another name, or a number comes
    again, runs are counted from 0 in the order of their folders.
    """
    numbers = [int(folder) for folder in folders if folder.isdecimal()]
    numbers = numbers if len(set(numbers)) == len(folders) else list(range(len(folders)))
    return [{"run": number, "folder": folder} for number, folder in zip(numbers, folders, strict=True)]


def parse_overrides(typed: Sequence[Sequence[str]]) -> list[dict[str, Any]]:
    """The value of each key that some job overrides, for each job; None where it overrides others."""
    settings = [dict(text.lstrip("+").partition("=")[::2] for text in overrides) for overrides in typed]
    keys = list(dict.fromkeys(key for values in settings for key in values))
    return [{key: parse_value(values[key]) if key in values else None for key in keys} for values in settings]


def parse_value(text: str) -> Any:
    """A value as typed on the command line: a number, true, false, null, else text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return None if text == "null" else text.strip("'\"")


def make_column(values: Sequence[Any]) -> pa.Array:
    """Values as an Arrow column: of integers, floats or booleans if all are, else of text."""
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return arrow(np.array(values), pa.int8()).cast(pa.bool_())
    if kinds == {int} and max(map(abs, values)) < 2**63:
        return arrow(np.array(values), pa.int64())
    if kinds <= {int, float}:
        return arrow(np.array(values, dtype=float), pa.float64())
    return arrow_strings(["null" if value is None else str(value) for value in values])


def finish_sweep(sweep: Sweep) -> str:
    """Write the table of a sweep, print it, list the failures with their causes.

    Returns how it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.
    """
    with show_activity("reading the results of the jobs"):
        jobs, rows = read_results(sweep)
    missing = max(0, sweep.planned.total() - len(jobs))
    if not jobs or sweep.place is None:
        return "failed"
    failed = [job for job in jobs if not job.outcome.is_result]
    ended = "failed" if missing or failed else "completed"
    ended = "bad input" if all(job.manifest.get("bad_input") for job in jobs) else ended
    names = dict.fromkeys(name for row in rows for name in row)
    table = pa.table({name: make_column([row.get(name, math.nan) for row in rows]) for name in names})
    entries = {"config": {}, "versions": manifests.versions(), "files": {}}
    manifests.write(sweep.place, {"kind": manifests.SWEEP, "status": ended, **entries})
    with write_atomically(sweep.place / TABLE) as temporary:
        write_table(table, temporary)
    with write_atomically(sweep.place / TABLE_CSV) as temporary:
        pa_csv.write_csv(table, temporary)
    swept = [key for key in jobs[0].settings if len({str(job.settings[key]) for job in jobs}) > 1]
    print_runs(jobs, swept, sweep.folder / TABLE_CSV)
    counts = Counter(job.outcome.status for job in jobs) + Counter({UNFINISHED: missing})
    ends = ", ".join(f"{count} {status}" for status, count in counts.items())
    print(f"{counts.total()} job{'s' * (counts.total() > 1)}: {ends}")
    results = [job for job in jobs if job.outcome.is_result]
    print_idle_keys([job.settings for job in results], [job.folder for job in results], "jobs")
    for job in failed[:MAX_LISTED_FAILURES]:
        print_line(f"  {job.folder.name} {job.outcome.status}: {job.outcome.cause}", error=True)
    if len(failed) > MAX_LISTED_FAILURES:
        print_line(f"  and {len(failed) - MAX_LISTED_FAILURES} more: see {TABLE_CSV}", error=True)
    if sweep.optimize and sweep.direction:
        print_line(f"best:      {describe_best(sweep.optimize, sweep.direction, jobs, swept)}")
    if len(failed) < len(jobs):
        print_next(sweep.folder, {"report": "report"})
    if missing or counts["interrupted"]:
        print_line(f"continue:  {describe_resume(sweep.folder)}")
    print_line(str(sweep.folder / TABLE))
    return ended
