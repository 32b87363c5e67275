"""``python -m pipelines``: lists the studies; with ``--write-docs``, renews what the documentation quotes of them."""

import argparse
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmacexp.commands.command import COMPLETED, Parser, run_command
from cmacexp.commands.study import FOLDER
from cmacexp.data.parquet import read_table
from cmacexp.errors import BadInput
from cmacexp.study.page import CLAIMS
from cmacexp.study.study import load_study
from pipelines.benchmark.benchmark import NAME as BENCHMARK
from pipelines.benchmark.benchmark import QUESTION, TITLE
from pipelines.benchmark.summary import write_scores

PIPELINES = Path(__file__).resolve().parent
DOCS = PIPELINES.parent / "docs"
PAGES = (PIPELINES.parent / "README.md", *sorted(DOCS.glob("*.md")))
"""What may quote the studies."""
QUOTED = DOCS / "results.json"
"""Of the last full studies; ``4.87 %<!--one_leg_learning.bias 0-->`` quotes a first value, ``... interval 0`` its
interval, ``... verdict`` what came out."""
MARK = re.compile(r"<!--(\w+)\.([^>]+?) (\d+|verdict|interval \d+)-->")

TABLE = re.compile(r"(?<=<!-- benchmark: begin -->\n).*?(?=<!-- benchmark: end -->)", flags=re.DOTALL)
"""Where the tables of the benchmark stand."""
Quotable = Mapping[str, Mapping[str, Any]]


def read_quotable(folder: Path) -> Quotable:
    """Values and verdicts by study and statement, of every full study below ``folder``.

    Each is read from the study's own folder: a page over several studies is not renewed when one of them is.
    """
    found: dict[str, dict[str, Any]] = {}
    for path in sorted(folder.glob(f"*/{CLAIMS}")):
        study = path.parent.name
        if (statements := json.loads(path.read_text(encoding="utf-8")).get(study)) is not None:
            found[study] = {
                each["name"]: {
                    "verdict": each["verdict"],
                    "values": [c["shown"] for c in each["criteria"]],
                    "intervals": [c.get("spread") for c in each["criteria"]],  # none in pages of older versions
                }
                for each in statements
            }
    return found


def quoted(match: re.Match[str], results: Quotable) -> str:
    """What stands before a mark.

    Raises:
        KeyError: no such study or statement.
    """
    study, name, which = match.groups()
    entry = results[study][name]
    if which == "verdict":
        return str(entry[which])
    kind = "intervals" if which.startswith("interval") else "values"
    return str(entry[kind][int(which.split()[-1])])


def renew(text: str, before: Quotable, after: Quotable) -> str:
    """A page whose quotes of ``before`` are those of ``after``; a ``?`` before a mark is filled in."""
    parts, end = [], 0
    for match in MARK.finditer(text):
        own = text[end : match.start()]
        rest = own[:-1] if own.endswith("?") else own.removesuffix(quoted(match, before))
        parts += [rest, quoted(match, after), match[0]]
        end = match.end()
    return "".join([*parts, text[end:]])


def write_docs() -> None:
    """Renew the documentation from the full studies.

    Raises:
        BadInput: this is no checkout.
    """
    if not QUOTED.is_file():
        raise BadInput("--write-docs", True, f"{QUOTED} does not exist; run it from a checkout")
    before = json.loads(QUOTED.read_text(encoding="utf-8"))
    after = {**before, **read_quotable(FOLDER)}
    table = FOLDER / BENCHMARK / f"{BENCHMARK}.parquet"
    scores = write_scores(read_table(table).to_pandas()) if table.is_file() else None
    for page in PAGES:
        text = renew(page.read_text(encoding="utf-8"), before, after)
        if scores is not None:
            text = TABLE.sub(lambda _: f"{scores}\n", text)
        page.write_text(text, encoding="utf-8")
    QUOTED.write_text(json.dumps(after, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _run() -> int:
    parser = Parser("pipelines", "List the studies.")
    parser.add_argument("--write-docs", action="store_true", help=f"renew docs from the full studies in {FOLDER}")
    parser.add_argument("study", nargs="?", help=argparse.SUPPRESS)  # for who writes a blank instead of a dot
    arguments = parser.parse_args()
    if arguments.write_docs:
        write_docs()
        return COMPLETED
    names = sorted(page.stem for page in PIPELINES.glob("*.md"))
    for name in names:
        study = load_study(PIPELINES / f"{name}.py").study
        print(f"python -m pipelines.{name}\n    {study.title}: {study.question}")
    print(f"python -m pipelines.{BENCHMARK}\n    {TITLE}: {QUESTION}")
    if arguments.study is not None:
        known = arguments.study in names
        hint = f"run python -m pipelines.{arguments.study}" if known else "no such study; choose one of this list"
        raise BadInput("study", arguments.study, hint)
    return COMPLETED


def main() -> int:
    """Print the name, title and question of every study, or renew the documentation; the exit code."""
    return run_command(_run)


if __name__ == "__main__":
    sys.exit(main())
