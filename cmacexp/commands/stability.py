"""``python -m cmacexp.stability DIR...``: whether the learning of a run holds, why, and with which lead it would."""

import argparse
import sys
from contextlib import suppress
from pathlib import Path

from cmacexp.commands.command import Parser, run_command
from cmacexp.data.discovery import require_place, runs_below
from cmacexp.data.folder import require_no_link
from cmacexp.data.stored_run import StoredRun, read_config
from cmacexp.errors import BadInput
from cmacexp.report.terminal import activity, say
from cmacexp.report.terminal_tables import print_table

FOLDER = "stability"
"""Folder of the page, in that of the run."""


def _analyse(arguments: argparse.Namespace) -> int:
    from cmacexp.report.terminal import announce_compiling
    from cmacexp.stability.analysis import analyse
    from cmacexp.stability.cycle_map import NotPredictable
    from cmacexp.stability.page import TITLES, conclude, describe, rows, write_stability_report
    from cmacexp.stability.verdict import assess

    announce_compiling()
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    for folder in folders:
        analysis = None
        with activity(f"analysing {folder}"):
            run = StoredRun(folder)
            verdict = assess(read_config(run))
            with suppress(NotPredictable):  # the verdict is undecided, and says why
                analysis = analyse(run)
            path = write_stability_report(run, verdict, analysis, out or require_no_link(folder / FOLDER))
        say(describe(verdict))
        if analysis is not None:
            print_table([title.replace(" ", "\n", 1) for title in TITLES], rows(analysis))
            say(conclude(analysis))
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
