"""The page on adding a study: its study is run as printed, and a file that is no study is refused in one line."""

import json
import re
import signal
import time

import pandas as pd
import pytest
from support.command import ROOT, python, started
from support.pages import blocks

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
    page = folder / "my_study.md"
    page.write_text(page.read_text().replace("One leg learns", "A leg learns"))
    done = python("-m", "cmacexp.study", "my_study.py", folder=folder)
    assert " 0 of them to be run" in done.stderr
    assert "A leg learns" in (folder / "outputs" / "studies" / "my_study" / "report.html").read_text()


def test_the_comparison_of_the_page_prints_what_it_says(tmp_path):
    *_, code = (block.code for block in blocks("add-a-study.md") if block.language == "python")
    (text,) = (block.code for block in blocks("add-a-study.md") if block.language == "text")
    (tmp_path / "script.py").write_text(code)
    done = python("-m", "script", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    excluded, *_, sentence = done.stdout.splitlines()
    assert "inf in 5" in excluded
    assert sentence.split() == text.split()
    assert (tmp_path / "compared.svg").exists()


STUDY = "from cmacexp.study import *\nSTUDY = Study(title='T', question='Q', runs=lambda quick: {runs}, {more})\n"
FINDING = "Finding([Criterion('q', lambda results: {sample}, at_most(1))], '{sentence}', '', '')"


def study(runs="[]", more="", sample="[1.0]", sentence="yes"):
    """The code of a study with one finding, ``cost``."""
    return STUDY.format(
        runs=runs, more=f"findings={{'cost': {FINDING.format(sample=sample, sentence=sentence)}}}, {more}"
    )


@pytest.mark.parametrize(
    ("code", "page", "message"),
    [
        (None, "", "there is no such file"),
        ("x = 1", "", "must define STUDY = cmacexp.study.Study(...)"),
        (study(), None, "needs a page"),
        (study("grid('cmac.layerz=8')"), "", "did you mean cmac.layers?"),
        (study(), "\n{{ finding('price') }}", "line 2: the study declares no finding 'price'; it has cost"),
        (study(), "{% call figure('curves') %}c{% endcall %}", "declares no figure 'curves'; it has none"),
        (study(), "{{ finding('cost') ", "line 1: unexpected end of template"),
        (study(), "{{ cost }}", "'cost' is undefined; it may use claim, figure, finding"),
        (study("grid('cycles=1')", sample="results.end('force_rms')"), "", "did you mean force_rmse?"),
        (
            study(sentence="{valeu}"),
            "",
            "finding={valeu}: has a name in braces that is none of the values: use {value}",
        ),
    ],
)
def test_a_mistake_is_one_line(code, page, message, tmp_path):
    if code is not None:
        (tmp_path / "other_study.py").write_text(code)
    if page is not None:
        (tmp_path / "other_study.md").write_text(page)
    done = python("-m", "cmacexp.study", "other_study.py", folder=tmp_path)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if "to be run" not in line]
    assert message in lines[0]
    assert len(lines) == 1


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("json.py", "another module is called json"),
        ("a.b.py", "without a dot"),
        ("other.md", "must be a file of Python"),
    ],
)
def test_a_file_that_cannot_be_imported_by_its_name_is_one_line(name, message, tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / name).write_text(study())
    done = python("-m", "cmacexp.study", f"own/{name}", folder=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert message in done.stderr


def test_a_run_that_is_requested_twice_counts_once(tmp_path):
    twice = "[*grid('cycles=1'), *grid(over={'cycles': [1]}), *grid('cycles=1', name='other')]"
    (tmp_path / "twice.py").write_text(study(twice, sample="results.at(1, 'force_rmse')"))
    (tmp_path / "twice.md").write_text("{{ runs }} runs")
    done = python("-m", "cmacexp.study", "twice.py", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    (found,) = json.loads((tmp_path / "outputs" / "studies" / "twice" / "claims.json").read_text())["twice"]
    assert found["criteria"][0]["count"] == 2


RAISES = """
class Raises:
    acts = True
    def reset(self, setup): pass
    def predict(self, reference, learning_error): raise RuntimeError("no torque today")
"""


def test_runs_that_fail_are_rows_and_the_study_goes_on(tmp_path):
    (tmp_path / "own_part.py").write_text(RAISES)
    ways = {"walks": [], "refused": ["cmac.layers=-1"], "out of reach": ["gait.stroke=3"]}
    ways["raises"] = ["feedforward._target_=own_part.Raises"]
    sample = "results.end('force_rmse')"
    code = study(f"grid('cycles=2', over={{'way': {ways}}})", sample=sample).replace("at_most(1)", "at_most(1e9)")
    (tmp_path / "some.py").write_text(code + "STUDY.measures['steps'] = lambda run: run.manifest['steps']\n")
    (tmp_path / "some.md").write_text("{{ runs }} runs: {{ finding('cost') }}")
    done = python("-m", "cmacexp.study", "some.py", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if line.startswith("error: 1 of 4 runs failed: ")]
    assert len(told) == 3
    table = pd.read_parquet(tmp_path / "outputs" / "studies" / "some" / "results.parquet").set_index("way")
    assert table.status.to_dict() == {way: "completed" if way == "walks" else "failed" for way in table.index}
    assert "no torque today" in table.cause["raises"]
    assert table.steps.notna().to_dict() == {way: way == "walks" for way in table.index}
    again = python("-m", "cmacexp.study", "some.py", folder=tmp_path)
    assert "4 runs, 2 of them to be run" in again.stderr


def test_a_study_all_of_whose_runs_fail_says_why(tmp_path):
    (tmp_path / "none.py").write_text(study("grid(over={'cmac.layers': [-1, -2]})"))
    (tmp_path / "none.md").write_text("{{ finding('cost') }}")
    done = python("-m", "cmacexp.study", "none.py", folder=tmp_path)
    assert done.returncode == 2
    assert "cmac.layers=-1: must be at least 1" in done.stderr.splitlines()[-1]


def test_ctrl_c_ends_a_study_and_its_runs_at_once(tmp_path):
    (tmp_path / "long.py").write_text(study("grid('cycles=1000000', 'feedforward=none', 'record.cycles=[1]')"))
    (tmp_path / "long.md").touch()
    process = started("long.py", folder=tmp_path, module="cmacexp.study")
    runs = tmp_path / "outputs" / "studies" / "runs"
    while not list(runs.glob("*")) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    try:
        _, err = process.communicate(timeout=20)  # the run takes hours
    finally:
        process.kill()
    assert process.returncode == 130
    assert "interrupted; the same command runs what is missing" in err
    assert "Traceback" not in err
    assert not list(runs.rglob("manifest.json"))
