"""``python -m cmacexp.replay DIR...``: show a run, or several side by side, in the Rerun viewer."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cmacexp.commands.command import FOLDERS, Arguments, command, make_flag
from cmacexp.data.manifest import is_run, name_of, require_place, runs_below
from cmacexp.data.run import Run
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.entry_points import load_view
from cmacexp.errors import require, require_extra
from cmacexp.recording.viewer import open_window, require_display, serve_web
from cmacexp.terminal.messages import select_traced
from cmacexp.terminal.output import print_line, show_activity

COMPARISONS = Path("outputs", "comparisons")
"""Folder of recordings of several runs."""
LONGEST_NAME = 120
"""Most characters in the file name of a comparison."""


def _show(recording: Path | str, arguments: Arguments) -> int:
    """Show a recording, a file or an address, as the options say; return the exit code of the viewer."""
    if arguments.no_viewer:
        return 0
    return serve_web(recording) if arguments.web else open_window(recording)


def _show_table(runs: Sequence[Run], arguments: Arguments) -> int:
    """Show a table of runs whose rows open their recordings; return the exit code of the viewer."""
    for name in ("cycles", "every", "meshes", "out"):
        value = vars(arguments)[name]
        require(not value, f"--{name}", value, "must be left out with --table, which shows what is recorded")
    require_extra("datafusion")
    return int(load_view("table")(runs, arguments.rebuild, partial(_show, arguments=arguments)))


@command(
    "replay",
    "Show a run in the Rerun viewer, or several side by side. A recording that is missing, or was made from another "
    "run or by another version, is rebuilt from the trace, as it is with --cycles, --every or --meshes.",
    {
        **FOLDERS,
        "--no-viewer": make_flag("build the recording without opening the viewer"),
        "--web": make_flag("serve the viewer to a browser on this machine until Ctrl-C, instead of opening a window"),
        "--table": make_flag(
            "show a table of the runs, with filters by config and metrics; a row opens its recording"
        ),
        "--rebuild": make_flag("rebuild the recording of a run, with all cycles, even if it is current"),
        "--meshes": make_flag("draw robots with the meshes of their models, which must be those of the runs"),
        "--cycles": {
            "metavar": "CYCLES",
            "help": "range of cycles that all runs have: 3-5 (third to fifth), 7 (only the seventh), last, last5 "
            "(last five)",
        },
        "--every": {
            "metavar": "N",
            "type": int,
            "help": "show every N-th step (default: all steps of a short run, fewer of a long one)",
        },
        "--out": {
            "metavar": "FILE.rrd",
            "type": Path,
            "help": f"file of the recording (default: {RECORDING_FILE} in the folder of the run; for several runs a "
            f"file in {COMPARISONS})",
        },
    },
)
def main(arguments: Arguments) -> int:
    """Build a recording if needed and show it; return the exit code of the viewer."""
    require(not (arguments.web and arguments.no_viewer), "--web", True, "leave out --no-viewer to show the recording")
    folders = {run.resolve(): run for folder in arguments.folders for run in runs_below(folder)}
    runs = [Run(folder) for folder in select_traced(folders.values())]
    if not (arguments.web or arguments.no_viewer):
        require_display()
    if arguments.table:
        return _show_table(runs, arguments)
    from cmacexp.recording.write import DEFAULT, Options, ensure_recording, write_recording

    options = Options(arguments.cycles, arguments.every, arguments.meshes)
    path = runs[0].folder / RECORDING_FILE
    if len(runs) > 1:
        path = COMPARISONS / f"{'-'.join(name_of(run.folder) for run in runs)[:LONGEST_NAME]}.rrd"
    if arguments.out is not None:
        path = arguments.out
        require(path.suffix == ".rrd", "--out", path, "must end in .rrd")
        require_place("--out", path.parent)
        in_run = any(is_run(parent) for parent in path.resolve().parents)
        require(not in_run, "--out", path, "must lie outside the folders of runs")
    is_default = len(runs) == 1 and arguments.out is None and options == DEFAULT
    path.parent.mkdir(parents=True, exist_ok=True)
    with show_activity(f"building {path}"):
        text = ensure_recording(runs[0], arguments.rebuild) if is_default else write_recording(runs, path, options)
    print_line(f"{path}: {text}")
    return _show(path, arguments)
