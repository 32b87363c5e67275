"""The end of a sweep: its table is written and printed, with the causes of failures."""

from collections import Counter

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256
from cmacexp.data.folder import TABLE, TABLE_CSV, Place
from cmacexp.data.parquet import write_table
from cmacexp.experiment.sweep import Sweep
from cmacexp.experiment.sweep_results import make_table, read_results
from cmacexp.experiment.without_effect import warnings_of_sweep
from cmacexp.report.comparison import print_runs
from cmacexp.report.terminal import activity, print_next, say

MAX_LISTED_FAILURES = 20
"""Failures that are listed; more are only counted."""


def finish_sweep(sweep: Sweep) -> str:
    """Write the table of a sweep, print it, list the failures with their causes.

    Returns:
        How it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.

    Raises:
        OSError: the table cannot be written.
    """
    with activity("reading the results of the jobs"):
        jobs, rows = read_results(sweep)
    missing = max(0, sweep.planned.total() - len(jobs))
    if not jobs or sweep.place is None:
        return "failed"
    failed = [job for job in jobs if not job.is_result]
    ended = "failed" if missing or failed else "completed"
    ended = "bad input" if all(job.bad_input for job in jobs) else ended
    _write_tables(sweep.place, make_table(rows), ended)
    swept = [key for key in jobs[0].config if len({str(job.config[key]) for job in jobs}) > 1]
    print_runs(jobs, swept, sweep.folder / TABLE_CSV)
    counts = Counter(job.status for job in jobs) + Counter({"not completed": missing})
    print(f"{counts.total()} jobs: {', '.join(f'{count} {status}' for status, count in counts.items())}")
    for job in failed[:MAX_LISTED_FAILURES]:
        say(f"  {job.folder.name} {job.status}: {job.cause}", error=True)
    if len(failed) > MAX_LISTED_FAILURES:
        say(f"  and {len(failed) - MAX_LISTED_FAILURES} more: see {TABLE_CSV}", error=True)
    for text in warnings_of_sweep((kind.composed, kind.runs) for kind in sweep.kinds.values() if kind.runs):
        say(f"warning: {text}", error=True)
    if len(failed) < len(jobs):
        print_next(sweep.folder, {"report": "report"})
    say(str(sweep.folder / TABLE))
    return ended


def _write_tables(place: Place, table: pa.Table, ended: str) -> None:
    write_table(table, place.new / TABLE)
    pa_csv.write_csv(table, place.new / TABLE_CSV)
    files = {name: sha256(place.new / name) for name in (TABLE, TABLE_CSV)}
    entries = {"config": {}, "versions": manifests.versions(), "files": files}
    place.commit({"kind": manifests.SWEEP, "status": ended, **entries})
