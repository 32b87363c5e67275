"""The lists of the page studies.md: every study with its claims and findings, as they came out last.

mkdocs fills the page when it builds the site, so a new study needs no edit of it.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cmacexp.study import Criterion
from cmacexp.study.study import StudyFile, load_study

PLACE = re.compile("<!-- studies: begin -->.*<!-- studies: end -->", flags=re.DOTALL)
"""Where they stand in the page."""
DOCS = Path(__file__).parent
STUDIES = [page.with_suffix(".py") for page in sorted((DOCS.parent / "pipelines").glob("*.md"))]


def measured(entry: dict[str, Any] | None, criteria: Sequence[Criterion]) -> str:
    """The quantities behind a statement with their values, and its verdict, as cells of a table."""
    if entry is None:
        return "; ".join(each.quantity for each in criteria) + " | not measured yet |\n"
    values = zip(criteria, entry["values"], strict=True)
    return "; ".join(f"{each.quantity}: {value}" for each, value in values) + f" | {entry['verdict']} |\n"


def section_of(file: StudyFile, results: dict[str, Any]) -> str:
    """The question of a study, how to run it, and its statements with what ``results`` has by their names."""
    study, text = file.study, f"## {file.study.title}\n\n{file.study.question} `python -m pipelines.{file.name}`\n"
    if study.claims:
        text += "\n| the paper says | measured | verdict |\n|---|---|---|\n"
    for name, claim in study.claims.items():
        text += f"| {claim.words} ({claim.where}) | {measured(results.get(name), claim.criteria)}"
    if study.findings:
        text += "\n| finding | measured | holds |\n|---|---|---|\n"
    for name, finding in study.findings.items():
        text += f"| `{name}` | {measured(results.get(name), finding.criteria)}"
    return text


def all_studies() -> str:
    """A section for each study."""
    results = json.loads((DOCS / "results.json").read_text())
    return "\n".join(section_of(load_study(path), results.get(path.stem, {})) for path in STUDIES)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill the page; mkdocs calls this for every page."""
    return PLACE.sub(lambda _: all_studies(), markdown)
