"""``python -m cmacexp.stability``: the page, the table, and what it cannot look at."""

import json
import shutil
from argparse import Namespace

import pytest
from support.command import call, python

from cmacexp.addons.stability.page import advise
from cmacexp.addons.stability.verdict import GROWS, HOLDS, UNDECIDED, Verdict

DIVERGED = ("learning.lead=-2", "cycles=45", "record=trace", "record.weights=true")


def verdict_of(folder):
    return json.loads((folder / "stability" / "stability.json").read_text())


@pytest.mark.ci
def test_a_run_that_diverges_is_told_with_the_lead_that_holds(stored, tmp_path):
    run = shutil.copytree(stored(*DIVERGED).folder, tmp_path / "run")
    done = python("-m", "cmacexp.stability", "run", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "run/stability/report.html"
    found = verdict_of(run)
    assert (found["verdict"], found["lead"]) == ("grows", -2)
    assert found["growth"] == pytest.approx(1.15, abs=0.02)
    assert len([*(run / "stability" / "figures").iterdir()]) == 2
    assert "lead 1" in done.stdout
    assert call("verify", run).returncode == 0


@pytest.mark.parametrize(
    ("own", "other", "advised"), [(GROWS, HOLDS, "2"), (GROWS, UNDECIDED, "No"), (HOLDS, HOLDS, "")]
)
def test_a_lead_is_advised_where_learning_does_not_hold(own, other, advised):
    verdicts = {lead: Verdict(verdict, 1.0, lead, ()) for lead, verdict in ((1, own), (2, other))}
    found = " ".join(advise(Namespace(lead=1, verdicts=verdicts)))
    assert advised in found
    assert bool(found) == bool(advised)


@pytest.mark.ci
def test_what_does_not_learn_gets_a_verdict_alone_and_the_runs_of_a_folder_one_each(stored, tmp_path):
    for name in "ab":
        shutil.copytree(stored("scenario=force_step").folder, tmp_path / name)
    done = call("stability", tmp_path)
    assert done.returncode == 0, done.stderr
    for name in "ab":
        assert (verdict_of(tmp_path / name)["verdict"], verdict_of(tmp_path / name)["growth"]) == ("undecided", None)
