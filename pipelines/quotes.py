"""What the documentation quotes of the last full studies: values, verdicts, sentences, and tables of statements."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cmacexp.study import Criterion
from cmacexp.study.evidence import count_verdicts, gather
from cmacexp.study.page import CLAIMS
from cmacexp.study.statements import OUTCOMES
from cmacexp.study.study import StudyFile, load_study
from pipelines.paper import STUDIES

PIPELINES = Path(__file__).resolve().parent
DOCS = PIPELINES.parent / "docs"
PAGES = (PIPELINES.parent / "README.md", *sorted(DOCS.glob("*.md")))
"""What may quote the studies."""
QUOTED = DOCS / "results.json"
"""Of the last full studies, by study and statement."""
MARK = re.compile(r"<!--(\w+)\.([^>]+?) (\d+|interval \d+|verdict|sentence|is [a-z ]+)-->")
"""``4.87 %<!--one_leg_learning.bias 0-->`` quotes a first value, ``... interval 0`` its interval, ``... verdict`` the
verdict, ``... sentence`` the sentence of a finding; ``... is no`` says for which verdict the words were written."""
MEASURED = ("values", "intervals", "counts", "verdicts")
COLUMNS = {"measured": "---", "value": "--:", "95 % interval": "--:", "n": "--:", "limit": "---", "verdict": "---"}
"""Of a table of evidence, and how they are aligned."""
Quotable = Mapping[str, Mapping[str, Any]]


def all_studies() -> list[StudyFile]:
    """Every study of this folder, by name."""
    return [load_study(page.with_suffix(".py")) for page in sorted(PIPELINES.glob("*.md"))]


def read_quotable(folder: Path) -> Quotable:
    """Values and verdicts by study and statement, of every full study below ``folder``.

    Each is read from the study's own folder: a page over several studies is not renewed when one of them is.
    """
    found: dict[str, dict[str, Any]] = {}
    for path in sorted(folder.glob(f"*/{CLAIMS}")):
        study = path.parent.name
        if (statements := json.loads(path.read_text(encoding="utf-8")).get(study)) is not None:
            found[study] = {each["name"]: _quotable(each) for each in statements}
    return found


def _quotable(statement: Mapping[str, Any]) -> dict[str, Any]:
    """An entry of results.json; pages of older versions lack what is None."""
    words, criteria = OUTCOMES if statement["kind"] == "finding" else {}, statement["criteria"]
    return {
        "verdict": statement["verdict"],
        "values": [each["shown"] for each in criteria],
        "intervals": [each.get("spread") for each in criteria],
        "counts": [each.get("count") for each in criteria],
        "verdicts": [words.get(each.get("verdict"), each.get("verdict")) for each in criteria],
    }


def with_sentences(results: Quotable) -> Quotable:
    """The results with the sentence of each finding, as it is worded today."""
    found = {study: dict(entries) for study, entries in results.items()}
    for file in all_studies():
        own = found.get(file.name, {})
        for name, finding in file.study.findings.items():
            if name in own:
                own[name] = {**own[name], "sentence": finding.sentence(own[name]["verdict"], own[name]["values"])}
    return found


def quoted(match: re.Match[str], results: Quotable) -> str:
    """What stands before a mark.

    Raises:
        KeyError: no such study or statement.
    """
    study, name, which = match.groups()
    entry = results[study][name]
    if which in ("verdict", "sentence"):
        return str(entry[which])
    if which.startswith("is "):
        return ""
    index = int(which.split()[-1])
    if which.startswith("interval"):
        return str((entry.get("intervals") or {index: None})[index] or "interval not kept")
    return str(entry["values"][index])


def find_outdated(text: str, results: Quotable) -> list[str]:
    """The marks whose words were written for another verdict, and the verdict of today."""
    found = []
    for match in MARK.finditer(text):
        study, name, which = match.groups()
        verdict = results[study][name]["verdict"]
        if which.startswith("is ") and which != f"is {verdict}":
            found.append(f"{match[0]}: it is {verdict}")
    return found


def renew(text: str, before: Quotable, after: Quotable) -> str:
    """A page whose quotes of ``before`` are those of ``after``; a ``?`` before a mark is filled in."""
    parts, end = [], 0
    for match in MARK.finditer(text):
        own = text[end : match.start()]
        rest = own[:-1] if own.endswith("?") else own.removesuffix(quoted(match, before))
        parts += [rest, quoted(match, after), match[0]]
        end = match.end()
    return "".join([*parts, text[end:]])


def fill(text: str, name: str, make: Callable[[], str]) -> str:
    """A page whose part between the marks ``name: begin`` and ``name: end`` is made anew."""
    place = re.compile(f"(?<=<!-- {name}: begin -->\n).*?(?=<!-- {name}: end -->)", flags=re.DOTALL)
    return place.sub(lambda _: make(), text)


def _rows(criteria: Sequence[Criterion], entry: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Cells of ``COLUMNS``: each quantity once, its cases below it."""
    for quantity, rows in gather(criteria, {name: entry[name] for name in MEASURED if name in entry}).items():
        if rows[0].case:
            yield f"*{quantity}*:", *[""] * (len(COLUMNS) - 1)
        for row in rows:
            what = row.case or quantity
            value = f"{row.value} ({row.reason})" if row.reason else row.value
            limit = f"{row.limit} (opposite: {row.opposite})" if row.opposite else row.limit
            yield what, value, row.interval, row.size, limit, row.verdict


def format_statement(sentence: str, criteria: Sequence[Criterion], entry: Mapping[str, Any]) -> str:
    """A statement in Markdown, then what was measured as a table without columns that are empty."""
    rows = [list(COLUMNS), list(COLUMNS.values()), *_rows(criteria, entry)]
    kept = [column for column in zip(*rows, strict=True) if any(column[2:])]
    lines = (" | ".join(cell.replace("|", "\\|") for cell in row) for row in zip(*kept, strict=True))
    return "".join([f"\n{sentence}\n\n", *(f"| {line} |\n" for line in lines)])


def claims_of(file: StudyFile, results: Quotable) -> str:
    """The claims of a study, each with its verdict and what was measured."""
    text = ""
    for name, claim in file.study.claims.items():
        entry, words = results.get(file.name, {}).get(name), f"{claim.words} ({claim.where})"
        text += f"\n*Not measured yet*: {words}\n" if entry is None else ""
        text += format_statement(f"**{entry['verdict']}**: {words}", claim.criteria, entry) if entry else ""
    return text


def count_claims(results: Quotable) -> str:
    """How many claims of the paper have each verdict, as a sentence."""
    names = [(file.name, name) for file in all_studies() for name in file.study.claims]
    return count_verdicts(
        [results[study][name]["verdict"] for study, name in names if name in results.get(study, {})]
    )


def all_claims(results: Quotable) -> str:
    """The claims of every study, in the order of the paper."""
    order = {name: place for place, name in enumerate(STUDIES)}
    studies = sorted((f for f in all_studies() if f.study.claims), key=lambda f: order.get(f.name, len(order)))
    own = [f"\n### {each.study.title} (`{each.name}`)\n{claims_of(each, results)}" for each in studies]
    return f"{''.join(own)}\n"
