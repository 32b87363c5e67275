"""What all studies share: run what is missing, reuse what exists, write the report, print its claims."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import require_place
from cmacexp.errors import CmacexpError
from cmacexp.report.page import HTML, Claim, Report, Section, draw, write_report
from pipelines.shared.runs import Runs, collect
from pipelines.shared.state import is_up_to_date, state_key
from pipelines.shared.workers import workers

FOLDER = Path("outputs/studies")
Jobs = Mapping[str, Sequence[str]]
"""Overrides of each run that a study asks for, by the study's name for it."""


@dataclass(frozen=True)
class Study:
    """A study: what it runs, and what it reports."""

    name: str
    """That of its module in ``pipelines``."""
    title: str
    purpose: str
    """What it claims, in a sentence or two."""
    jobs: Callable[[bool], Jobs]
    """The runs, given whether it is to be quick."""
    summarise: Callable[[Runs], Sequence[Section]]
    """The sections of its report."""
    then: Callable[[bool, Runs], Jobs] | None = None
    """Further runs, which need the first ones, e.g. start from what they have learnt."""


def _print_claims(claims: Sequence[Claim]) -> None:
    from rich.console import Console
    from rich.table import Table

    if not claims:
        return
    table = Table("verdict", "the paper says", "measured here", box=None, pad_edge=False, header_style="bold")
    for claim in claims:
        table.add_row(claim.verdict, f"{claim.claim} ({claim.where})", claim.measured)
    Console(highlight=False, width=None if sys.stdout.isatty() else 160).print(table)


def _summarise(summarise: Callable[[Runs], Sequence[Section]], runs: Runs) -> tuple[list[Section], set[Path]]:
    """The sections of a study with their figures drawn, and every file that they rest on or consist of."""
    drawn = [draw(section, runs.report) for section in summarise(runs)]
    return [section for section, _ in drawn], runs.files | {file for _, files in drawn for file in files}


def write_study(studies: Sequence[Study], title: str, purpose: str, folder: Path, quick: bool) -> Path:
    """Run the studies and write one report of them into ``folder``; nothing is done again that has not changed.

    Returns:
        The HTML file.
    """
    key = state_key([study.name for study in studies], quick)
    if is_up_to_date(folder, key):
        print(f"nothing changed since it was written: {folder / HTML}")
        return folder / HTML
    with workers() as each:
        jobs = {study.name: study.jobs(quick) for study in studies}
        runs = collect(each, jobs, folder.parent / "runs")
        later = {s.name: s.then(quick, Runs(runs[s.name], folder)) for s in studies if s.then}
        if later:
            more = collect(each, later, folder.parent / "runs")
            runs |= {name: runs[name] | own for name, own in more.items()}
        (folder / manifests.NAME).unlink(missing_ok=True)  # its figures are about to change
        summaries = each(
            "drawing", _summarise, [(study.summarise, Runs(runs[study.name], folder)) for study in studies]
        )
    sections = [section for own, _ in summaries for section in own]
    files = {path for _, own in summaries for path in own}
    of_config = {run.folder: str(run.manifest["config_hash"]) for own in runs.values() for run in own.values()}
    config = {"studies": [study.name for study in studies], "quick": quick}
    report = Report(title, purpose, sections, sorted(files), config, of_config)
    path = write_report(report, folder, key)
    _print_claims(report.claims)
    print(path)
    return path


def command(name: str, purpose: str, work: Callable[[Path, bool], Path]) -> None:
    """The command line that every study has.

    Args:
        name: of the module in ``pipelines``.
        purpose: what it claims, for ``--help``.
        work: takes the folder of the report and whether to be quick.
    """
    parser = argparse.ArgumentParser(prog=f"python -m pipelines.{name}", description=purpose)
    parser.add_argument("--quick", action="store_true", help="fewer and shorter runs, into a folder of their own")
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help=f"reports and runs of all studies (default: {FOLDER})"
    )
    arguments = parser.parse_args()
    try:
        folder = require_place("--folder", arguments.folder)
        work(folder / (f"{name}-quick" if arguments.quick else name), arguments.quick)
    except KeyboardInterrupt:
        sys.exit(130)
    except (CmacexpError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, CmacexpError) else 1)


def main(study: Study) -> None:
    """Run one study from the command line."""
    command(
        study.name,
        study.purpose,
        lambda folder, quick: write_study([study], study.title, study.purpose, folder, quick),
    )
