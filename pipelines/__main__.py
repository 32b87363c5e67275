"""``python -m pipelines``: list studies or run one; ``status``: show their state; ``--write-docs``: renew pages."""

import sys
from pathlib import Path

from cmacexp.addons.study.command import FOLDER
from cmacexp.addons.study.command import main as run_study
from cmacexp.commands.command import Arguments, OptionTable, Parser, make_flag
from cmacexp.errors import require
from pipelines.benchmark.__main__ import main as run_benchmark
from pipelines.benchmark.benchmark import BENCHMARK
from pipelines.groups import GROUPS, every_study, find_study, run_group
from pipelines.results import (
    CHANGED,
    PAGES,
    RESULTS_FILE,
    find_outdated,
    read_results,
    renew_stored_rows,
)

STATUS = "status"
SHOWN_FILES = 3
"""Number of changed files of a study that ``status`` names."""


def write_docs() -> None:
    """Renew results.json, the generated blocks of pages and the pages of studies; print sentences that disagree.

    Raises:
        BadInput: the working copy has no results.json.
    """
    results = read_results()
    from docs.blocks import write_pages  # a checkout has it, as the results; a wheel does not
    from docs.study_tables import write_scores

    results.add_studies(FOLDER)
    renew_stored_rows(FOLDER)
    write_scores(FOLDER)
    write_pages(results)
    for line in find_outdated(results.sentences, {p.name: p.read_text("utf-8") for p in PAGES}, results.statements):
        print(line)
    RESULTS_FILE.write_text(results.format(), encoding="utf-8")


def print_status(witnesses: bool) -> None:
    """Print for each study if its stored results belong to its current code.

    With ``witnesses``, first rerun the witnesses of every changed study, and note in results.json those with equal
    values.
    """
    results = read_results()
    for file in every_study():
        if witnesses and results.find_state(file.name).state == CHANGED:
            for line in results.confirm(file.name):
                print(f"{file.name}: {line}", file=sys.stderr)
            RESULTS_FILE.write_text(results.format(), encoding="utf-8")
        state, date, reasons, confirmed = results.find_state(file.name)
        more = f" and {len(reasons) - SHOWN_FILES} more" if len(reasons) > SHOWN_FILES else ""
        changed = f": {', '.join(reasons[:SHOWN_FILES])}{more}" if reasons else ""
        same = f" (its witnesses gave the same values on {confirmed}); changed" if confirmed else ""
        print(f"{file.name:24} {date:10} {state}{same}{changed}")


OPTIONS: OptionTable = {
    "what": {"nargs": "?", "metavar": STATUS, "help": "list each study as current, changed or never run"},
    "--write-docs": make_flag(
        f"renew results.json from full studies in {FOLDER}, and the tables of the documentation"
    ),
    "--witnesses": make_flag(f"with {STATUS}: rerun two runs of each changed study and compare their values"),
}


def _run(arguments: Arguments) -> None:
    if arguments.write_docs:
        write_docs()
    elif arguments.what == STATUS:
        print_status(arguments.witnesses)
    else:
        for name, group in GROUPS.items():
            print(f"python -m pipelines.{name}\n    {group.title}: {group.question}\n    {', '.join(group.studies)}")
        for file in every_study()[:-1]:
            print(f"python -m pipelines.{file.name}\n    {file.study.title}: {file.study.question}")
        require(arguments.what is None, "study", arguments.what, "no such study; choose one of this list")


def main() -> int:
    """Run a study, a group or the benchmark; or list studies or their state; or renew pages. Return the exit code."""
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    if Path(word).suffix in (".py", ".yaml"):
        run_study()
    if (path := find_study(word)) is None and word not in (BENCHMARK, *GROUPS):
        return Parser("pipelines", "List the studies.", OPTIONS).run(_run)
    del sys.argv[1]
    if path is not None:
        run_study(str(path))
    return run_benchmark() if word == BENCHMARK else run_group(word)


if __name__ == "__main__":
    sys.exit(main())
