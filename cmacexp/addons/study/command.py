"""The command ``cmacexp study``, which runs a study and writes its report."""

import argparse
import itertools
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
from cmacexp.addons.study.stored_rows import STORED_ROWS, store_rows
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
    """Options of the command: folder, size and launcher of studies."""

    folder: Path = FOLDER
    """Folder of the reports and runs of all studies."""
    quick: bool = False
    seeds: int = SEEDS
    """Number of seeds of each run that depends on its seed; a quick study uses one."""
    launcher: str | None = None
    """Hydra launcher whose tasks execute the runs; None: local processes."""
    workers: int | None = None
    """Number of local processes, or of launcher tasks; None: one process per core, or ``WORKERS`` tasks."""
    settings: Sequence[str] = ()
    """Settings of the launcher config, such as ``timeout_min=600``."""

    def choose_folder(self, name: str) -> Path:
        """Choose the folder of a report, so that a quick or one-seed study does not replace a full one."""
        return self.folder / f"{name}{'-quick' if self.quick else '-one-seed' if self.seeds == 1 else ''}"

    @contextmanager
    def start_workers(self) -> Iterator[Workers]:
        """Start local processes and, if a launcher is set, its tasks for the runs."""
        with start_workers(None if self.launcher else self.workers) as executor:
            here = Launcher(executor, lambda runs: 1)
            if self.launcher is None:
                yield Workers(here, here)
                return
            tasks = self.workers or WORKERS
            with start_study_launcher(self.launcher, self.settings, tasks, self.folder / "tasks") as long:
                yield Workers(here, long)

    def expand(self, requests: Sequence[Request]) -> list[Request]:
        """Return one request per seed for each seeded request, and the other requests once."""
        numbers = range(1 if self.quick else self.seeds)
        return [request.with_seed(seed) for request in requests for seed in (numbers if request.seeded else [0])]


def _measure_run(path: Path, folder: Path) -> dict[str, float]:
    """Compute the measures of the study in the file ``path`` for one run, by name; NaN if the run failed."""
    run = Run(folder)
    measures = load_study(path).study.measures
    failed = run.status not in RESULTS
    return {name: math.nan if failed else float(measure(run)) for name, measure in measures.items()}


def _write(
    path: Path, requests: Sequence[Request], collected: Collected, measured: Measured, options: Options
) -> Evaluated:
    """Evaluate one study and write its page."""
    file = load_study(path)
    keys = list(
        dict.fromkeys(text.partition("=")[0].lstrip("+") for request in requests for text in request.overrides)
    )
    rows = {}  # a run requested several times with the same labels must count once in a sample
    for request in requests:
        run, choices = collected[request]
        row = read_row(run, request.labels, choices, keys, measured[run], request.seeded)
        rows[run, repr(sorted(request.labels.items()))] = row
    results = Results([*rows.values()])
    results = Results(results.rows, {name: compute(results) for name, compute in file.study.computed.items()})
    witnesses = choose_witnesses(results, {collected[r][0]: r.overrides for r in requests if r.starts_from is None})
    provenance = make_provenance(digest_study(path), results, witnesses, options.seeds)
    texts = {STORED_ROWS: store_rows(file.study.statements, results)}
    return write_results(file, results, options.choose_folder(file.name), options.quick, provenance, texts)


def write_results(
    file: StudyFile,
    results: Results,
    folder: Path,
    quick: bool,
    provenance: Mapping[str, Any],
    texts: Mapping[str, str],
) -> Evaluated:
    """Evaluate the results of a study and write its page into ``folder``, with further ``texts`` by file name."""
    with new_result(folder, FOLDER_KEY, REPORT) as writer:
        evaluated = replace(evaluate(file, results, writer.part, quick), provenance=provenance)
        for name, text in texts.items():
            writer.write_text(name, text)
        write_page(file.study.title, file.study.question, [evaluated], writer, quick)
    return evaluated


def write_studies(files: Sequence[StudyFile], options: Options) -> list[Evaluated]:
    """Execute the missing runs of studies, evaluate each study and write its page."""
    for file in files:
        check_page(file)
    requests = {file.path: options.expand(file.study.runs(options.quick)) for file in files}
    with options.start_workers() as workers:
        all_requests = list(itertools.chain.from_iterable(requests.values()))
        collected = ensure_runs(workers, all_requests, options.folder / "runs")
        runs = {path: list(dict.fromkeys(collected[r][0] for r in of_study)) for path, of_study in requests.items()}
        to_measure = [(file.path, run) for file in files if file.study.measures for run in runs[file.path]]
        measures = workers.here.map_in_order("measuring", _measure_run, to_measure)
        measured = dict(zip(to_measure, measures, strict=True))
        items = [
            (
                path,
                of_study,
                {request: collected[request] for request in of_study},
                {run: measured.get((path, run), {}) for run in runs[path]},
                options,
            )
            for path, of_study in requests.items()
        ]
        return workers.here.map_in_order("evaluating", _write, items)


def write_study(file: StudyFile, options: Options) -> Path:
    """Run one study, print its statements and write its report; returns the path of the page."""
    print_statements(write_studies([file], options))
    return options.choose_folder(file.name) / HTML


def print_statements(studies: Sequence[Evaluated]) -> None:
    """Print the claims of studies with their evidence and the number of claims per verdict, then the findings."""
    results = [result for study in studies for result in study.statements.values()]
    claims = [result for result in results if isinstance(result.statement, Claim)]
    for claim in claims:
        print(format_text(claim.sentence, evidence_of(claim)), end="\n\n")
    if claims:
        print(format_text(count_verdicts([claim.verdict for claim in claims])), end="\n\n")
    for result in results:
        if isinstance(result.statement, Finding):
            print(format_text(f"- {result.sentence}"))


def _read_count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number, at least 1")
    return int(text)


SEEDED: OptionTable = {
    "--seeds": {
        "type": _read_count,
        "metavar": "N",
        "help": f"number of seeds of each run that depends on its seed (default: {SEEDS})",
    },
}
"""Option of studies whose runs can be repeated with other seeds."""


def run_studies(
    name: str, description: str, work: Callable[[Arguments, Options], Path], study_options: OptionTable = SEEDED
) -> NoReturn:
    """Parse the arguments of the command ``name``, run its studies and exit.

    ``work`` writes the reports and returns the page to open. The help lists ``study_options`` after the first of the
    options that all studies share.
    """

    def run(arguments: Arguments) -> None:
        if arguments.setting and arguments.launcher is None:
            raise BadInput("--setting", arguments.setting[0], "is of a launcher: add --launcher NAME")
        options = Options(
            require_place(FOLDER_KEY, arguments.folder),
            arguments.quick,
            arguments.seeds,
            arguments.launcher,
            arguments.workers,
            arguments.setting,
        )
        print_line(str(work(arguments, options)))

    parser = Parser(
        name,
        description,
        {
            "--quick": make_flag("fewer and shorter runs, which only check that the study works"),
            **study_options,
            "--folder": {
                "type": Path,
                "default": FOLDER,
                "help": f"folder of the reports and runs of all studies (default: {FOLDER})",
            },
            "--launcher": {"metavar": "NAME", "help": "Hydra launcher to use (default: local processes)"},
            "--workers": {
                "type": _read_count,
                "metavar": "N",
                "help": f"number of processes (default: one per core), or of launcher tasks (default: {WORKERS})",
            },
            "--setting": {
                "action": "append",
                "default": [],
                "metavar": "KEY=VALUE",
                "help": "setting of the launcher config, such as timeout_min=600; can be repeated",
            },
        },
    )
    parser.set_defaults(seeds=SEEDS)
    sys.exit(parser.run(run, "; the same command runs what is missing"))


def main(path: str | None = None) -> NoReturn:
    """Run ``python -m cmacexp.study FILE.py``; with ``path``, run the command of the study in that file."""
    if path is not None:
        file = load_study(Path(path))
        run_studies(f"pipelines.{file.name}", file.study.question, lambda _, options: write_study(file, options))
    run_studies(
        "cmacexp.study",
        "Run a study and write its report.",
        lambda arguments, options: write_study(load_study(arguments.file), options),
        {
            **SEEDED,
            "file": {
                "type": Path,
                "metavar": "FILE.py",
                "help": "Python file that defines STUDY, with its page FILE.md beside it",
            },
        },
    )
