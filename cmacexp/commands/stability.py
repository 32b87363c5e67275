"""``python -m cmacexp.stability DIR...``: whether the learning of a run holds, why, and with which lead it would."""

import argparse
import sys
from contextlib import suppress
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


def _check(arguments: argparse.Namespace) -> None:
    """Check what is asked for beyond the analysis.

    Raises:
        BadInput: a value is outside its range.
    """
    ends, rates, share = arguments.leads or (0, 0), arguments.rates or (), arguments.robust
    if not -100 <= ends[0] <= ends[1] <= 100:
        raise BadInput("--leads", arguments.leads, "must be the first and the last lead, from -100 to 100 samples")
    if not all(0.0 < rate < 2.0 for rate in rates):
        raise BadInput("--rates", rates, "must be above 0 and below 2")
    if share is not None and not 0.0 < share < 1.0:
        raise BadInput("--robust", share, "must be above 0 and below 1")


def numbers(text: str) -> list[float]:
    """Numbers separated by commas."""
    return [float(word) for word in text.split(",")]


def _analyse(arguments: argparse.Namespace) -> int:
    from cmacexp.report.terminal import announce_compiling
    from cmacexp.stability.analysis import analyse, read_learning
    from cmacexp.stability.corners import judge_corners
    from cmacexp.stability.cycle_map import NotPredictable
    from cmacexp.stability.further import Further
    from cmacexp.stability.growth_map import map_growth
    from cmacexp.stability.page import TITLES, conclude, describe, rows, write_stability_report
    from cmacexp.stability.verdict import assess

    _check(arguments)
    leads, rates, share = arguments.leads, arguments.rates, arguments.robust
    announce_compiling()
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    for folder in folders:
        analysis = None
        with activity(f"analysing {folder}"):
            run, further = StoredRun(folder), Further()
            verdict = assess(read_learning(run))
            with suppress(NotPredictable):  # the verdict is undecided, and says why
                analysis = analyse(run)
            if analysis is not None:
                further = Further(
                    map_growth(analysis.config, analysis.own.place.calm, leads, rates) if leads or rates else None,
                    judge_corners(analysis.config, share) if share else (),
                )
            path = write_stability_report(run, verdict, analysis, out or require_no_link(folder / FOLDER), further)
        say(describe(verdict))
        if analysis is not None:
            print_table([title.replace(" ", "\n", 1) for title in TITLES], rows(analysis))
            say(conclude(analysis))
        further.print()
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
    mapped = "map growth over these leads, in samples, or rates; the others are by default around the run's own"
    parser.add_argument("--leads", metavar=("FIRST", "LAST"), nargs=2, type=int, help=mapped)
    parser.add_argument("--rates", metavar="R,R,...", type=numbers, help="see --leads")
    robust = "judge learning with stiffness and masses smaller and larger by this share, e.g. 0.5"
    parser.add_argument("--robust", metavar="SHARE", type=float, help=robust)
    return run_command(lambda: _analyse(parser.parse_args()))


if __name__ == "__main__":
    sys.exit(main())
