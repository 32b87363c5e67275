"""Pages of the documentation that are made of the studies say what came out last, with the limits that decide."""

import json
import runpy

import pytest
from support.command import ROOT
from support.pages import PAGES

from pipelines.quotes import QUOTED, all_claims, all_studies, count_claims, fill, find_outdated, with_sentences

TABLES = runpy.run_path(str(ROOT / "docs" / "study_tables.py"))
RESULTS = json.loads(QUOTED.read_text())
STUDIES = {file.name: file for file in all_studies()}


def test_every_study_is_listed_with_its_verdicts():
    page = TABLES["on_page_markdown"](PAGES["studies.md"].read_text())
    for name, file in STUDIES.items():
        assert f"| [{file.study.title}](studies/{name}.md) | {file.study.question} | " in page
    assert "1 reproduced in part, 2 not reproduced" in page  # of lead_design


@pytest.mark.parametrize("name", STUDIES)
def test_the_page_of_a_study_has_every_statement_with_value_and_limit(name):
    page, study = TABLES["page_of"](STUDIES[name], RESULTS), STUDIES[name].study
    for key, statement in {**study.claims, **study.findings}.items():
        entry = RESULTS[name][key]
        _, _, own = page.partition(f"\n{entry['sentence']}\n" if key in study.findings else f"{statement.words} (")
        for criterion, value in zip(statement.criteria, entry["values"], strict=True):
            assert any(value in line and criterion.format_limit(criterion.holds) in line for line in own.split("\n"))


def test_a_statement_that_has_not_been_measured_says_so():
    assert TABLES["page_of"](STUDIES["lead_design"], {}).count("*Not measured yet*") == 3


def test_what_stands_in_files_is_what_the_studies_found():
    """``python -m pipelines --write-docs`` renews it."""
    assert with_sentences(RESULTS) == RESULTS
    paper, readme = (PAGES[name].read_text() for name in ("the-paper.md", "README.md"))
    count = f"\n**{count_claims(RESULTS)}**\n\n"
    assert fill(fill(paper, "claims", lambda: all_claims(RESULTS)), "count", lambda: count) == paper
    assert fill(readme, "count", lambda: count) == readme
    assert paper.count(count) == readme.count(count) == 1


@pytest.mark.parametrize("page", PAGES)
def test_words_stand_for_the_verdicts_for_which_they_were_written(page):
    assert find_outdated(PAGES[page].read_text(), RESULTS) == []


def test_words_for_another_verdict_are_found():
    found = find_outdated("It holds.<!--s.a is yes--> It fails.<!--s.a is no-->", {"s": {"a": {"verdict": "no"}}})
    assert found == ["<!--s.a is yes-->: it is no"]
