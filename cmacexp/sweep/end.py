"""What is said and kept when a sweep has ended: all of it read from disk, whatever processes ran the jobs."""

import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import get_terminal_size
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import yaml

from cmacexp.data.files import write_atomically
from cmacexp.data.parquet import arrow, arrow_strings, write_table
from cmacexp.metrics.summary import shorten
from cmacexp.report.comparison import Row, format_runs, make_rows
from cmacexp.report.run_summary import RunSummary, read_summary, sort_folders
from cmacexp.report.terminal import WIDTH, print_table
from cmacexp.sweep.start import Sweep, without_sweep

TABLE, TABLE_CSV = "sweep.parquet", "sweep.csv"
MOST_FAILURES = 20
"""More failures are told by their number."""


def value_of_text(text: str) -> Any:
    """A value as typed on the command line: a number, true, false, null, else text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return None if text == "null" else text.strip("'\"")


def overrides_of(folder: Path) -> list[str]:
    """What a job was given, as Hydra recorded it; nothing if it was killed before."""
    try:
        found = yaml.safe_load((folder / ".hydra" / "overrides.yaml").read_text())
    except (OSError, yaml.YAMLError):
        return []
    return [str(text) for text in found] if isinstance(found, list) else []


def jobs_of(sweep: Sweep) -> list[tuple[RunSummary, list[str]]]:
    """The jobs of a sweep that were begun, with their overrides; not what an earlier sweep left in its folder."""
    left: Counter[tuple[str, ...]] = Counter(sweep.planned)
    jobs = []
    for folder in sort_folders({path.parent for path in sweep.folder.rglob(".hydra")}):
        given = without_sweep(overrides_of(folder))
        if left[tuple(given)] > 0 or not sweep.planned:  # a sweeper that searches need not tell what it plans
            left[tuple(given)] -= 1
            jobs.append((read_summary(folder), given))
    return jobs


def _column(values: Sequence[Any]) -> pa.Array:
    """Values as an Arrow column: whole numbers, numbers, truth values, else text."""
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return arrow(np.array(values), pa.int8()).cast(pa.bool_())
    if kinds == {int} and max(map(abs, values)) < 2**63:
        return arrow(np.array(values), pa.int64())
    if kinds <= {int, float}:
        return arrow(np.array(values, dtype=float), pa.float64())
    return arrow_strings(["null" if value is None else str(value) for value in values])


def table_of(rows: Sequence[Row]) -> pa.Table:
    """Rows as a table; a number that a row lacks is NaN."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return pa.table({name: _column([row.get(name, math.nan) for row in rows]) for name in names})


def _rows(jobs: Sequence[tuple[RunSummary, list[str]]]) -> tuple[list[RunSummary], list[str], list[Row]]:
    """The jobs with what they were given for their config, all keys of that, and their rows."""
    given = [dict(text.lstrip("+").partition("=")[::2] for text in overrides) for _, overrides in jobs]
    keys = list(dict.fromkeys(key for each in given for key in each))
    values = [{key: value_of_text(each[key]) if key in each else None for key in keys} for each in given]
    swept = [replace(job, config=each) for (job, _), each in zip(jobs, values, strict=True)]
    rows = make_rows(swept, keys)
    told = [" ".join(overrides) for _, overrides in jobs]
    return swept, keys, [{"run": row["run"], "overrides": text, **row} for row, text in zip(rows, told, strict=True)]


def _fitting(titles: Sequence[str], rows: Sequence[Sequence[str]], least: int) -> int:
    """How many columns fit into a line of the terminal, at least some."""
    line = get_terminal_size().columns if sys.stdout.isatty() else WIDTH
    widths = [max(len(part) for row in [titles, *rows] for part in row[i].split("\n")) for i in range(len(titles))]
    ends = np.cumsum([width + 2 for width in widths]) - 2
    return max(least, int(np.sum(ends <= line)))


def _print(jobs: Sequence[RunSummary], keys: Sequence[str], missing: int) -> None:
    swept = [key for key in keys if len({str(job.config[key]) for job in jobs}) > 1]
    titles, rows = format_runs(jobs, swept)
    rows, left = shorten(rows), len(swept) + 2
    shown = _fitting(titles, rows, left)
    print_table(titles[:shown], [row[:shown] for row in rows], left)
    ends = Counter(job.status for job in jobs) + Counter({"not begun": missing})
    print(f"{ends.total()} jobs: {', '.join(f'{count} {status}' for status, count in ends.items())}")


def _tell_failures(jobs: Sequence[RunSummary]) -> None:
    failed = [job for job in jobs if not job.is_result]
    for job in failed[:MOST_FAILURES]:
        print(f"  {job.folder.name} {job.status}: {job.cause}", file=sys.stderr)
    if len(failed) > MOST_FAILURES:
        print(f"  and {len(failed) - MOST_FAILURES} more: see {TABLE_CSV}", file=sys.stderr)


def finish(sweep: Sweep) -> str:
    """Write the table of a sweep, print it, list the failures with their reason.

    Returns:
        How it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.

    Raises:
        OSError: the table cannot be written.
    """
    if not (begun := jobs_of(sweep)):
        return "failed"
    jobs, keys, rows = _rows(begun)
    table = table_of(rows)
    write_table(table, sweep.folder / TABLE)
    with write_atomically(sweep.folder / TABLE_CSV) as temporary:
        pa_csv.write_csv(table, temporary)
    missing = max(0, sweep.planned.total() - len(jobs))
    _print(jobs, keys, missing)
    _tell_failures(jobs)
    print(sweep.folder / TABLE)
    if all(job.bad_input for job in jobs):
        return "bad input"
    return "failed" if missing or not all(job.is_result for job in jobs) else "completed"
