"""``python -m pipelines``: lists the studies; with ``--write-docs``, renews what the documentation quotes of them."""

import argparse
import json
import sys

from cmacexp.commands.command import COMPLETED, Parser, run_command
from cmacexp.commands.study import FOLDER
from cmacexp.data.parquet import read_table
from cmacexp.errors import BadInput
from pipelines import paper
from pipelines.benchmark.benchmark import NAME as BENCHMARK
from pipelines.benchmark.benchmark import QUESTION, TITLE
from pipelines.benchmark.summary import write_scores
from pipelines.quotes import (
    PAGES,
    QUOTED,
    all_claims,
    all_studies,
    count_claims,
    fill,
    find_outdated,
    read_quotable,
    renew,
    with_sentences,
)


def write_docs() -> None:
    """Renew the documentation from the full studies, and say where its words disagree with them.

    Raises:
        BadInput: this is no checkout.
    """
    if not QUOTED.is_file():
        raise BadInput("--write-docs", True, f"{QUOTED} does not exist; run it from a checkout")
    before = json.loads(QUOTED.read_text(encoding="utf-8"))
    after = with_sentences({**before, **read_quotable(FOLDER)})
    scored = FOLDER / BENCHMARK / f"{BENCHMARK}.parquet"
    for page in PAGES:
        text = renew(page.read_text(encoding="utf-8"), before, after)
        text = fill(text, "claims", lambda: all_claims(after))
        text = fill(text, "count", lambda: f"\n**{count_claims(after)}**\n\n")
        if scored.is_file():
            text = fill(text, "benchmark", lambda: f"{write_scores(read_table(scored).to_pandas())}\n")
        page.write_text(text, encoding="utf-8")
        for mark in find_outdated(text, after):
            print(f"{page.name}: reword what stands before {mark}")
    QUOTED.write_text(json.dumps(after, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _run() -> int:
    parser = Parser("pipelines", "List the studies.")
    parser.add_argument("--write-docs", action="store_true", help=f"renew docs from the full studies in {FOLDER}")
    parser.add_argument("study", nargs="?", help=argparse.SUPPRESS)  # for who writes a blank instead of a dot
    arguments = parser.parse_args()
    if arguments.write_docs:
        write_docs()
        return COMPLETED
    files = all_studies()
    print(f"python -m {paper.__name__}\n    {paper.TITLE}: {paper.QUESTION}")
    for file in files:
        print(f"python -m pipelines.{file.name}\n    {file.study.title}: {file.study.question}")
    print(f"python -m pipelines.{BENCHMARK}\n    {TITLE}: {QUESTION}")
    if arguments.study is not None:
        known = arguments.study in [file.name for file in files]
        hint = f"run python -m pipelines.{arguments.study}" if known else "no such study; choose one of this list"
        raise BadInput("study", arguments.study, hint)
    return COMPLETED


def main() -> int:
    """Print the name, title and question of every study, or renew the documentation; the exit code."""
    return run_command(_run)


if __name__ == "__main__":
    sys.exit(main())
