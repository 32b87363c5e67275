"""What holds for every study: its runs compose, its page concludes nothing, its findings can come out any way."""

import re
from pathlib import Path

import pytest
from support.command import ROOT, python

from cmacexp.commands.study import Options, write_studies
from cmacexp.config.compose import compose_config
from cmacexp.data.integrity import faults
from cmacexp.models.robot_file import package_models
from cmacexp.study.interval import Interval
from cmacexp.study.statements import Found, Judged, Limit, Measured
from cmacexp.study.study import load_study
from pipelines.paper import STUDIES

FILES = {
    path.stem: load_study(path.with_suffix(".py"))
    for path in sorted((ROOT / "pipelines").glob("*.md"))
    if "robots" not in path.stem or package_models()  # without their models nothing of it can be composed
}
STATEMENTS = [
    (name, kind, key)
    for name, file in FILES.items()
    for kind in ("claims", "findings")
    for key in getattr(file.study, kind)
]
CONCLUSIONS = (
    "reproduced", "contradicted", "inconclusive", "confirms", "proves", "shows that", "therefore", "hence", "because",
    "advice", "should", "better", "worse", "best", "thanks to", "so that", "advantage", "drawback",
)  # fmt: skip
"""Words that a page must not contain: a conclusion stands in a finding."""
COUNTED = "runs?|seeds?|cycles?|starts?|failures?|robots?|legs?"
NUMBERS = r"\d[\d,.]*|two|three|four|five|six|seven|eight|nine|ten|twenty|thirty|forty|fifty|hundred|thousand"


def text_of(name: str) -> str:
    """The page without what it inserts and quotes."""
    return re.sub(r"\{[{%].*?[%}]\}|“[^”]*”|`[^`]*`", " ", FILES[name].page.read_text(), flags=re.DOTALL)


@pytest.mark.parametrize("name", FILES)
def test_the_page_concludes_nothing_by_itself(name):
    text = text_of(name).lower()
    assert not [word for word in CONCLUSIONS if re.search(rf"\b{word}\b", text)]


@pytest.mark.parametrize("name", FILES)
def test_the_page_types_no_counts(name):
    found = re.findall(rf"\b(?:{NUMBERS})[ -](?:{COUNTED})\b", text_of(name).lower())
    assert not [each for each in found if each not in ("one leg", "four legs")]


@pytest.mark.parametrize("name", FILES)
def test_the_page_inserts_all_that_the_study_declares(name):
    file = FILES[name]
    inserted = {
        kind: set(re.findall(rf'{kind}\("([^"]+)"', file.page.read_text())) for kind in ("figure", "table", "finding")
    }
    declared = {"figure": file.study.figures, "table": file.study.tables, "finding": file.study.findings}
    assert inserted == {kind: set(names) for kind, names in declared.items()}


@pytest.mark.parametrize("name", FILES)
def test_every_override_can_be_composed(name):
    """In one run at least; overrides that differ in numbers alone are alike. The quick form is run below."""
    seen = set()
    for request in FILES[name].study.runs(quick=False):
        overrides = request.with_seed(1).overrides
        kinds = {re.sub(r"-?\d[\d.e-]*", "0", text) for text in overrides}
        needs_model = "scenario=robot" in overrides and not package_models()
        if not kinds <= seen and not needs_model:
            compose_config(overrides)
            seen |= kinds


def interval_in(limit: Limit) -> Interval:
    low, high = max(limit.low, -1e9), min(limit.high, 1e9)
    middle = (low + high) / 2.0
    return Interval(middle, middle, middle, 1, "made")


def outside(limit: Limit) -> Interval:
    value = limit.high + 1.0 if limit.high < 1e9 else limit.low - 1.0
    return Interval(value, value, value, 1, "made")


def across(limit: Limit) -> Interval:
    edge = limit.high if limit.high < 1e9 else limit.low
    return Interval(edge, edge - 1.0, edge + 1.0, 3, "made")


@pytest.mark.parametrize(("name", "kind", "key"), STATEMENTS)
def test_every_statement_can_come_out_every_way(name, kind, key):
    statement = getattr(FILES[name].study, kind)[key]

    def outcome(make) -> str:
        measured = [Measured(each, make(each.holds), []) for each in statement.criteria]
        return Judged(statement, measured).verdict if kind == "claims" else Found(statement, measured).sentence

    outcomes = [outcome(make) for make in (interval_in, outside, across)]
    assert len(set(outcomes)) == 3
    assert not [text for text in outcomes if "{" in text]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Of all quick studies, which share their runs; those of the paper are written by its command."""
    folder = tmp_path_factory.mktemp("studies")
    done = python("-m", "pipelines.paper", "--quick", "--folder", str(folder), folder=ROOT)
    assert done.returncode == 0, done.stderr
    assert faults(folder / "paper-quick") == []
    write_studies([file for name, file in FILES.items() if name not in STUDIES], Options(folder, quick=True))
    return folder


@pytest.mark.parametrize("name", FILES)
def test_the_quick_form_leaves_a_whole_report_without_conclusions(name, folder):
    place = folder / f"{name}-quick"
    assert faults(place) == []
    page = re.sub(r'src="data:[^"]*"', "", (place / "report.html").read_text())
    assert "concludes nothing" in page
    assert "verdict " not in page.partition("</style>")[2]
    assert all(finding.yes not in page for finding in FILES[name].study.findings.values())
    assert page.count("<figure") == len(FILES[name].study.figures)


@pytest.mark.parametrize("name", ["lead_design", "terrain"])
def test_the_command_of_a_study_makes_nothing_again(name, folder):
    done = python("-m", f"pipelines.{name}", "--quick", "--folder", str(folder), folder=ROOT)
    assert done.returncode == 0, done.stderr
    assert " 0 of them to be run" in done.stderr


@pytest.mark.parametrize("words", [("pipelines.nothing",), ("pipelines", "nothing")])
def test_a_study_that_does_not_exist_lists_those_that_do(words, tmp_path):
    done = python("-m", *words, folder=tmp_path, LC_ALL="C.UTF-8")  # a process of its own, not a fork
    assert done.returncode == 2
    assert all(f"python -m pipelines.{name}\n" in done.stdout for name in ("assumptions", "robots"))
