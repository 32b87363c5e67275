"""The results of a sweep: its table, one row per job, written and printed at its end."""

from collections import Counter
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow.csv as pa_csv

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import walk
from cmacexp.data.files import full_disk_named, write_atomically
from cmacexp.data.folder import TABLE, TABLE_CSV
from cmacexp.data.parquet import write_table
from cmacexp.data.run import Run, sort_folders
from cmacexp.engine.equal_results import print_idle_keys
from cmacexp.engine.objective import describe_best
from cmacexp.engine.sweep_tables import make_labels, make_table, parse_overrides, read_metrics, write_runs
from cmacexp.errors import BadRun
from cmacexp.metrics.run_table import make_names, make_rows
from cmacexp.terminal.messages import describe_resume, print_next
from cmacexp.terminal.output import print_line, show_activity
from cmacexp.terminal.tables import print_runs
from cmacexp.typing import Status

if TYPE_CHECKING:
    from cmacexp.engine.job import JobEnd

MAX_LISTED_FAILURES = 20


def collect_jobs(folder: Path, planned: Sequence[tuple[str, ...]], ended: "Collection[JobEnd]") -> list[Run]:
    """The jobs of a sweep that ended: as they reported it, else as they left it below the folder of the sweep.

    A job that was killed has no manifest. What an earlier sweep left there does not count: it was not ``planned``,
    as overrides of the run of each job.
    """
    missing, known = Counter(planned), {end.run.folder.resolve(): end for end in ended}
    runs = []
    for place in sort_folders({*known, *walk(folder)}):
        with suppress(BadRun):
            run = known[place].run if place in known else Run(place)
            overrides = tuple(run.manifest.get("overrides", ()))
            if missing[overrides] > 0:
                missing[overrides] -= 1
                runs.append(run)
    for run, settings in zip(runs, parse_overrides([run.manifest["overrides"] for run in runs]), strict=True):
        run.settings = settings
    return runs


def write_tables(folder: Path, runs: Sequence[Run], status: str) -> None:
    """Write the tables of a sweep, and the manifest with its ``status``; raises OSError."""
    keys, labels = list(runs[0].settings), make_labels(make_names(runs))
    typed = [{"overrides": " ".join(run.manifest["overrides"])} for run in runs]
    rows = [label | text | row for label, text, row in zip(labels, typed, make_rows(runs, keys), strict=True)]
    table = make_table(rows)
    with full_disk_named(folder):
        entries = {"config": {}, "versions": manifests.versions(), "files": {}}
        # First: a folder that holds tables without it is refused, and the sweep could not be resumed after a kill.
        manifests.write(folder, {"kind": manifests.SWEEP, "status": status, **entries})
        with write_atomically(folder / TABLE) as path:
            write_table(table, path)
        with write_atomically(folder / TABLE_CSV) as path:
            pa_csv.write_csv(table, path)
        known = [{key: row[key] for key in ("run", "folder", *keys, "status")} for row in rows]
        write_runs(folder, known, [read_metrics(run) for run in runs])


def finish_sweep(
    folder: Path,
    planned: Sequence[tuple[str, ...]],
    ended: "Collection[JobEnd]",
    optimize: str | None,
    direction: str | None,
) -> str:
    """Write the tables of a sweep, print that of its jobs, and list the failures with their causes.

    Args as of :func:`collect_jobs`; ``optimize`` is the metric of which the best job is named, by its ``direction``.

    Returns how it ended: ``completed`` if no job failed, ``bad input`` if no job could be run, else ``failed``.
    """
    with show_activity("reading the results of the jobs"):
        runs = collect_jobs(folder, planned, ended)
    if not runs:
        return Status.FAILED
    failed, missing = [run for run in runs if not run.outcome.is_result], len(planned) - len(runs)
    status = Status.FAILED if missing or failed else Status.COMPLETED
    status = Status.BAD_INPUT if all(run.manifest.get("bad_input") for run in runs) else status
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
