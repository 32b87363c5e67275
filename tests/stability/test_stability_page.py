"""``python -m cmacexp.stability``: the page, the table, and what it cannot look at."""

import json
from argparse import Namespace

import pytest
from support.command import cmacexp, python

from cmacexp.stability.page import advise
from cmacexp.stability.verdict import GROWS, HOLDS, UNDECIDED, Verdict

DIVERGING = ("learning.lead=-2", "cycles=45", "record=trace")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    assert cmacexp(*DIVERGING, "hydra.run.dir=run", folder=folder).returncode == 3
    return folder


def test_a_run_that_diverges_is_told_with_the_lead_that_holds(folder):
    done = python("-m", "cmacexp.stability", "run", folder=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("grows: The run ends in cycle 41.")
    assert "-2 (this run)" in done.stdout
    assert "Learning holds with lead 1." in done.stdout
    page = folder / "run" / "stability"
    assert done.stdout.splitlines()[-1] == str(page.relative_to(folder) / "report.html")
    manifest = json.loads((page / "manifest.json").read_text())
    assert "stability.json" in manifest["files"]
    for name in ("growth", "real_parts"):
        assert (page / "figures" / f"{name}.svg").is_file()
    verdict = json.loads((page / "stability.json").read_text())
    assert (verdict["verdict"], verdict["lead"]) == ("grows", -2)
    assert verdict["growth"] == pytest.approx(1.15, abs=0.02)
    assert "grows: The run ends in cycle 41." in (page / "report.html").read_text()
    assert python("-m", "cmacexp.verify", "run", folder=folder).returncode == 0


def test_a_run_whose_learning_the_guard_ended_is_analysed_without_it(folder):
    settings = (*DIVERGING, "learning.lead=-3", "learning.guard=freeze", "hydra.run.dir=guarded")
    assert cmacexp(*settings, folder=folder).returncode == 0
    done = python("-m", "cmacexp.stability", "guarded", folder=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("grows:")
    assert "-3 (this run)" in (folder / "guarded" / "stability" / "report.html").read_text()


@pytest.mark.parametrize(
    ("own", "other", "advice"),
    [
        (GROWS, HOLDS, ["Learning holds with lead 2."]),
        (GROWS, UNDECIDED, ["No lead that was tried is sure to hold."]),
        (HOLDS, HOLDS, []),
    ],
)
def test_a_lead_is_advised_where_learning_does_not_hold(own, other, advice):
    verdicts = {lead: Verdict(verdict, 1.0, lead, ()) for lead, verdict in ((1, own), (2, other))}
    assert advise(Namespace(lead=1, verdicts=verdicts)) == advice


def test_what_does_not_learn_gets_a_verdict_alone(folder):
    assert cmacexp("feedforward=none", "cycles=6", "hydra.run.dir=alone", folder=folder).returncode == 0
    done = python("-m", "cmacexp.stability", "alone", folder=folder)
    assert done.returncode == 0, done.stderr
    page = folder / "alone" / "stability"
    assert done.stdout.splitlines() == [
        "undecided: nothing learns from cycle to cycle.",
        str(page.relative_to(folder) / "report.html"),
    ]
    assert json.loads((page / "stability.json").read_text())["growth"] is None


def test_the_runs_of_a_folder_are_analysed_one_by_one(tmp_path):
    overrides, reason = ("feedforward=none", "cycles=5"), "undecided: nothing learns from cycle to cycle."
    for name in "ab":
        assert cmacexp(*overrides, "record=trace", f"hydra.run.dir=runs/{name}", folder=tmp_path).returncode == 0
    done = python("-m", "cmacexp.stability", "runs", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(reason) == 2
    for name in "ab":
        assert reason in (tmp_path / "runs" / name / "stability" / "report.html").read_text()
