"""The documentation quotes figures and verdicts of the studies as they came out."""

import json
import re

import pytest
from support.command import ROOT, python
from support.pages import PAGES

from pipelines import quotes
from pipelines.quotes import (
    NOT_MEASURED,
    QUOTE,
    all_claims,
    count_claims,
    fill,
    fill_quotes,
    find_block,
    find_outdated,
)
from pipelines.readme import BLOCKS
from pipelines.results import CHANGED, CURRENT, NEVER, PublishedResults, read_results

RESULTS = read_results()
QUICKEST = "lead_design"
ENTRY = {
    "verdict": "yes",
    "values": ["1 N", "3 N"],
    "intervals": ["1 to 2 N", "deterministic"],
    "counts": ["18 of 20", "5"],
    "verdicts": ["yes", "yes"],
}


@pytest.mark.parametrize("page", PAGES)
def test_every_quote_is_filled_in(page):
    assert not QUOTE.search(fill_quotes(PAGES[page].read_text(), RESULTS.statements))


@pytest.fixture
def statements(monkeypatch):
    """Two statements, one of which has been measured."""
    monkeypatch.setattr(quotes, "declared", lambda: {"s": {"a": 2, "new": 1}})
    return {"s": {"a": ENTRY}}


def test_a_quote_gives_value_interval_size_and_verdict(statements):
    text = (
        """{{ quote("s.a", 1) }} {{ interval("s.a") }} {{ size("s.a") }} {{ verdict("s.a") }} {{ quote("s.new") }}"""
    )
    assert fill_quotes(text, statements) == f"3 N 1 to 2 N 18 of 20 yes {NOT_MEASURED}"


@pytest.mark.parametrize("wrong", ["s.b", "t.a", 's.a", 2'])
def test_a_quote_that_no_study_declares_is_an_error_with_its_name(wrong, statements):
    with pytest.raises(LookupError, match=re.escape(wrong.partition('"')[0])):
        fill_quotes(f'{{{{ quote("{wrong}") }}}}'.replace('2")', "2)"), statements)


def test_sentences_stand_for_the_verdicts_for_which_they_were_written():
    texts = {path.name: path.read_text() for path in PAGES.values()}
    assert find_outdated(RESULTS.sentences, texts, RESULTS.statements) == []


def test_a_sentence_for_another_verdict_and_one_that_is_gone_are_found(statements):
    sentences = [{"page": "a.md", "text": "It stays bounded.", "needs": {"s.a": "no"}}]
    assert find_outdated(sentences, {"a.md": "It stays\nbounded."}, statements) == [
        "a.md: 'It stays bounded.' is for s.a = no, it is yes"
    ]
    assert "has no sentence" in find_outdated(sentences, {"a.md": "It grows."}, statements)[0]


def test_blocks_are_what_the_studies_found():
    """``python -m pipelines --write-docs`` renews them."""
    paper, readme = (PAGES[name].read_text() for name in ("the-paper.md", "README.md"))
    count = f"\n**{count_claims(RESULTS.statements)}**\n\n"
    assert fill(fill(paper, "claims", lambda: all_claims(RESULTS.statements)), "count", lambda: count) == paper
    assert fill(readme, "count", lambda: count) == readme
    assert paper.count(count) == readme.count(count) == 1
    for block in BLOCKS.glob("*.md"):
        assert find_block(readme, block.stem) == fill_quotes(block.read_text(), RESULTS.statements)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of the quickest study, run in full."""
    folder = tmp_path_factory.mktemp("studies")
    done = python("-m", f"pipelines.{QUICKEST}", "--folder", str(folder), folder=ROOT)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_results_are_those_of_the_study_today(folder):
    found = PublishedResults({})
    found.add_studies(folder)
    assert found.statements[QUICKEST] == RESULTS.statements[QUICKEST]
    assert found.find_state(QUICKEST)[1] == CURRENT
    assert found.find_state("assumptions")[1] == NEVER


def test_a_study_is_changed_if_a_file_or_a_model_that_it_depends_on_is(folder):
    found = PublishedResults({})
    found.add_studies(folder)
    study = found.studies[QUICKEST]
    study["own"]["pipelines/lead_design.py"] = "0"
    found.code[study["code"]]["cmacexp/models/leg.py"] = "0"
    state = found.find_state(QUICKEST)
    assert (state.state, set(state.reasons)) == (CHANGED, {"pipelines/lead_design.py", "cmacexp/models/leg.py"})
    again = PublishedResults(json.loads(found.format()))
    assert again.statements == found.statements
