"""``python -m cmacexp.replay DIR...``: show a run, or several side by side, in the Rerun viewer."""

import argparse
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from cmacexp.commands.command import Parser, run_command
from cmacexp.commands.viewer import HOST, open_window, require_display, serve_web
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import is_run, name_of, require_place, runs_below
from cmacexp.data.files import is_regular
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.data.trace import count_steps_by_cycle, read_trace
from cmacexp.errors import BadInput, BadRun, require_extra
from cmacexp.terminal.output import print_line, show_activity

COMPARISONS = Path("outputs", "comparisons")
LONGEST_NAME = 120
"""Most characters in the name of the file of a comparison."""


class Options(NamedTuple):
    """What the recording shows; None: the default."""

    cycles: str | None = None
    """As typed."""
    every: int | None = None
    """One step in so many."""
    meshes: bool = False
    """Whether robots are drawn as their models show them."""


def _kept(folder: Path) -> dict[int, int]:
    """Steps of each cycle in the trace of a run."""
    kept = count_steps_by_cycle(folder)
    if not kept:
        taken = manifests.read(folder).get("steps", 0)
        why = f"its trace kept none of its {taken} steps" if taken else "the run took no step"
        raise BadRun(f"{folder}: {why}, there is nothing to show")
    return kept


def rebuild(folder: Path, path: Path, options: Options) -> str:
    """Write the recording of a run from its trace; returns a description of its content."""
    from cmacexp.recording.window import make_window, read_cycles
    from cmacexp.recording.write import write_recording

    manifest, kept = manifests.read(folder), _kept(folder)
    cycles = read_cycles(options.cycles, max(kept)) if options.cycles is not None else None
    window = make_window(kept, cycles, options.every)
    shown: dict[str, Any] = {"label": folder.resolve().name, "window": window, "meshes": options.meshes}
    return write_recording(folder, manifest, path, **shown) + window.hint


def compare(folders: Sequence[Path], path: Path, options: Options) -> str:
    """Write one recording of several runs side by side; returns a description of its content."""
    from cmacexp.config.describe import labels
    from cmacexp.recording.compare import MOST_RUNS, write_comparison
    from cmacexp.recording.run_view import make_view
    from cmacexp.recording.window import make_window, read_cycles

    if len(folders) > MOST_RUNS:
        raise BadRun(
            f"{len(folders)} runs: at most {MOST_RUNS} go side by side; name the folders of those to compare"
        )
    cycles, last = None, min(max(_kept(folder)) for folder in folders)
    if options.cycles is not None:
        cycles = read_cycles(options.cycles, last, "all runs")
    found = [manifests.read(folder) for folder in folders]
    names = labels([manifest["config"] for manifest in found], [folder.resolve().name for folder in folders])
    views = {}
    for number, (folder, manifest, label) in enumerate(zip(folders, found, names, strict=True), start=1):
        window = make_window(_kept(folder), cycles, options.every, sharing=len(folders))
        traces = read_trace(folder, range(window.first, window.last + 1), window.every)
        root = f"{number}_{re.sub('[^A-Za-z0-9.-]+', '_', label)}/"
        views[folder] = replace(make_view(traces, manifest, window, label, root), meshes=options.meshes)
    if max(view.time[0] for view in views.values()) > min(view.time[-1] for view in views.values()):
        raise BadInput(
            "--cycles", options.cycles, "these cycles of the runs have no time in common; choose earlier ones"
        )
    name = write_comparison(views, path)
    return name + next((view.window.hint for view in views.values() if view.window.hint), "")


def _comparison_path(folders: Sequence[Path]) -> Path:
    """Default path of a comparison."""
    return COMPARISONS / f"{'-'.join(map(name_of, folders))[:LONGEST_NAME]}.rrd"


def _out(given: str) -> Path:
    path = Path(given)
    if path.suffix != ".rrd":
        raise BadInput("--out", given, "must end in .rrd")
    if path.is_dir():
        raise BadInput("--out", given, "is a folder; name a file")
    require_place("--out", path.parent)
    if any(is_run(parent) for parent in path.resolve().parents):
        raise BadInput("--out", given, "must lie outside the folders of runs")
    return path


def _read_options(arguments: argparse.Namespace) -> Options:
    every = arguments.every
    if every is not None and not (every.isdecimal() and int(every) > 0):
        raise BadInput("--every", every, "must be a whole number, at least 1; 1 shows every step")
    return Options(arguments.cycles, None if every is None else int(every), arguments.meshes)


def _is_kept(folder: Path) -> bool:
    """Whether a run, which must be readable, has its recording; raises BadRun."""
    manifests.read(folder)
    return is_regular(folder / RECORDING_FILE)


def build_missing(folders: Sequence[Path], anew: bool) -> list[Path]:
    """Build recordings that are missing, or all ``anew``; the runs that can be shown. Raises BadRun."""
    kept = set()
    for folder in folders:
        with suppress(BadRun):  # reported when its recording is built
            if not anew and _is_kept(folder):
                kept.add(folder)
    ready, faults = [], []
    with show_activity(f"building {len(folders) - len(kept)} recordings"):
        for folder in folders:
            try:
                if folder not in kept:
                    rebuild(folder, folder / RECORDING_FILE, Options())
                ready.append(folder)
            except BadRun as error:
                faults.append(str(error))
    for fault in faults:
        print_line(f"left out: {fault}", error=True)
    if not ready:
        raise BadRun(f"{folders[0]}: no run can be shown")
    return ready


def _show_table(folders: Sequence[Path], arguments: argparse.Namespace) -> int:
    """Show runs as a table whose rows open their recordings."""
    require_extra("datafusion")
    from cmacexp.config.describe import differences
    from cmacexp.recording.catalog import serve_catalog

    ready = build_missing(folders, arguments.rebuild)
    keys = dict.fromkeys(
        key for each in differences([manifests.read(run)["config"] for run in ready]) for key in each
    )
    with serve_catalog([folder / RECORDING_FILE for folder in ready], list(keys), HOST) as (address, _):
        print_line(
            f"{len(ready)} of {len(folders)} runs in a table, by {', '.join(keys) or 'nothing in which they differ'}"
        )
        return 0 if arguments.no_viewer else serve_web(address) if arguments.web else open_window(address)


def _replay(arguments: argparse.Namespace) -> int:
    options = _read_options(arguments)
    if arguments.web and arguments.no_viewer:
        raise BadInput("--no-viewer", True, "contradicts --web; leave out one")
    found = {run.resolve(): run for given in arguments.folders for run in runs_below(given)}
    folders = list(found.values())
    if not (arguments.web or arguments.no_viewer):
        require_display()
    if arguments.table:
        for name in ("cycles", "every", "meshes", "out"):
            if value := getattr(arguments, name):
                raise BadInput(f"--{name}", value, "does not go with --table, which shows the recordings of the runs")
        return _show_table(folders, arguments)
    if arguments.meshes:
        from cmacexp.recording.meshes import read_shown_model

        for run in folders:
            read_shown_model(run, manifests.read(run))
    out = _out(arguments.out) if arguments.out is not None else None
    path = out or (_comparison_path(folders) if len(folders) > 1 else folders[0] / RECORDING_FILE)
    kept = len(folders) == 1 and out is None and options == Options() and not arguments.rebuild
    if kept and _is_kept(folders[0]):
        shown = "as it was built; --rebuild builds it anew"
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        old = "; it replaces the one that was there" if arguments.meshes and path.exists() else ""
        with show_activity(f"building {path}"):
            shown = compare(folders, path, options) if len(folders) > 1 else rebuild(folders[0], path, options)
        shown += old
    print_line(f"{path}: {shown}")
    return 0 if arguments.no_viewer else serve_web(path) if arguments.web else open_window(path)


def main() -> int:
    """Run the command."""
    description = "Show a run in the Rerun viewer, or several side by side. A missing recording is built from "
    description += "the trace; --cycles, --every and --meshes build it anew."
    parser = Parser("cmacexp.replay", description, folders=True)
    flag = partial(parser.add_argument, action="store_true")
    flag("--no-viewer", help="only build the recording")
    flag("--web", help="serve the viewer for a browser of this machine, until Ctrl-C, instead of opening a window")
    flag("--table", help="show a table of the runs, to filter by config and metrics; a row opens its recording")
    flag("--rebuild", help="build the recording of a run even if it exists, with all cycles")
    flag("--meshes", help="draw robots as their models show them, if these are still those of the runs")
    text = "a window: 3-5 (from the third to the fifth), 7 (only the seventh), last, last5 (that all runs took)"
    parser.add_argument("--cycles", metavar="CYCLES", help=text)
    text = "show one step in N; unless given, all of a short run, fewer of a long one"
    parser.add_argument("--every", metavar="N", help=text)
    text = "where the recording goes; unless given, recording.rrd in the folder of a run, "
    text += f"{COMPARISONS}/NAMES.rrd for several"
    parser.add_argument("--out", metavar="FILE.rrd", help=text)
    return run_command(lambda: _replay(parser.parse_args()))
