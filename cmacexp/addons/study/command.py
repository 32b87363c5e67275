"""``cmacexp study``: runs a study and writes its report."""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from cmacexp.addons.study.collect import Collected, Workers, ensure_runs
from cmacexp.addons.study.page import (
    Evaluated,
    check_page,
    count_verdicts,
    evaluate,
    evidence_of,
    format_text,
    write_page,
)
from cmacexp.addons.study.provenance import choose_witnesses, digest_study, make_provenance
from cmacexp.addons.study.results import Results, read_row
from cmacexp.addons.study.statements import Claim, Finding
from cmacexp.addons.study.study import Request
from cmacexp.addons.study.study_file import StudyFile, load_study
from cmacexp.commands.command import Arguments, OptionTable, Parser, make_flag
from cmacexp.data.folder import new_result
from cmacexp.data.manifest import REPORT, require_place
from cmacexp.data.own_files import HTML
from cmacexp.data.run import Run
from cmacexp.engine.launcher import Launcher, start_study_launcher
from cmacexp.engine.workers import start_workers
from cmacexp.errors import BadInput
from cmacexp.terminal.output import print_line
from cmacexp.typing import RESULTS

FOLDER = Path("outputs/studies")
FOLDER_KEY = "--folder"
SEEDS = 5
WORKERS = 8
Measured = Mapping[Path, Mapping[str, float]]
"""Measures of each run, by its folder."""


@dataclass(frozen=True)
class Options:
    """How studies are to be run."""

    folder: Path = FOLDER
    """Folder of the reports and runs of all studies."""
    quick: bool = False
    seeds: int = SEEDS
    """Seeds of each run that depends on its seed; a quick study takes one."""
    launcher: str | None = None
    """Launcher of Hydra, whose tasks do the runs; None: processes on all cores."""
    workers: int | None = None
    """Tasks of that launcher, or processes; None: so many as there are cores, or ``WORKERS`` tasks."""
    settings: Sequence[str] = ()
    """Settings of its config, such as ``timeout_min=600``."""

    def choose_folder(self, name: str) -> Path:
        """Choose the folder of a report: one that concludes nothing does not replace one that does."""
        return self.folder / f"{name}{'-quick' if self.quick else '-one-seed' if self.seeds == 1 else ''}"

    @contextmanager
    def start_workers(self) -> Iterator[Workers]:
        """Start processes here, and tasks of the launcher, if there is one, for the runs."""
        with start_workers(None if self.launcher else self.workers) as executor:
            here = Launcher(executor, lambda runs: 1)
            if self.launcher is None:
                yield Workers(here, here)
                return
            tasks = self.workers or WORKERS
            with start_study_launcher(self.launcher, self.settings, tasks, self.folder / "tasks") as long:
                yield Workers(here, long)

    def expand(self, requests: Sequence[Request]) -> list[Request]:
        """A request for each seed."""
        numbers = range(1 if self.quick else self.seeds)
        return [request.with_seed(seed) for request in requests for seed in (numbers if request.seeded else [0])]


def _measure_run(path: Path, folder: Path) -> dict[str, float]:
    """The measures of one run of a study, by name; NaN of a run that failed."""
    run, measures = Run(folder), load_study(path).study.measures
    failed = run.status not in RESULTS
    return {name: math.nan if failed else float(measure(run)) for name, measure in measures.items()}


def _write(
    path: Path, requests: Sequence[Request], collected: Collected, measured: Measured, options: Options
) -> Evaluated:
    """Evaluate one study and write its own page."""
    file = load_study(path)
    keys = list(
        dict.fromkeys(text.partition("=")[0].lstrip("+") for request in requests for text in request.overrides)
    )
    rows = {}  # the same run with the same labels is one value of a sample, however often it was asked for
    for request in requests:
        run, choices = collected[request]
        row = read_row(run, request.labels, choices, keys, measured[run], request.seeded)
        rows[run, repr(sorted(request.labels.items()))] = row
    results = Results([*rows.values()])
    results = Results(results.rows, {name: compute(results) for name, compute in file.study.computed.items()})
    witnesses = choose_witnesses(results, {collected[r][0]: r.overrides for r in requests if r.starts_from is None})
    provenance = make_provenance(digest_study(path), results, witnesses, options.seeds)
    return write_results(file, results, options.choose_folder(file.name), options.quick, provenance, {})


def write_results(
    file: StudyFile,
    results: Results,
    folder: Path,
    quick: bool,
    provenance: Mapping[str, Any],
    texts: Mapping[str, str],
) -> Evaluated:
    """Evaluate the results of a study, and write its page into ``folder``, with further ``texts`` by file name."""
    with new_result(folder, FOLDER_KEY, REPORT) as place:
        evaluated = replace(evaluate(file, results, place.part, quick), provenance=provenance)
        for name, text in texts.items():
            place.write_text(name, text)
        write_page(file.study.title, file.study.question, [evaluated], place, quick)
    return evaluated


def write_studies(files: Sequence[StudyFile], options: Options) -> list[Evaluated]:
    """Make the runs of studies that are missing, and measures, claims and a page of each."""
    for file in files:
        check_page(file)
    requests = {file.path: options.expand(file.study.runs(options.quick)) for file in files}
    with options.start_workers() as workers:
        collected = ensure_runs(workers, [r for own in requests.values() for r in own], options.folder / "runs")
        runs = {path: list(dict.fromkeys(collected[request][0] for request in own)) for path, own in requests.items()}
        asked = [(file.path, run) for file in files if file.study.measures for run in runs[file.path]]
        measured = dict(zip(asked, workers.here.map_in_order("measuring", _measure_run, asked), strict=True))
        items = [
            (
                path,
                own,
                {request: collected[request] for request in own},
                {run: measured.get((path, run), {}) for run in runs[path]},
                options,
            )
            for path, own in requests.items()
        ]
        return workers.here.map_in_order("evaluating", _write, items)


def write_study(file: StudyFile, options: Options) -> Path:
    """Run one study and write its report; returns the page."""
    print_statements(write_studies([file], options))
    return options.choose_folder(file.name) / HTML


def print_statements(studies: Sequence[Evaluated]) -> None:
    """Print the claims of studies with their evidence and the count of verdicts, then the sentences of findings."""
    judged = [each for study in studies for each in study.statements.values()]
    claims = [each for each in judged if isinstance(each.statement, Claim)]
    for each in claims:
        print(format_text(each.sentence, evidence_of(each)), end="\n\n")
    if claims:
        print(format_text(count_verdicts([each.verdict for each in claims])), end="\n\n")
    for each in judged:
        if isinstance(each.statement, Finding):
            print(format_text(f"- {each.sentence}"))


def _read_count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number, at least 1")
    return int(text)


SEEDED: OptionTable = {
    "--seeds": {
        "type": _read_count,
        "metavar": "N",
        "help": f"seeds of each run that depends on its seed (default: {SEEDS})",
    },
}
"""Option of studies whose runs can be repeated for other seeds."""


def run_studies(
    name: str, description: str, work: Callable[[Arguments, Options], Path], own: OptionTable = SEEDED
) -> NoReturn:
    """Run the command ``name`` of studies, and exit; it has the options of every study, its ``own`` after the first.

    ``work`` writes the reports and returns the page to open.
    """

    def run(arguments: Arguments) -> None:
        if arguments.setting and arguments.launcher is None:
            raise BadInput("--setting", arguments.setting[0], "is of a launcher: add --launcher NAME")
        folder, chosen = require_place(FOLDER_KEY, arguments.folder), (arguments.launcher, arguments.workers)
        options = Options(folder, arguments.quick, arguments.seeds, *chosen, arguments.setting)
        print_line(str(work(arguments, options)))

    parser = Parser(
        name,
        description,
        {
            "--quick": make_flag("fewer and shorter runs that only check the machinery"),
            **own,
            "--folder": {"type": Path, "default": FOLDER, "help": f"reports and runs of all studies ({FOLDER})"},
            "--launcher": {"metavar": "NAME", "help": "of Hydra, for the runs (default: all cores here)"},
            "--workers": {
                "type": _read_count,
                "metavar": "N",
                "help": f"processes (default: one for each core), or tasks of that launcher (default: {WORKERS})",
            },
            "--setting": {
                "action": "append",
                "default": [],
                "metavar": "KEY=VALUE",
                "help": "of its config, as often as needed: --setting timeout_min=600",
            },
        },
    )
    parser.set_defaults(seeds=SEEDS)
    sys.exit(parser.run(run, "; the same command runs what is missing"))


def main(path: str | None = None) -> NoReturn:
    """``python -m cmacexp.study FILE.py``; with ``path``, the command of the study in that file."""
    if path is not None:
        file = load_study(Path(path))
        name, question = f"pipelines.{file.name}", file.study.question
        run_studies(name, question, lambda _, options: write_study(file, options))
    run_studies(
        "cmacexp.study",
        "Run a study and write its report.",
        lambda arguments, options: write_study(load_study(arguments.file), options),
        {**SEEDED, "file": {"type": Path, "metavar": "FILE.py", "help": "defines STUDY; its page stands beside it"}},
    )
