"""What holds for every study: its runs compose, its page shows all it declares, its quick form concludes nothing."""

import re
import subprocess
import sys

import pytest
from support.command import ROOT, python
from support.doors import Options, compose_config, load_study, package_models, write_studies

from pipelines.groups import GROUPS, find_study

FILES = {
    name: load_study(find_study(name))
    for path in sorted((ROOT / "pipelines").glob("*.md.jinja"))
    for name in [path.name.partition(".")[0]]
    if "robots" not in name or package_models()  # without their models nothing of it can be composed
}
IN_CI = "one_leg_learning"


def test_every_study_is_in_one_group():
    names = [name for group in GROUPS.values() for name in group.studies]
    assert sorted(names) == sorted(path.name.partition(".")[0] for path in (ROOT / "pipelines").glob("*.md.jinja"))


@pytest.mark.parametrize("name", FILES)
def test_the_page_inserts_all_that_the_study_declares(name):
    text, study = FILES[name].page.read_text(), FILES[name].study
    for kind, own in (("figure", study.figures), ("table", study.tables), ("finding", study.findings)):
        assert set(re.findall(rf'{kind}\("([^"]+)"', text)) == set(own)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.nightly if "robots" in name else pytest.mark.ci) for name in FILES]
)
def test_every_override_can_be_composed(name):
    """In one run at least; overrides that differ in numbers alone are alike."""
    seen = set()
    for request in FILES[name].study.runs(quick=False):
        overrides = request.with_seed(1).overrides
        kinds = {re.sub(r"-?\d[\d.e-]*", "0", text) for text in overrides}
        if not kinds <= seen and not ("scenario=robot" in overrides and not package_models()):
            compose_config(overrides)
            seen |= kinds


def check_quick(place, study):
    """A report of a quick form is whole, shows every figure, and has neither verdict nor finding."""
    page = re.sub(r'src="data:[^"]*"', "", (place / "report.html").read_text())
    assert "concludes nothing" in page
    assert not any(f"{finding.says}: " in page for finding in study.findings.values())
    assert page.count("<figure") == len(study.figures)
    assert not (place / "claims.json").exists()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of all quick studies, which share their runs."""
    return tmp_path_factory.mktemp("studies")


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name in FILES if name != IN_CI])
def test_the_quick_form_leaves_a_whole_report_without_conclusions(name, folder):
    write_studies([FILES[name]], Options(folder, quick=True))
    check_quick(folder / f"{name}-quick", FILES[name].study)


@pytest.mark.nightly
def test_the_page_over_all_studies_of_a_group_is_whole(folder):
    """Runs of this one have a component of pipelines; a process that changes its environment is no fork."""
    done = python("-m", "pipelines.learning", "--quick", "--folder", str(folder), folder=ROOT, PYTHONUNBUFFERED="1")
    assert done.returncode == 0, done.stderr


@pytest.mark.ci
def test_the_quick_form_of_one_study_leaves_such_a_report_too(tmp_path):
    done = python("-m", "pipelines", IN_CI, "--quick", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    check_quick(tmp_path / f"{IN_CI}-quick", FILES[IN_CI].study)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["lead_design", "learning", "benchmark"])
def test_a_study_a_group_and_the_benchmark_have_commands_of_their_own(name):
    command = [sys.executable, "-m", f"pipelines.{name}", "--help"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"usage: python -m pipelines.{name} ")
