"""The end of a sweep: its table is written and printed, with the causes of failures."""

import sys
from collections import Counter
from collections.abc import Sequence
from shutil import get_terminal_size

import numpy as np
import pyarrow.csv as pa_csv

from cmacexp.data.files import write_atomically
from cmacexp.data.parquet import write_table
from cmacexp.metrics.summary import shorten
from cmacexp.report.comparison import format_runs
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.terminal import WIDTH, print_table, progress
from cmacexp.sweep.results import make_table, read_results
from cmacexp.sweep.start import Sweep

TABLE, TABLE_CSV = "sweep.parquet", "sweep.csv"
MOST_FAILURES = 20
"""Failures that are listed; more are only counted."""


def finish_sweep(sweep: Sweep) -> str:
    """Write the table of a sweep, print it, list the failures with their causes.

    Returns:
        How it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.

    Raises:
        OSError: the table cannot be written.
    """
    with progress("reading the results of the jobs"):
        results = read_results(sweep)
    jobs, missing = results.jobs, max(0, sweep.planned.total() - len(results.jobs))
    if not jobs:
        return "failed"
    table = make_table(results.rows())
    write_table(table, sweep.folder / TABLE)
    with write_atomically(sweep.folder / TABLE_CSV) as temporary:
        pa_csv.write_csv(table, temporary)
    _print_table(jobs, results.keys)
    _print_counts(jobs, missing)
    _print_failures(jobs)
    print(sweep.folder / TABLE)
    if all(job.bad_input for job in jobs):
        return "bad input"
    return "failed" if missing or not all(job.is_result for job in jobs) else "completed"


def _print_table(jobs: Sequence[RunSummary], keys: Sequence[str]) -> None:
    """Print the jobs with the keys in which they differ, and as many metrics as fit into a line."""
    swept = [key for key in keys if len({str(job.config[key]) for job in jobs}) > 1]
    titles, rows = format_runs(jobs, swept)
    rows, text_columns = shorten(rows), len(swept) + 2
    shown = max(text_columns, _count_fitting(titles, rows))
    print_table(titles[:shown], [row[:shown] for row in rows], text_columns)


def _count_fitting(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """How many columns fit into a line of the terminal."""
    line = get_terminal_size().columns if sys.stdout.isatty() else WIDTH
    widths = [max(len(part) for row in [titles, *rows] for part in row[i].split("\n")) for i in range(len(titles))]
    return int(np.sum(np.cumsum([width + 2 for width in widths]) - 2 <= line))


def _print_counts(jobs: Sequence[RunSummary], missing: int) -> None:
    counts = Counter(job.status for job in jobs) + Counter({"not begun": missing})
    print(f"{counts.total()} jobs: {', '.join(f'{count} {status}' for status, count in counts.items())}")


def _print_failures(jobs: Sequence[RunSummary]) -> None:
    failed = [job for job in jobs if not job.is_result]
    for job in failed[:MOST_FAILURES]:
        print(f"  {job.folder.name} {job.status}: {job.cause}", file=sys.stderr)
    if len(failed) > MOST_FAILURES:
        print(f"  and {len(failed) - MOST_FAILURES} more: see {TABLE_CSV}", file=sys.stderr)
