"""Pages of the documentation that are made of the studies say what came out last, with the limits that decide."""

import runpy

import pytest
from support.command import ROOT
from support.pages import PAGES

from pipelines.quotes import NOT_MEASURED, all_studies, find_entry
from pipelines.results import read_results

TABLES = runpy.run_path(str(ROOT / "docs" / "study_tables.py"))
RESULTS = read_results().statements
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
        if (entry := find_entry(name, key, RESULTS)) is None:
            assert f"*{NOT_MEASURED.capitalize()}*" in page
            continue
        _, _, own = page.partition(f"\n{entry['sentence']}\n" if key in study.findings else f"{statement.words} (")
        for criterion, value in zip(statement.criteria, entry["values"], strict=True):
            assert any(value in line and criterion.format_limit(criterion.holds) in line for line in own.split("\n"))


def test_a_statement_that_has_not_been_measured_says_so():
    assert TABLES["page_of"](STUDIES["lead_design"], {}).count("*Not measured yet*") == 3
