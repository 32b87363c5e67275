"""The page of the studies lists every study with its statements, as they came out last."""

import json
import runpy

from support.command import ROOT
from support.pages import PAGES

TABLES = runpy.run_path(str(ROOT / "docs" / "study_tables.py"))


def test_every_study_and_result_is_on_the_page():
    page = TABLES["on_page_markdown"](PAGES["studies.md"].read_text())
    results = json.loads((ROOT / "docs" / "results.json").read_text())
    for path in TABLES["STUDIES"]:
        _, found = page.split(f"`python -m pipelines.{path.stem}`")
        rows = [line for line in found.split("\n## ")[0].splitlines() if line.startswith("|")]
        for entry in results[path.stem].values():
            row = next(row for row in rows if all(f": {value}" in row for value in entry["values"]))
            assert any(f"| {each['verdict']} |" in row for each in results[path.stem].values()), row


def test_a_statement_that_has_not_been_measured_says_so():
    study = TABLES["load_study"](ROOT / "pipelines" / "lead_design.py")
    assert "| not measured yet |" in TABLES["section_of"](study, {})
