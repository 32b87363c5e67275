"""The page on adding a study: its study is run as printed, and a file that is no study is refused in one line."""

import json
import re
from hashlib import sha256

import pandas as pd
import pytest
from support.command import ROOT, call, interrupted, python

PAGE = (ROOT / "docs" / "add-a-study.md").read_text()
STUDY = "from cmacexp.study import *\nSTUDY = Study(title='T', question='Q', runs=lambda quick: {runs}, {more})\n"
FINDING = "Finding([Criterion('q', lambda results: {sample}, at_most(1e9))], says='It is small')"
TWO = ("--seeds", "2")
"""Beside what the page prints: fewer runs."""


def block(language: str, number: int = 0) -> str:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)[number]


def write(folder, name, page="", sample="[1.0]", runs="[]", more=""):
    """A study with one finding, ``cost``, and its page; returns its file."""
    findings = f"findings={{'cost': {FINDING.format(sample=sample)}}}, "
    (folder / f"{name}.py").write_text(STUDY.format(runs=runs, more=findings) + more)
    (folder / f"{name}.md").write_text(page)
    return f"{name}.py"


@pytest.mark.ci
def test_the_study_of_the_page_leaves_a_finding_with_its_interval(tmp_path):
    (tmp_path / "my_study.py").write_text(block("python"))
    (tmp_path / "my_study.md.jinja").write_text(block("jinja"))
    for line in block("bash").splitlines():
        done = python(*line.split()[1:], *TWO, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    whole = tmp_path / "outputs" / "studies" / "my_study"
    (finding,) = json.loads((whole / "claims.json").read_text())["my_study"]
    (criterion,) = finding["criteria"]
    assert criterion["low"] <= criterion["value"] <= criterion["high"]
    assert finding["statement"] in (whole / "report.html").read_text()
    table = pd.read_parquet(whole / "results.parquet")
    assert sorted(set(table["gait.stroke"])) == [0.1, 0.15, 0.2]
    assert len(table) == 3 * table["seed"].nunique()


@pytest.mark.ci
def test_the_declared_study_of_the_page_has_a_finding_that_fails_and_repeats_no_run(tmp_path):
    (tmp_path / "my_study.py").write_text(block("python", 1))
    (tmp_path / "my_study.md.jinja").write_text(block("jinja"))
    first, again = (python("-m", "cmacexp.study", "my_study.py", *TWO, folder=tmp_path) for _ in range(2))
    assert first.returncode == 0, first.stderr
    assert " 0 of them to be run" in again.stderr
    assert again.stdout == first.stdout
    cost, vanishes = json.loads((tmp_path / "outputs/studies/my_study/claims.json").read_text())["my_study"]
    assert (vanishes["verdict"], [each["count"] for each in vanishes["criteria"]]) == ("no", [2, 2, 2])
    assert re.fullmatch(
        r"A long stroke is no less accurate: (yes|undecided) \(.* \[.*\], n = 2; limit .*\)\.", cost["statement"]
    )


def require_refused(folder, file, named):
    """A study ends in one line that names what is wrong."""
    done = call("study", file, folder=folder)
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert (done.returncode, named in line) == (2, True), line


def test_a_study_of_yaml_is_refused_and_says_how_to_write_it_now(tmp_path):
    (tmp_path / "my_study.yaml").write_text("title: T")
    require_refused(tmp_path, "my_study.yaml", "cmacexp.study.declare(")


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"page": "\n{{ finding('price') }}"}, "price"),
        ({"page": "{% call figure('curves') %}c{% endcall %}"}, "curves"),
        ({"more": "STUDY = 1"}, "STUDY"),
        ({"more": "STUDY ="}, "SyntaxError"),
        ({"more": "import nothing_here"}, "nothing_here"),
        ({"name": "json"}, "json"),
        pytest.param({"page": "{{ finding('cost') "}, "line 1", marks=pytest.mark.ci),
        pytest.param({"page": "{{ cost }}"}, "cost", marks=pytest.mark.ci),
        pytest.param({"runs": "grid('cmac.layerz=8')"}, "cmac.layers", marks=pytest.mark.ci),
        pytest.param({"runs": "grid(over={'cmac.layers': [-1, -2]})"}, "cmac.layers=-1", marks=pytest.mark.ci),
        pytest.param(
            {"runs": "grid('cycles=1')", "sample": "results.end('force_rms')"}, "force_rmse", marks=pytest.mark.ci
        ),
    ],
)
def test_a_mistake_is_one_line_that_names_it(wrong, named, tmp_path):
    name = f"wrong_{sha256(str(wrong).encode()).hexdigest()[:8]}"  # a module of its own in this process
    require_refused(tmp_path, write(tmp_path, **{"name": name, **wrong}), named)


RAISES = """
class Raises:
    acts = True
    def reset(self, setup): pass
    def predict(self, reference, learning_error): raise RuntimeError("no torque today")
"""


@pytest.mark.ci
def test_runs_that_fail_are_rows_the_study_goes_on_and_a_run_asked_for_twice_counts_once(tmp_path):
    (tmp_path / "own_part.py").write_text(RAISES)
    ways = {"walks": [], "refused": ["cmac.layers=-1"], "raises": ["feedforward._target_=own_part.Raises"]}
    runs = f"2 * grid('cycles=2', over={{'way': {ways}}})"
    more = "STUDY.measures['steps'] = lambda run: run.manifest['steps']\n"
    sample = 'results.select(way="walks").end("force_rmse")'
    file = write(tmp_path, "some", "{{ runs }} runs: {{ finding('cost') }}", sample, runs=runs, more=more)
    done = python("-m", "cmacexp.study", file, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("error: ")]) == 2
    place = tmp_path / "outputs" / "studies" / "some"
    table = pd.read_parquet(place / "results.parquet").set_index("way")
    assert table.status.to_dict() == {"walks": "completed", "refused": "failed", "raises": "failed"}
    assert "no torque today" in table.cause["raises"]
    assert table.steps.notna().to_dict() == {way: way == "walks" for way in table.index}
    assert json.loads((place / "claims.json").read_text())["some"][0]["criteria"][0]["count"] == 1


@pytest.mark.ci
def test_ctrl_c_ends_a_study_and_its_runs_at_once(tmp_path):
    file = write(tmp_path, "long", runs="grid('cycles=1000000', 'feedforward=none', 'record.cycles=[1]')")
    runs = tmp_path / "outputs" / "studies" / "runs"
    done = interrupted(file, folder=tmp_path, once=lambda: list(runs.glob("*")), module="cmacexp.study")
    assert done.returncode == 130  # long before the run would end
    assert not list(runs.rglob("manifest.json"))
