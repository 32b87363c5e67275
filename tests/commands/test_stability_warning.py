"""The warning before a long run: only where learning diverges, and without effect on the run."""

import hashlib

import pytest
from support.command import cmacexp

from cmacexp.config import config_hash, to_plain
from cmacexp.loop.scenario import make_scenario
from cmacexp.stability import verdict as verdicts
from cmacexp.stability.verdict import GROWS, Verdict
from cmacexp.stability.warn import growth_warning


def told(config):
    return growth_warning(config, make_scenario(config))


def test_the_papers_law_is_warned_of_with_its_cure(make_config):
    warning = told(make_config("scenario=one_leg", "cycles=160"))
    assert "factor of 1.02" in warning
    assert "learning is predicted to diverge" in warning
    assert "learning.lead=1 is predicted to hold" in warning


def test_a_guarded_run_is_warned_that_the_guard_will_act(make_config):
    warning = told(make_config("scenario=one_leg", "cycles=160", "learning.guard=freeze"))
    assert "learning.guard=freeze is predicted to end learning" in warning
    assert "\n" not in warning


@pytest.mark.parametrize(
    "overrides",
    [
        ("cycles=160", "learning.lead=1"),
        ("cycles=100",),
        ("cycles=160", "warn=false"),
        ("cycles=160", "feedforward=none"),
        ("cycles=160", "feedforward=inverse_dynamics"),
        ("cycles=160", "plant.substeps=20"),
        ("cycles=160", "learning.rule=e_modification"),
        ("cycles=160", "learning.rule=weight_smoothing"),
        ("cycles=160", "actuator.delay=1", "learning.lead=auto"),
    ],
)
def test_nothing_is_said_where_learning_holds_or_nothing_is_to_be_told(make_config, overrides):
    assert told(make_config("scenario=one_leg", *overrides)) is None


def test_delay_asks_for_more_lead(make_config):
    assert "learning.lead=2 is predicted to hold" in told(
        make_config("scenario=one_leg", "cycles=160", "actuator.delay=1", "learning.lead=1")
    )


@pytest.mark.parametrize(
    ("growth", "ends", "expected"),
    [
        (1.001, 90, "diverge: the run ends in cycle 90; "),
        (float("nan"), 90, "diverge: the run ends in cycle 90; "),
        (float("nan"), 200, None),
        (1.1, 90, "diverge: its changes grow by a factor of 1.100 per cycle; "),
        (1.001, 0, None),
    ],
)
def test_an_end_before_the_run_does_is_warned_of_whatever_the_growth(
    make_config, monkeypatch, growth, ends, expected
):
    monkeypatch.setattr(verdicts, "assess", lambda *_: Verdict(GROWS, growth, 0, (), 5, ends))
    warning = told(make_config("scenario=one_leg", "cycles=160"))
    assert warning is None if expected is None else expected in warning


def test_the_check_changes_nothing(tmp_path, make_config):
    hashes = []
    for warn in ("true", "false"):
        folder = tmp_path / warn
        done = cmacexp("cycles=120", f"warn={warn}", "record=trace", f"hydra.run.dir={folder}", folder=tmp_path)
        assert done.returncode == 0
        assert ("predicted to diverge" in done.stderr) == (warn == "true")
        hashes.append(hashlib.sha256((folder / "trace.parquet").read_bytes()).hexdigest())
    assert hashes[0] == hashes[1]
    assert len({config_hash(to_plain(make_config(f"warn={warn}"))) for warn in ("true", "false")}) == 1
