"""``python -m cmacexp.report DIR...``: figures and tables of a run, or of several beside each other."""

import argparse
import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path

from cmacexp.cli.command import command
from cmacexp.data.discovery import require_place, runs_below
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput, BadRun
from cmacexp.report.comparison import find_swept, in_order, job_of, table_of_jobs
from cmacexp.report.page import Report, write_report
from cmacexp.report.run_report import run_report
from cmacexp.report.sweep_report import sweep_report
from cmacexp.report.terminal import print_table

REPORTS = Path("outputs/reports")
"""Where a report over several folders goes, in a folder of its own."""


def _cycles(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise BadInput("--cycles", text, "must be whole numbers with commas between them, such as 1,2,5") from None


def _destination(given: Sequence[Path], out: str | None) -> Path:
    if out is not None:
        return require_place("--out", Path(out))
    return given[0] / "report" if len(given) == 1 else REPORTS / "-".join(path.resolve().name for path in given[:4])


def _key(report: Report) -> str:
    return hashlib.sha256(repr((report.title, report.config)).encode()).hexdigest()


def _report_of_one(folder: Path, cycles: str | None, out: Path) -> Path:
    report = run_report(StoredRun(folder), _cycles(cycles) if cycles else [])
    return write_report(report, out, _key(report))


def _report_of_several(folders: Sequence[Path], title: str, cycles: str | None, out: Path) -> Path:
    if cycles:
        raise BadInput("--cycles", cycles, f"is for the report of one run, and these are {len(folders)}")
    jobs = [job_of(folder) for folder in folders]
    if not any(job.is_result for job in jobs):
        raise BadRun(f"{title}: none of its {len(jobs)} runs can be read ({jobs[0].folder.name}: {jobs[0].cause})")
    swept = find_swept(jobs)
    titles, rows = table_of_jobs(jobs, [*swept.keys, *swept.repeats])
    report = sweep_report(jobs, title)
    path = write_report(report, out, _key(report))
    print_table(titles, rows, left=1 + len(swept.keys) + len(swept.repeats) + 1)
    return path


def _report(arguments: argparse.Namespace) -> int:
    given: list[Path] = arguments.folders
    folders = list(dict.fromkeys(run for folder in given for run in in_order(runs_below(folder))))
    out = _destination(given, arguments.out)
    if len(folders) == 1:
        print(_report_of_one(folders[0], arguments.cycles, out))
    else:
        print(_report_of_several(folders, " and ".join(map(str, given)), arguments.cycles, out))
    return 0


def main() -> int:
    """Run the command."""
    description = "Figures and tables of a run, or of a sweep or several runs beside each other, as one HTML page."
    values = [
        ("--cycles", "1,2,5", "cycles of one run to show; unless given, a choice"),
        ("--out", "FOLDER", f"where the page goes; unless given, report in DIR, {REPORTS}/NAMES for several"),
    ]
    return command("cmacexp.report", description, _report, (), values)


if __name__ == "__main__":
    sys.exit(main())
