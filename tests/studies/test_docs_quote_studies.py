"""The documentation quotes figures and verdicts of the studies as they came out."""

import json
import re
from collections import Counter

import pytest
from support.command import ROOT, python

from cmacexp.study.statements import CONTRADICTED, IN_PART, INCONCLUSIVE, NOT_REPRODUCED, REPRODUCED
from pipelines.__main__ import MARK, PAGES, QUOTED, quoted, read_quotable, renew

RESULTS = json.loads(QUOTED.read_text())
SAID = re.compile(r"<!--(\w+)\.([^>]+?) is ([a-z ]+)-->")
"""Behind a sentence: the verdict that it says in words."""
QUOTING = [page for page in PAGES if MARK.search(page.read_text()) or SAID.search(page.read_text())]
QUICKEST = "lead_design"


@pytest.mark.parametrize("page", QUOTING, ids=lambda page: page.stem)
def test_every_quote_is_what_the_study_found(page):
    text = page.read_text()
    wrong = [match[0] for match in MARK.finditer(text) if not text[: match.start()].endswith(quoted(match, RESULTS))]
    assert not wrong
    said = SAID.findall(text)
    assert [(study, name, RESULTS[study][name]["verdict"]) for study, name, _ in said] == said


def test_the_readme_counts_the_claims_by_their_verdicts():
    counted = Counter(entry["verdict"] for study in RESULTS.values() for entry in study.values())
    first, *rest = (counted[each] for each in (REPRODUCED, IN_PART, NOT_REPRODUCED, CONTRADICTED, INCONCLUSIVE))
    (text,) = re.findall(r"^\*\*(.* claims are .*)\*\*$", PAGES[0].read_text(), flags=re.MULTILINE)
    assert [int(count) for count in re.findall(r"\d+", text)] == [first, first + sum(rest), *rest]


def test_the_results_are_those_of_the_study_today(tmp_path):
    """Of the quickest study; ``python -m pipelines --write-docs`` renews all."""
    done = python("-m", f"pipelines.{QUICKEST}", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    assert read_quotable(tmp_path)[QUICKEST] == RESULTS[QUICKEST]


def test_a_study_is_quoted_from_its_own_folder(tmp_path):
    for folder, value in (
        ("leg", "2 N"),
        ("paper", "1 N"),
    ):  # the study has been run again since the page over several
        (tmp_path / folder).mkdir()
        statement = {"name": "a", "verdict": "yes", "criteria": [{"shown": value, "spread": "exact"}]}
        (tmp_path / folder / "claims.json").write_text(json.dumps({"leg": [statement]}))
    assert read_quotable(tmp_path) == {"leg": {"a": {"verdict": "yes", "values": ["2 N"], "intervals": ["exact"]}}}


def test_quotes_are_renewed_in_place():
    before, after = (
        {"s": {"a": {"verdict": v, "values": [x], "intervals": [i]}}}
        for v, x, i in (("yes", "1 N", "exact"), ("no", "2.5 N", "2 N to 3 N"))
    )
    text = "It is 1 N<!--s.a 0--> (exact<!--s.a interval 0-->): yes<!--s.a verdict-->."
    renewed = "It is 2.5 N<!--s.a 0--> (2 N to 3 N<!--s.a interval 0-->): no<!--s.a verdict-->."
    assert renew(text, before, after) == renewed


def test_a_new_quote_is_filled_in():
    after = {"s": {"new": {"verdict": "yes", "values": ["3 N"], "intervals": ["2 N to 4 N"]}}}
    text = "It is ?<!--s.new 0--> (?<!--s.new interval 0-->)."
    assert renew(text, {}, after) == "It is 3 N<!--s.new 0--> (2 N to 4 N<!--s.new interval 0-->)."
