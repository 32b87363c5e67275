"""``python -m cmacexp.report DIR...``: figures and tables of a run, or a comparison of several."""

from collections.abc import Sequence
from pathlib import Path

from cmacexp.commands.command import FOLDERS, Arguments, command, make_flag
from cmacexp.data import manifest as manifests
from cmacexp.data.folder import choose_page_folder
from cmacexp.data.run import Run
from cmacexp.engine.sweep_tables import find_runs
from cmacexp.errors import BadRun, CmacexpError
from cmacexp.metrics.swept import find_swept
from cmacexp.report.page import REPORT, write_report
from cmacexp.report.run_report import make_run_report
from cmacexp.report.sweep_report import make_sweep_report
from cmacexp.terminal.messages import describe_resume, print_key, print_runs
from cmacexp.terminal.output import print_line, show_activity, show_progress
from cmacexp.typing import Status

REPORTS = Path("outputs/reports")
"""Folder of the reports of several runs or sweeps."""


def _write_sweep_report(runs: Sequence[Run], folders: Sequence[Path], out: Path) -> Path:
    """Write the page of several runs, print their table, and return the page; raises BadRun if no run is readable.

    ``folders`` are those that the user named; ``runs`` are all runs in them.
    """
    with show_progress("reading", len(runs), "runs") as set_done:
        for number, run in enumerate(runs, 1):
            _ = run.outcome  # a cached property, which reads the metrics
            set_done(number)
    BadRun.unless(
        any(run.outcome.is_result for run in runs),
        f"{runs[0].folder.parent}: none of {len(runs)} runs can be read "
        f"({runs[0].folder.name}: {runs[0].outcome.cause})",
    )
    is_sweep = len(folders) == 1 and (folders[0] / "multirun.yaml").exists()  # Hydra writes it when a sweep starts
    stopped = {Status.UNFINISHED, Status.INTERRUPTED} & {run.outcome.status for run in runs}
    is_unfinished = is_sweep and (stopped or not manifests.has_tables(folders[0]))
    resume = describe_resume(folders[0]) if is_unfinished else ""
    what = "Comparison of runs" if len(runs) > 1 else "Metrics of a run"
    title = f"{what}: {' and '.join(path.resolve().name for path in folders)}"
    with show_activity("comparing the runs"):
        path = write_report(make_sweep_report(runs, title, resume), out)
    print_runs(runs, find_swept(runs).all_keys, path)
    if resume:
        print_line(f"continue:  {resume}")
    return path


@command(
    "report",
    "Write an HTML page with figures and tables of a run, or with a comparison of several runs or of a sweep.",
    {
        "folders": {**FOLDERS["folders"], "nargs": "*"},
        "--out": {
            "type": Path,
            "metavar": "FOLDER",
            "help": f"folder of the page (default: DIR/report; for several DIR a folder in {REPORTS})",
        },
        "--key": make_flag("print the key of the tables: title, symbol and definition of each column; needs no DIR"),
    },
)
def main(arguments: Arguments) -> None:
    """Write the page of one run or of several, or print the key of its tables."""
    if arguments.key:
        print_key()
        return
    CmacexpError.unless(arguments.folders, "DIR is missing: name a run, or a folder of runs")
    folders: list[Path] = arguments.folders
    runs = list({run.folder.resolve(): run for folder in folders for run in find_runs(folder)}.values())
    several = REPORTS / "-".join(path.resolve().name for path in folders[:4])
    out = choose_page_folder(arguments.out, folders[0] / REPORT if len(folders) == 1 else several)
    if len(runs) == 1 and manifests.keeps_trace(runs[0].manifest):
        with show_activity(f"reporting {runs[0].folder}"):
            page = write_report(make_run_report(runs[0]), out)
    else:
        page = _write_sweep_report(runs, folders, out)
    print_line(str(page))
