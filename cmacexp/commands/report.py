"""``python -m cmacexp.report DIR...``: figures and tables of a run, or a comparison of several."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cmacexp.commands.command import Parser, run_command
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import require_place, runs_below
from cmacexp.data.folder import OUT_KEY, require_no_link
from cmacexp.data.run import UNFINISHED, Run, sort_folders
from cmacexp.errors import BadInput, BadRun
from cmacexp.report.page import REPORT, write_report
from cmacexp.report.run_report import make_run_report
from cmacexp.report.sweep_report import find_swept, make_sweep_report
from cmacexp.terminal.messages import describe_resume
from cmacexp.terminal.output import print_line, show_activity, show_progress
from cmacexp.terminal.tables import print_key, print_runs

REPORTS = Path("outputs/reports")
"""Reports over several folders are written to a folder in here."""


def _find_destination(given: Sequence[Path], out: str | None) -> Path:
    if out is not None:
        folder = require_place(OUT_KEY, Path(out))
        inside = os.listdir(folder) if folder.is_dir() else []
        if manifests.MANIFEST not in inside and any(not name.startswith(".cmacexp") for name in inside):
            raise BadInput(OUT_KEY, folder, "holds files, but no report to replace; choose an empty or a new folder")
        return folder
    if len(given) == 1:
        return require_no_link(given[0] / REPORT)
    return REPORTS / "-".join(path.resolve().name for path in given[:4])


def _report_of_several(folders: Sequence[Path], given: Sequence[Path], out: Path) -> Path:
    runs = list[Run]()
    with show_progress("reading", len(folders), "runs") as set_done:
        for folder in folders:
            runs.append(Run(folder))
            _ = runs[-1].outcome
            set_done(len(runs))
    if not any(run.outcome.is_result for run in runs):
        where = " and ".join(map(str, given))
        raise BadRun(
            f"{where}: none of its {len(runs)} runs can be read ({runs[0].folder.name}: {runs[0].outcome.cause})"
        )
    swept = find_swept(runs)
    title = f"Comparison of runs: {' and '.join(path.resolve().name for path in given)}"
    stopped = not (given[0] / manifests.MANIFEST).exists() or {UNFINISHED, "interrupted"} & {
        run.outcome.status for run in runs
    }
    is_sweep = len(given) == 1 and (given[0] / "multirun.yaml").exists()  # Hydra writes it when a sweep begins
    resume = describe_resume(given[0]) if is_sweep and stopped else ""
    with show_activity("comparing the runs"):
        path = write_report(make_sweep_report(runs, title, resume), out)
    print_runs(runs, [*swept.keys, *swept.seeds], path)
    if resume:
        print_line(f"continue:  {resume}")
    return path


def _report(arguments: argparse.Namespace) -> int:
    given: list[Path] = arguments.folders
    folders = list(dict.fromkeys(run for folder in given for run in sort_folders(runs_below(folder))))
    out = _find_destination(given, arguments.out)
    if len(folders) == 1:
        with show_activity(f"reporting {folders[0]}"):
            page = write_report(make_run_report(Run(folders[0])), out)
    else:
        page = _report_of_several(folders, given, out)
    print_line(str(page))
    return 0


class _Key(argparse.Action):
    """Prints what the columns of metrics mean."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print_key()
        parser.exit()


def main() -> int:
    """Run the command."""
    description = "Figures and tables of a run, or a comparison of several runs or a sweep, as one HTML page."
    parser = Parser("cmacexp.report", description, folders=True)
    text = f"folder of the page (default: DIR/report, or {REPORTS}/NAMES for several)"
    parser.add_argument("--out", metavar="FOLDER", help=text)
    text = "print what each column of the tables means: name, symbol, definition; needs no DIR"
    parser.add_argument("--key", nargs=0, action=_Key, help=text)
    return run_command(lambda: _report(parser.parse_args()))
