"""``python -m cmacexp.stability DIR...``: whether the learning of a run holds, why, and with which lead it would."""

import argparse
from pathlib import Path

from cmacexp.commands.command import Parser, run_command
from cmacexp.config.fields import check_like
from cmacexp.config.schema import LearningConfig
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
    leads = arguments.leads or [0, 0]
    check_like("--leads", leads, LearningConfig, "lead")
    check_like("--rates", arguments.rates or [], LearningConfig, "rate")
    if leads[0] > leads[1]:
        raise BadInput("--leads", leads, "must be the first and the last lead")


def _read_numbers(text: str) -> list[float]:
    """Numbers separated by commas."""
    return [float(word) for word in text.split(",")]


def _analyse(arguments: argparse.Namespace) -> int:
    from cmacexp.report.terminal import announce_compiling

    _check(arguments)
    announce_compiling()
    folders = list(dict.fromkeys(run for given in arguments.folders for run in runs_below(given)))
    if arguments.out is not None and len(folders) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(folders)} were given")
    out = None if arguments.out is None else require_place("--out", Path(arguments.out))
    for folder in folders:
        _analyse_run(StoredRun(folder), out or require_no_link(folder / FOLDER), arguments)
    return 0


def _analyse_run(run: StoredRun, out: Path, arguments: argparse.Namespace) -> None:
    """Write the verdict on a run, and whatever else is asked for or says why not."""
    from cmacexp.stability.analysis import analyse, read_learning
    from cmacexp.stability.cycle_map import NotPredictable
    from cmacexp.stability.growth_map import map_growth
    from cmacexp.stability.page import TITLES, Findings, advise, rows, write_stability_report
    from cmacexp.stability.verdict import assess

    leads, rates, notes = arguments.leads, arguments.rates, list[str]()
    analysis = growth_map = None
    with activity(f"analysing {run.folder}"):
        config = read_learning(run)
        verdict = assess(config)
        try:
            analysis = analyse(config, verdict)
            notes += advise(analysis)
            if leads or rates:
                growth_map = map_growth(config, analysis.growth.cycle, leads, rates)
        except NotPredictable as error:
            missing = ["analysis"] * (analysis is None) + ["map of leads and rates"] * bool(leads or rates)
            if missing != ["analysis"] or f"{error}." not in verdict.reasons:
                notes.append(f"No {' and no '.join(missing)}: {error}.")
        path = write_stability_report(run, Findings(verdict, analysis, growth_map, notes), out)
    say(verdict.describe())
    if analysis is not None:
        print_table([title.replace(" ", "\n", 1) for title in TITLES], rows(analysis))
    for line in notes:
        say(line)
    if growth_map is not None:
        print_table(*growth_map.tabulate())
        say(f"Growth per cycle; * is this run. {growth_map.summarise()}")
    say(str(path))


def main() -> int:
    """Run the command."""
    description = (
        "Linearise the loop of runs, predict how their learning grows from cycle to cycle with each lead, compare "
        "the prediction with the measurement, and explain it; as one HTML page with figures."
    )
    parser = Parser("cmacexp.stability", description, folders=True)
    parser.add_argument("--out", metavar="FOLDER", help=f"where the page goes; unless given, {FOLDER} in DIR")
    mapped = "map growth over leads, in samples, and rates; by default leads around the run's own and fixed rates"
    parser.add_argument("--leads", metavar=("FIRST", "LAST"), nargs=2, type=int, help=mapped)
    parser.add_argument("--rates", metavar="R,R,...", type=_read_numbers, help="see --leads")
    return run_command(lambda: _analyse(parser.parse_args()))
