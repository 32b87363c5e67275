"""``python -m cmacexp.stability DIR...``: whether the learning of a run holds, why, and with which lead it would."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cmacexp.commands.command import Parser, run_command
from cmacexp.data.discovery import require_place, runs_below
from cmacexp.data.folder import require_no_link
from cmacexp.data.stored_run import StoredRun
from cmacexp.errors import BadInput
from cmacexp.report.terminal import activity, say
from cmacexp.report.terminal_tables import print_table

if TYPE_CHECKING:
    from cmacexp.stability.page import Further

FOLDER = "stability"
"""Folder of the page, in that of the run."""


def _read_rates(text: str | None) -> list[float] | None:
    """Rates separated by commas.

    Raises:
        BadInput: they are not numbers between 0 and 2.
    """
    if text is None:
        return None
    try:
        rates = [float(word) for word in text.split(",")]
    except ValueError:
        rates = []
    if not rates or not all(0.0 < rate < 2.0 for rate in rates):
        raise BadInput("--rates", text, "must be numbers above 0 and below 2, separated by commas: 0.05,0.1,0.2")
    return rates


def _read_leads(ends: list[int] | None) -> range | None:
    """All leads from the first to the last.

    Raises:
        BadInput: the first is above the last, or one is beyond the leads of a config.
    """
    if ends is None:
        return None
    if not -100 <= ends[0] <= ends[1] <= 100:
        raise BadInput("--leads", ends, "must be the first and the last lead in samples, from -100 to 100: -2 4")
    return range(ends[0], ends[1] + 1)


def _read_share(share: float | None) -> float | None:
    """The share by which stiffness and masses differ.

    Raises:
        BadInput: it is not between 0 and 1.
    """
    if share is not None and not 0.0 < share < 1.0:
        raise BadInput("--robust", share, "must be a share above 0 and below 1: 0.5")
    return share


def _print_further(further: "Further") -> None:
    from cmacexp.stability.corners import summarise

    if further.growth_map is not None:
        print_table(further.growth_map.titles, further.growth_map.rows)
        say(f"Growth per cycle; * is this run. {further.growth_map.summarise()}")
    for corner in further.corners:
        say(corner.describe())
    if further.corners:
        say(summarise(further.corners))


def _analyse(arguments: argparse.Namespace) -> int:
    from cmacexp.report.terminal import announce_compiling
    from cmacexp.stability.analysis import analyse
    from cmacexp.stability.corners import judge_corners
    from cmacexp.stability.growth_map import map_growth
    from cmacexp.stability.page import TITLES, Further, rows, verdict, write_stability_report

    leads, rates, share = _read_leads(arguments.leads), _read_rates(arguments.rates), _read_share(arguments.robust)
    announce_compiling()
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    for folder in folders:
        with activity(f"analysing {folder}"):
            analysis = analyse(StoredRun(folder))
            calm = analysis.own.place.calm
            growth_map = map_growth(analysis.config, calm, leads, rates) if leads or rates else None
            further = Further(growth_map, judge_corners(analysis.config, share) if share else ())
            path = write_stability_report(analysis, out or require_no_link(folder / FOLDER), further)
        print_table([title.replace(" ", "\n", 1) for title in TITLES], rows(analysis))
        say(verdict(analysis))
        _print_further(further)
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
    leads = "growth over these leads, in samples, and the rates"
    parser.add_argument("--leads", metavar=("FIRST", "LAST"), nargs=2, type=int, help=leads)
    parser.add_argument("--rates", metavar="R,R,...", help="growth over these rates and the leads")
    robust = "whether learning holds where stiffness and masses are smaller and larger by this share, e.g. 0.5"
    parser.add_argument("--robust", metavar="SHARE", type=float, help=robust)
    return run_command(lambda: _analyse(parser.parse_args()))


if __name__ == "__main__":
    sys.exit(main())
