"""The documentation quotes figures and verdicts of the studies as they came out."""

import json

import pytest
from support.command import ROOT, python

from pipelines.quotes import MARK, PAGES, QUOTED, quoted, read_quotable, renew

RESULTS = json.loads(QUOTED.read_text())
QUOTING = [page for page in PAGES if MARK.search(page.read_text())]
QUICKEST = "lead_design"


@pytest.mark.parametrize("page", QUOTING, ids=lambda page: page.stem)
def test_every_quote_is_what_the_study_found(page):
    text = page.read_text()
    wrong = [match[0] for match in MARK.finditer(text) if not text[: match.start()].endswith(quoted(match, RESULTS))]
    assert not wrong


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
        criteria = [{"shown": value, "spread": "exact", "count": 3, "verdict": "reproduced"}]
        statement = {"name": "a", "kind": "finding", "verdict": "yes", "criteria": criteria}
        (tmp_path / folder / "claims.json").write_text(json.dumps({"leg": [statement]}))
    entry = {"verdict": "yes", "values": ["2 N"], "intervals": ["exact"], "counts": [3], "verdicts": ["yes"]}
    assert read_quotable(tmp_path) == {"leg": {"a": entry}}


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
