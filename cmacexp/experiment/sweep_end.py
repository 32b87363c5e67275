"""The end of a sweep: its table is written and printed, with the causes of failures."""

import sys
from collections import Counter
from collections.abc import Sequence

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256
from cmacexp.data.folder import TABLE, TABLE_CSV, Place
from cmacexp.data.parquet import write_table
from cmacexp.experiment.sweep_results import make_table, read_results
from cmacexp.experiment.sweep_start import Sweep
from cmacexp.experiment.without_effect import warnings_of_sweep
from cmacexp.report.comparison import print_runs
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.terminal import activity, print_next, say

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
    if not jobs or sweep.place is None:
        return "failed"
    ended = _judge(jobs, missing)
    _write_tables(sweep.place, make_table(results.rows()), ended)
    swept = [key for key in results.keys if len({str(job.config[key]) for job in jobs}) > 1]
    print_runs(jobs, swept, sweep.folder / TABLE_CSV)
    _print_counts(jobs, missing)
    _print_failures(jobs)
    for text in warnings_of_sweep(sweep.kinds.values()):
        say(f"warning: {text}", error=True)
    if any(job.is_result for job in jobs):
        print_next(sweep.folder, {"report": "report"})
    say(str(sweep.folder / TABLE))
    return ended


def _judge(jobs: Sequence[RunSummary], missing: int) -> str:
    if all(job.bad_input for job in jobs):
        return "bad input"
    return "failed" if missing or not all(job.is_result for job in jobs) else "completed"


def _write_tables(place: Place, table: pa.Table, ended: str) -> None:
    write_table(table, place.new / TABLE)
    pa_csv.write_csv(table, place.new / TABLE_CSV)
    files = {name: sha256(place.new / name) for name in (TABLE, TABLE_CSV)}
    entries = {"config": {}, "versions": manifests.versions(), "files": files}
    place.commit({"kind": manifests.SWEEP, "status": ended, **entries})


def _print_counts(jobs: Sequence[RunSummary], missing: int) -> None:
    counts = Counter(job.status for job in jobs) + Counter({"not completed": missing})
    print(f"{counts.total()} jobs: {', '.join(f'{count} {status}' for status, count in counts.items())}")


def _print_failures(jobs: Sequence[RunSummary]) -> None:
    failed = [job for job in jobs if not job.is_result]
    for job in failed[:MOST_FAILURES]:
        say(f"  {job.folder.name} {job.status}: {job.cause}", error=True)
    if len(failed) > MOST_FAILURES:
        print(f"  and {len(failed) - MOST_FAILURES} more: see {TABLE_CSV}", file=sys.stderr)
