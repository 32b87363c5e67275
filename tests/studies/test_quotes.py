"""The tables of the documentation give figures and verdicts of the studies as they came out."""

import json
import re
import subprocess

import pytest
from support.command import ROOT, python
from support.pages import PAGES
from support.robots import needs_models

import cmacexp
from cmacexp.study import Criterion, Finding, at_most
from docs.blocks import renew_blocks
from docs.study_tables import PAGES as STUDY_PAGES
from docs.study_tables import format_page
from pipelines import results as quotes
from pipelines.groups import every_study
from pipelines.results import (
    CHANGED,
    CURRENT,
    NEVER,
    NOT_MEASURED,
    PublishedResults,
    count_claims,
    declared,
    fill_quotes,
    find_entry,
    find_outdated,
    read_results,
)

RESULTS = read_results()
QUICKEST = "lead_design"
ONE = Criterion("force", lambda runs: runs.end("force_rmse"), at_most(4.0))
ENTRY = {
    "verdict": "yes",
    "values": ["1 N", "3 N"],
    "intervals": ["1 to 2 N", "deterministic"],
    "counts": ["18 of 20", "5"],
    "verdicts": ["yes", "yes"],
}


def test_no_committed_page_has_a_placeholder():
    """Only code that shows how to write one may contain it."""
    paths = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert paths
    for path in paths.splitlines():
        text = re.sub(r"^```jinja\n.*?^```$|`[^`\n]*`", "", (ROOT / path).read_text(), flags=re.DOTALL | re.MULTILINE)
        assert not re.search(r"\{\{|\{%|^:::|^--8<--", text, re.MULTILINE), path


@pytest.mark.ci
def test_every_statement_that_was_measured_has_n_and_an_interval_for_each_value():
    names = [(study, name) for study, own in declared().items() for name in own]
    found = {name: entry for name in names if (entry := find_entry(*name, RESULTS.statements)) is not None}
    assert len(found) > 50
    for name, entry in found.items():
        limits = zip(entry["values"], entry["intervals"], entry["counts"], strict=True)
        assert all(re.search(r" to |deterministic|undefined|n/a|one seed", interval) and re.match(r"\d", count)
                   for _, interval, count in limits), name  # fmt: skip


@pytest.fixture
def statements(monkeypatch):
    """Two statements, one of which has been measured."""
    monkeypatch.setattr(
        quotes,
        "declared",
        lambda: {"s": {"a": Finding(2 * [ONE], says="It is small"), "new": Finding([ONE], says="new")}},
    )
    return {"s": {"a": ENTRY}}


def test_a_quote_gives_value_interval_size_and_verdict(statements):
    quoted = (
        'sentence("s.a")',
        'quote("s.a", 1)',
        'interval("s.a")',
        'measured("s.a")',
        'measured("s.a", 1)',
        'size("s.a")',
        'verdict("s.a")',
        'quote("s.new")',
    )
    filled = [fill_quotes(f"{{{{ {text} }}}}", statements) for text in quoted]
    assert filled == [
        "It is small: yes (1 N [1 to 2 N], n = 18 of 20; 3 N [deterministic], n = 5; limit at most 4).",
        "3 N",
        "1 to 2 N",
        "1 N [1 to 2 N]",
        "3 N [deterministic, n = 5]",
        "18 of 20",
        "yes",
        NOT_MEASURED,
    ]


@pytest.mark.parametrize("wrong", ['"s.b"', '"t.a"', '"s.a", 2'])
def test_a_quote_that_no_study_declares_is_an_error_with_its_name(wrong, statements):
    with pytest.raises(LookupError, match=re.escape(wrong)):
        fill_quotes(f"{{{{ quote({wrong}) }}}}", statements)


def test_a_sentence_for_another_verdict_and_one_that_is_gone_are_found(statements):
    sentences = [{"page": "a.md", "text": "It stays bounded.", "needs": {"s.a": "no"}}]
    (line,) = find_outdated(sentences, {"a.md": "It stays\nbounded."}, statements)
    assert "s.a = no, it is yes" in line
    assert len(list(find_outdated(sentences, {"a.md": "It grows."}, statements))) == 2
    assert not list(
        find_outdated([{**sentences[0], "needs": {"s.a": "yes"}}], {"a.md": "It stays bounded."}, statements)
    )


def test_sentences_of_pages_presuppose_the_verdicts_of_the_studies():
    texts = {path.name: path.read_text() for path in PAGES.values()}
    assert not list(find_outdated(RESULTS.sentences, texts, RESULTS.statements))


@pytest.mark.ci
@pytest.mark.parametrize("page", PAGES)
def test_blocks_of_a_page_are_what_the_code_and_the_studies_give(page):
    """``python -m pipelines --write-docs`` renews them."""
    text = PAGES[page].read_text()
    assert renew_blocks(text, RESULTS) == text


@needs_models
@pytest.mark.ci
def test_pages_of_studies_have_the_stored_results():
    """Some of them give settings of robots."""
    stored = {path.stem: path.read_text() for path in STUDY_PAGES.glob("*.md")}
    assert stored == {file.name: format_page(file, RESULTS) for file in every_study()}


def test_a_block_of_an_unknown_kind_is_refused_and_text_around_a_block_stays():
    block = "<!-- generated: count -->\n{}<!-- end -->\n"
    text = f"a\n{block.format('')}b\n{block.format('old')}"
    renewed = f"\n**{count_claims(RESULTS.statements)}**\n\n"
    assert renew_blocks(text, RESULTS) == f"a\n{block.format(renewed)}b\n{block.format(renewed)}"
    with pytest.raises(cmacexp.BadInput, match="counts"):
        renew_blocks(text.replace("count", "counts"), RESULTS)


@pytest.mark.ci
def test_published_results_are_those_of_the_study_today_and_changed_code_is_noticed(tmp_path):
    """Of the quickest study of the paper, run in full by its command."""
    done = python("-m", "pipelines", QUICKEST, "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    found = PublishedResults({})
    found.add_studies(tmp_path)
    assert found.statements[QUICKEST] == RESULTS.statements[QUICKEST]
    assert PublishedResults(json.loads(found.format())).statements == found.statements
    assert (found.find_state(QUICKEST).state, found.find_state("paper_settings").state) == (CURRENT, NEVER)
    study = found.studies[QUICKEST]
    study["own"]["pipelines/lead_design.py"] = "0"
    found.code[study["code"]]["cmacexp/models/leg.py"] = "0"
    state = found.find_state(QUICKEST)
    assert (state.state, set(state.reasons)) == (CHANGED, {"pipelines/lead_design.py", "cmacexp/models/leg.py"})
