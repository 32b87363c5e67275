"""``python -m cmacexp.verify DIR...``: which runs are intact; with ``--repeat``, whether they come out the same."""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from cmacexp.commands.command import NOT_INTACT, Parser, run_command
from cmacexp.config import Config, config_hash, to_plain
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below, require_place, runs_below
from cmacexp.data.hashes import find_fault
from cmacexp.data.integrity import RESULTS, faults
from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.data.tables import RECORDING
from cmacexp.data.weights import start_hash
from cmacexp.errors import BadInput, BadRun
from cmacexp.report.terminal import activity, announce_compiling, progress, say

NOT_COMPARED = {RECORDING: "it holds the time at which it was written"}
"""Files that are never written twice with the same bytes."""


def read_repeatable(run: StoredRun) -> Config:
    """The config of a run that can be repeated.

    Raises:
        BadRun: it has no result, its manifest is damaged, or its config is not one of this version.
        BadInput: the weights that it started from are missing or others.
    """
    if run.status not in RESULTS:
        raise BadRun(f"{run.folder}: {run.status}; only a run that {' or '.join(RESULTS)} can be repeated")
    config = read_config(run)
    if start_hash(config) != run.manifest.get("start_weights"):
        allowed = "must hold the weights that this run started from; they are missing or have changed"
        raise BadInput("learning.start_from", config.learning.start_from, allowed)
    return config


def repeat(
    run: StoredRun, config: Config, folder: Path | None, watch: Callable[[float], None]
) -> tuple[bool, list[str]]:
    """Repeat a run, and compare what it writes with what its manifest lists.

    Args:
        run: that can be repeated.
        config: its own.
        folder: of the repeated run; None: a temporary one.
        watch: as :func:`cmacexp.experiment.run.run_scenario` takes it.

    Returns:
        Whether it ended as before, with the same bytes in every file that is compared; a line for each file, and one
        for whatever else is not the same as then.

    Raises:
        BadInput: a component cannot be imported, or ``folder`` is in use.
        KeyboardInterrupt: it was interrupted.
    """
    from cmacexp.experiment.run import run_scenario

    if folder is not None and folder.exists() and any(folder.iterdir()):
        raise BadInput("--out", folder, "must be a new or an empty folder")
    with TemporaryDirectory() as temporary:
        again = run_scenario(config, folder or Path(temporary), watch)
        if again.status == "interrupted":
            raise KeyboardInterrupt
        then, now = run.manifest, again.manifest
    states = dict(_compare_files(run.folder, then["files"], now["files"]))
    same = all(state == "equal" for name, state in states.items() if name not in NOT_COMPARED)
    files = [f"{name}: {state}" for name, state in states.items()]
    other = _compare_entries(then, now, config_hash(to_plain(config)))
    return same and again.ending == run.ending, [*files, *other]


def _compare_files(folder: Path, then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """The name of each file, and how it compares with what the run wrote."""
    for name in [*then, *(name for name in now if name not in then)]:
        if name in NOT_COMPARED:
            yield name, f"not compared: {NOT_COMPARED[name]}"
        elif name not in then or name not in now:
            yield name, f"differs: written only {'now' if name in now else 'then'}"
        elif then[name] != now[name]:
            yield name, "differs"
        elif fault := find_fault(folder, name, then[name]):
            yield name, f"equal to what the run wrote, but {folder / name} is {fault}"
        else:
            yield name, "equal"


def _compare_entries(then: manifests.Manifest, now: manifests.Manifest, read_as: str) -> Iterator[str]:
    """A line for whatever may explain other bytes."""
    if then["config_hash"] != read_as:
        yield "config: this version reads it with other fields or names"
    keys = ("status", "cause", "steps", "code_hash", "git_commit", "model_hash")
    pairs = [(key, then.get(key), now.get(key)) for key in keys]
    names = {**then["versions"], **now["versions"]}
    pairs += [(name, then["versions"].get(name), now["versions"].get(name)) for name in names]
    for name, *values in pairs:
        if values[0] != values[1]:
            before, after = ("unknown" if value is None else value for value in values)
            yield f"{name}: {before} then, {after} now"


def _verify(arguments: argparse.Namespace) -> int:
    if arguments.repeat:
        return _repeat(arguments)
    if arguments.out is not None:
        raise BadInput("--out", arguments.out, "is for --repeat; add it")
    intact = True
    for folder in [result for given in arguments.folders for result in everything_below(given)]:
        with activity(f"checking {folder}"):
            reasons = faults(folder)
        intact = intact and not reasons
        state = "NOT INTACT" if reasons else f"intact ({manifests.read(folder)['status']})"
        say(f"{folder}: {state}")
        for fault in reasons:
            say(f"  {fault}")
    return 0 if intact else NOT_INTACT


def _repeat(arguments: argparse.Namespace) -> int:
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    announce_compiling()
    equal = True
    for folder in folders:
        run = StoredRun(folder)
        config = read_repeatable(run)
        with progress(f"repeating {folder}", config.cycles, "cycles") as watch:
            is_equal, lines = repeat(run, config, out, watch)
        equal = equal and is_equal
        say(f"{folder}: repeated, {'EQUAL' if is_equal else 'NOT EQUAL'}")
        for line in lines:
            say(f"  {line}")
    return 0 if equal else NOT_INTACT


def main() -> int:
    """Run the command.

    Returns:
        The exit code: 0 if all is intact, or comes out the same; 4 if something is not; 2 if there is nothing.
    """
    description = (
        "Check which runs, reports and tables of sweeps are intact: every file is present and unchanged. With "
        "--repeat, run them again from their manifests and compare the bytes of every file."
    )
    parser = Parser("cmacexp.verify", description, folders=True)
    text = "run again from the manifest, and compare what is written with what the run wrote"
    parser.add_argument("--repeat", action="store_true", help=text)
    text = "with --repeat, where the repeated run is kept; unless given, it is removed"
    parser.add_argument("--out", metavar="FOLDER", help=text)
    return run_command(lambda: _verify(parser.parse_args()))


if __name__ == "__main__":
    sys.exit(main())
