"""``python -m cmacexp.stability DIR...``: whether the learning of a run holds, why, and with which lead it would."""

import argparse
import sys
from pathlib import Path

from cmacexp.commands.command import Parser, run_command
from cmacexp.data.discovery import require_place, runs_below
from cmacexp.data.folder import require_no_link
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput
from cmacexp.report.terminal import activity, say
from cmacexp.report.terminal_tables import print_table

FOLDER = "stability"
"""Folder of the page, in that of the run."""


def _analyse(arguments: argparse.Namespace) -> int:
    from cmacexp.report.terminal import announce_compiling
    from cmacexp.stability.analysis import analyse
    from cmacexp.stability.page import TITLES, rows, verdict, write_stability_report

    announce_compiling()
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    for folder in folders:
        with activity(f"analysing {folder}"):
            analysis = analyse(StoredRun(folder))
            path = write_stability_report(analysis, out or require_no_link(folder / FOLDER))
        print_table([title.replace(" ", "\n", 1) for title in TITLES], rows(analysis))
        say(verdict(analysis))
        say(str(path))
    return 0


def main() -> int:
    """Run the command."""
    description = (
        "Linearise the loop of runs, predict how their learning grows from cycle to cycle with each lead, compare "
        "the prediction with the measurement, and explain it; as one HTML page with figures."
    )
    parser = Parser("cmacexp.stability", description, folders=True)
    parser.add_argument("--out", metavar="FOLDER", help=f"where the page goes; unless given, {FOLDER} in DIR")
    return run_command(lambda: _analyse(parser.parse_args()))


if __name__ == "__main__":
    sys.exit(main())
