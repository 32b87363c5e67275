"""The end of a sweep: its table is written and printed, with the causes of failures."""

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256, write_atomically
from cmacexp.data.parquet import write_table
from cmacexp.data.tables import TRACE
from cmacexp.experiment.sweep_results import make_table, read_results
from cmacexp.experiment.sweep_start import TABLE, TABLE_CSV, Sweep
from cmacexp.experiment.without_effect import warnings_of_sweep
from cmacexp.report.comparison import print_runs
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.terminal import activity, print_next

MOST_FAILURES = 20
"""Failures that are listed; more are only counted."""


def finish_sweep(sweep: Sweep) -> str:
    """Write the table of a sweep, print it, list the failures with their causes.

    Returns:
        How it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.

    Raises:
        OSError: the table cannot be written.
    """
    with activity("reading the results of the jobs"):
        results = read_results(sweep)
    jobs, missing = results.jobs, max(0, sweep.planned.total() - len(results.jobs))
    if not jobs:
        return "failed"
    ended = _judge(jobs, missing)
    _write_tables(sweep.folder, make_table(results.rows()), ended)
    swept = [key for key in results.keys if len({str(job.config[key]) for job in jobs}) > 1]
    print_runs(jobs, swept, sweep.folder / TABLE_CSV)
    _print_counts(jobs, missing)
    _print_failures(jobs)
    for text in warnings_of_sweep(sweep.kinds.values()):
        print(f"warning: {text}", file=sys.stderr)
    if any(job.is_result for job in jobs):
        print_next(sweep.folder, {"report": "report"})
    print(sweep.folder / TABLE)
    return ended


def _judge(jobs: Sequence[RunSummary], missing: int) -> str:
    if all(job.bad_input for job in jobs):
        return "bad input"
    return "failed" if missing or not all(job.is_result for job in jobs) else "completed"


def _write_tables(folder: Path, table: pa.Table, ended: str) -> None:
    """Write the table of a sweep, and a manifest with the hashes by which ``verify`` knows it."""
    listed = not (folder / TRACE).exists()  # the manifest of a run whose folder is also that of the sweep stays
    if listed:
        (folder / manifests.NAME).unlink(missing_ok=True)
    write_table(table, folder / TABLE)
    with write_atomically(folder / TABLE_CSV) as temporary:
        pa_csv.write_csv(table, temporary)
    if listed:
        files = {name: sha256(folder / name) for name in (TABLE, TABLE_CSV)}
        entries = {"versions": manifests.versions(), "files": files}
        manifests.write(folder, {"kind": manifests.SWEEP, "status": ended, "config": {}, **entries})


def _print_counts(jobs: Sequence[RunSummary], missing: int) -> None:
    counts = Counter(job.status for job in jobs) + Counter({"not begun": missing})
    print(f"{counts.total()} jobs: {', '.join(f'{count} {status}' for status, count in counts.items())}")


def _print_failures(jobs: Sequence[RunSummary]) -> None:
    failed = [job for job in jobs if not job.is_result]
    for job in failed[:MOST_FAILURES]:
        print(f"  {job.folder.name} {job.status}: {job.cause}", file=sys.stderr)
    if len(failed) > MOST_FAILURES:
        print(f"  and {len(failed) - MOST_FAILURES} more: see {TABLE_CSV}", file=sys.stderr)
