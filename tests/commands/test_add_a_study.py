"""The page on adding a study: its study is run as printed, and a file that is no study is refused in one line."""

import json
import re

import pandas as pd
import pytest
from support.command import ROOT, python

PAGE = (ROOT / "docs" / "add-a-study.md").read_text()


def block(language: str) -> str:
    return re.search(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which the study of the page has been written, and both its commands have run."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "my_study.py").write_text(block("python"))
    (folder / "my_study.md").write_text(block("markdown"))
    for line in block("bash").splitlines():
        done = python(*line.split()[1:], folder=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_it_leaves_a_page_a_table_and_a_finding_with_its_interval(folder):
    study = folder / "outputs" / "studies" / "my_study"
    (finding,) = json.loads((study / "claims.json").read_text())["my_study"]
    (criterion,) = finding["criteria"]
    assert criterion["low"] <= criterion["value"] <= criterion["high"]
    assert finding["statement"] in (study / "report.html").read_text()
    table = pd.read_parquet(study / "results.parquet")
    assert sorted(set(table["gait.stroke"])) == [0.1, 0.15, 0.2]
    assert len(table) == 3 * table["seed"].nunique()


def test_quick_says_so_and_finds_nothing(folder):
    page = (folder / "outputs" / "studies" / "my_study-quick" / "report.html").read_text()
    assert "concludes nothing" in page
    assert not (folder / "outputs" / "studies" / "my_study-quick" / "claims.json").exists()


def test_an_edit_of_the_page_alone_runs_nothing_again(folder):
    assert "nothing changed" in python("-m", "cmacexp.study", "my_study.py", folder=folder).stdout
    page = folder / "my_study.md"
    page.write_text(page.read_text().replace("One leg learns", "A leg learns"))
    done = python("-m", "cmacexp.study", "my_study.py", folder=folder)
    assert " 0 of them to be run" in done.stderr
    assert "A leg learns" in (folder / "outputs" / "studies" / "my_study" / "report.html").read_text()


@pytest.mark.parametrize(
    ("code", "page", "message"),
    [
        (None, "", "there is no such file"),
        ("x = 1", "", "must define STUDY = cmacexp.study.Study(...)"),
        (
            "from cmacexp.study import Study\nSTUDY = Study(title='', question='', runs=lambda quick: [])",
            None,
            "needs a page",
        ),
    ],
)
def test_what_is_no_study_is_one_line(code, page, message, tmp_path):
    if code is not None:
        (tmp_path / "other_study.py").write_text(code)
    if page is not None:
        (tmp_path / "other_study.md").write_text(page)
    done = python("-m", "cmacexp.study", "other_study.py", folder=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
