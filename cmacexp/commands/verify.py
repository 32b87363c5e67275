"""``python -m cmacexp.verify DIR...``: which runs are intact; with ``--repeat``, whether they come out the same."""

import argparse
import sys
from pathlib import Path

from cmacexp.commands.command import NOT_INTACT, Parser, run_command
from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import everything_below, require_place, runs_below
from cmacexp.data.integrity import faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput
from cmacexp.report.terminal import activity, say


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
    from cmacexp.commands.repeat import read_repeatable, repeat
    from cmacexp.report.terminal import announce_compiling, progress

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
