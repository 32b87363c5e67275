"""The results of a sweep: its table, one row per job, written and printed at its end."""

import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.files import full_disk_named, sha256, write_atomically
from cmacexp.data.folder import TABLE, TABLE_CSV
from cmacexp.data.tables import METRICS_FILE, as_array, select_rows, write_table
from cmacexp.engine.equal_results import print_idle_keys
from cmacexp.engine.objective import describe_best
from cmacexp.engine.sweep_tables import (
    FINGERPRINT,
    HASHES,
    JobRun,
    list_jobs,
    make_table,
    parse_overrides,
    write_runs,
)
from cmacexp.terminal.messages import describe_resume, print_next, print_runs
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.typing import Status

MAX_LISTED_FAILURES = 20


def collect_jobs(folder: Path, planned: Sequence[tuple[str, ...]]) -> list[JobRun]:
    """The jobs of a sweep that ended, with the values of their overrides as settings.

    A job that was killed has left nothing. What an earlier sweep left there does not count: it was not ``planned``,
    as overrides of the run of each job.
    """
    texts = dict(enumerate(map(" ".join, planned)))
    runs = [run for run in list_jobs(folder) if texts.get(run.read("run")) == run.read("overrides")]
    for run, settings in zip(runs, parse_overrides([planned[run.read("run")] for run in runs]), strict=True):
        run.settings = settings
    return runs


def write_tables(folder: Path, runs: Sequence[JobRun], status: str) -> None:
    """Write the tables of a sweep, and the manifest with its ``status``; raises OSError."""
    jobs, metrics = runs[0].tables
    jobs = select_rows(jobs, np.array([run.index for run in runs]))
    keys, typed = list(runs[0].settings), make_table([run.settings for run in runs])
    for place, name in enumerate(keys, 3):
        jobs = jobs.add_column(place, name, typed[name])
    metrics = select_rows(metrics, np.isin(as_array(metrics, "run"), as_array(jobs, "run")))
    own, ends = ["run", "folder", *keys, "status"], [*HASHES, "result", "bad_input", FINGERPRINT, "manifest"]
    swept = jobs.drop_columns(ends)
    known = jobs.select([*own, FINGERPRINT, *(name for name in jobs.column_names if name not in (*own, FINGERPRINT))])
    is_lean = "" in jobs[FINGERPRINT].to_pylist()
    entries = {
        "kind": manifests.SWEEP,
        "status": status,
        "versions": manifests.versions(),
        "files": {},
        "config": {"record": {"trace": False}} if is_lean else {},
    }
    with full_disk_named(folder):
        # First: a folder that holds tables without it is refused, and the sweep could not be resumed after a kill.
        manifests.write(folder, entries)
        with write_atomically(folder / TABLE) as path:
            write_table(swept, path)
        with write_atomically(folder / TABLE_CSV) as path:
            pa_csv.write_csv(swept, path)
        write_runs(folder, known, metrics)
        if is_lean:
            files = {name: sha256(folder / name) for name in (manifests.RUNS_FILE, METRICS_FILE)}
            manifests.write(folder, {**entries, "files": files})
    shutil.rmtree(folder / manifests.JOBS_FOLDER, ignore_errors=True)


def finish_sweep(
    folder: Path, planned: Sequence[tuple[str, ...]], optimize: str | None, direction: str | None
) -> str:
    """Write the tables of a sweep, print that of its jobs, and list the failures with their causes.

    Args as of :func:`collect_jobs`; ``optimize`` is the metric of which the best job is named, by its ``direction``.

    Returns how it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.
    """
    with show_activity("reading the results of the jobs"):
        runs = collect_jobs(folder, planned)
    if not runs:
        return Status.FAILED
    failed, missing = [run for run in runs if not run.outcome.is_result], len(planned) - len(runs)
    is_wrong = all(run.read("bad_input") for run in runs)
    status = Status.BAD_INPUT if is_wrong else Status.FAILED if missing or failed else Status.COMPLETED
    write_tables(folder, runs, status)
    swept = [key for key in runs[0].settings if len({str(run.settings[key]) for run in runs}) > 1]
    print_runs(runs, swept, folder / TABLE_CSV)
    counts = Counter(run.outcome.status for run in runs) + Counter({Status.UNFINISHED: missing})
    ends = ", ".join(f"{count} {end}" for end, count in counts.items())
    print_line(f"{counts.total()} job{'s' * (counts.total() > 1)}: {ends}")
    results = [run for run in runs if run.outcome.is_result]
    print_idle_keys([run.settings for run in results], results, "jobs")
    for run in failed[:MAX_LISTED_FAILURES]:
        print_line(f"  {run.folder.name} {run.outcome.status}: {run.outcome.cause}", error=True)
    if len(failed) > MAX_LISTED_FAILURES:
        print_line(f"  and {len(failed) - MAX_LISTED_FAILURES} more: see {TABLE_CSV}", error=True)
    if optimize and direction:
        print_line(f"best:      {describe_best(optimize, direction, runs, swept)}")
    if results:
        print_next(folder, {"report": "report"})
    if missing or counts[Status.INTERRUPTED]:
        print_line(f"continue:  {describe_resume(folder)}")
    print_line(str(folder / TABLE))
    return status
