"""What pages quote of the last full studies: values by name, which the site fills in, and generated blocks.

``{{ quote("one_leg_learning.bias") }}`` on a page stands for the first value of a statement, ``quote("...", 1)`` for
the second, ``interval`` for its interval, ``measured`` for both, ``size`` for its n, ``verdict`` for the verdict,
``sentence`` for the sentence of a finding. Sections of the README stand in ``readme_blocks``, likewise.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cmacexp
from cmacexp.study import Claim, Finding
from cmacexp.study.page import count_verdicts
from cmacexp.study.study_file import StudyFile, load_study
from pipelines.benchmark.benchmark import BENCHMARK, make_study
from pipelines.benchmark.entrants import MACHINES, list_methods
from pipelines.benchmark.log_track import make_study as make_log_study
from pipelines.groups import PIPELINES, find_study

DOCS = PIPELINES.parent / "docs"
README = PIPELINES.parent / "README.md"
SCORES, LOG_SCORES = (PIPELINES / BENCHMARK / f"{name}.md" for name in ("scores", "log_scores"))
"""Every table of the last full benchmark, and of its log track."""
PAGES = (README, *sorted(DOCS.glob("*.md")))
"""What may quote the studies."""
BLOCKS = Path(__file__).with_name("readme_blocks")
"""A file of Markdown with quotes for each section of its name."""
FENCE = re.compile(r"(?<=```text\n).*?(?=^```$)", flags=re.DOTALL | re.MULTILINE)
"""What a command printed, in a section."""
FIRST_RUN = "Install and run"
QUOTE = re.compile(r'\{\{ (quote|interval|measured|size|verdict|sentence)\("(\w+)\.([^"]+)"(?:, (\d+))?\) \}\}')
LISTS = {"quote": "values", "interval": "intervals", "size": "counts"}
"""Entries of a statement with a value for each criterion, by what quotes them."""
MEASURED = ("values", "intervals", "counts", "verdicts")
NOT_MEASURED = "not measured yet"
Quotable = Mapping[str, Mapping[str, Any]]
"""Statements by study and name."""


def all_studies() -> list[StudyFile]:
    """Every study of this folder, by name."""
    return [load_study(path) for page in sorted(PIPELINES.glob("*.md")) if (path := find_study(page.stem))]


def whole_benchmark() -> StudyFile:
    """The benchmark as a study: all machines and methods."""
    study = make_study(MACHINES, [method.name for method in list_methods()])
    return StudyFile(PIPELINES / BENCHMARK / f"{BENCHMARK}.py", study)


@cache
def declared() -> Mapping[str, Mapping[str, Claim | Finding]]:
    """Every statement by study and name, whether it was measured or not."""
    studies = {file.name: file.study for file in (whole_benchmark(), make_log_study(), *all_studies())}
    return {name: study.statements for name, study in studies.items()}


def sentence_of(statement: Claim | Finding, entry: Mapping[str, Any]) -> str:
    """The sentence of a statement as it came out."""
    return statement.sentence(entry["verdict"], entry["values"], entry["intervals"], entry["counts"])


def find_entry(study: str, name: str, results: Quotable) -> Mapping[str, Any] | None:
    """What a study gave for a statement; None if it has never measured all that the statement consists of.

    Raises:
        LookupError: it declares no such statement.
    """
    count, entry = len(declared()[study][name].criteria), results.get(study, {}).get(name)
    whole = entry is not None and all(len(entry.get(column) or ()) == count for column in MEASURED)
    return entry if whole else None


def quoted(match: re.Match[str], results: Quotable) -> str:
    """What a page shows for a quote.

    Raises:
        LookupError: there is no such study, statement or value.
    """
    kind, study, name, number = match.groups()
    statement, index = declared().get(study, {}).get(name), int(number or 0)
    if statement is None or index >= len(statement.criteria):
        raise LookupError(f"{match[0]}: no study declares it")
    if (entry := find_entry(study, name, results)) is None:
        return NOT_MEASURED
    if kind == "sentence":
        return sentence_of(statement, entry)
    if kind == "measured":
        return f"{entry['values'][index]} [{entry['intervals'][index]}]"
    return str(entry[LISTS[kind]][index] if kind in LISTS else entry[kind])


def fill_quotes(text: str, results: Quotable) -> str:
    """A page with its quotes filled in; raises as :func:`quoted`."""
    return QUOTE.sub(partial(quoted, results=results), text)


def find_outdated(sentences: Sequence[Mapping[str, Any]], texts: Mapping[str, str], results: Quotable) -> list[str]:
    """Sentences that are gone from their page, or were written for another verdict; a line for each.

    Args:
        sentences: ``page``, ``text``, and the verdict that it ``needs`` by statement.
        texts: of pages, by name.
        results: of the studies.
    """
    found = []
    for each in sentences:
        if each["text"] not in " ".join(texts[each["page"]].split()):
            found.append(f"{each['page']}: has no sentence {each['text']!r}")
        for key, verdict in each["needs"].items():
            study, _, name = key.partition(".")
            entry = find_entry(study, name, results)
            if (today := entry["verdict"] if entry else NOT_MEASURED) != verdict:
                found.append(f"{each['page']}: {each['text']!r} is for {key} = {verdict}, it is {today}")
    return found


def count_claims(results: Quotable) -> str:
    """How many claims of the paper have each verdict, as a sentence."""
    entries = [find_entry(file.name, name, results) for file in all_studies() for name in file.study.claims]
    return count_verdicts([entry["verdict"] for entry in entries if entry])


def print_first_run(section: str) -> str:
    """The table that the first run of a section prints at its end."""
    with TemporaryDirectory() as folder:
        return str(
            cmacexp.run(re.findall(r"-m cmacexp (.*)$", section, re.MULTILINE)[0].split(), Path(folder) / "run")
        ).partition("\n")[2]


def find_section(text: str, heading: str) -> str:
    """What stands below a heading of the README, up to the next one."""
    return text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def make_section(path: Path, statements: Quotable) -> str:
    """A section with its quotes filled in."""
    text = fill_quotes(path.read_text(encoding="utf-8"), statements)
    return text.replace("{{ count }}", count_claims(statements))


def renew_readme(text: str, statements: Quotable) -> str:
    """The README with its sections made anew."""
    for path in sorted(BLOCKS.glob("*.md")):
        text = text.replace(find_section(text, path.stem), make_section(path, statements))
    first = find_section(text, FIRST_RUN)
    return text.replace(first, FENCE.sub(lambda _: f"{print_first_run(first)}\n", first))
