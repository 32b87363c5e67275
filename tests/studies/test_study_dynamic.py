"""The study of a body with mass: measures by hand, verdicts follow the data, the command leaves a report."""

import csv
from itertools import combinations

import numpy as np
import pytest
from support.command import python

from cmacexp.config.compose import compose_config
from pipelines.analysis.dynamic_body_sections import judged
from pipelines.analysis.dynamic_body_words import ALL, BASE, alone, low_passed, root_mean_square, without
from pipelines.dynamic_body import CHANGES, jobs


def test_slow_errors_pass_and_fast_ones_do_not():
    time = np.arange(0.0, 3.0, 0.002)[:, None]
    for frequency, passes in ((1.0, 1.0), (10.0, 0.5), (100.0, 0.0)):
        wave = np.sin(2.0 * np.pi * frequency * time)
        ratio = root_mean_square(low_passed(wave, 0.002)[500:1000]) / root_mean_square(wave[500:1000])
        assert ratio == pytest.approx(passes, abs=0.02)


def test_verdicts_follow_what_is_good():
    assert judged([True, True]) == "reproduced"
    assert judged([True, False]) == "reproduced in part"
    assert judged([False, False]) == "not reproduced"


def flat(texts):
    return dict(text.split("=", 1) for text in texts)


def test_every_rung_is_left_out_once_and_the_rungs_share_nothing():
    runs = jobs(quick=False)
    for name, texts in CHANGES.items():
        assert flat(runs[without(name)]) == flat(runs[ALL]) | flat(texts)
    assert flat(runs[BASE]) == flat(runs[ALL]) | {k: v for texts in CHANGES.values() for k, v in flat(texts).items()}
    for one, other in combinations(CHANGES.values(), 2):
        assert not flat(one).keys() & flat(other).keys()


def test_a_change_taken_back_is_one_and_feedback_alone_walks_on_the_same_plan():
    runs = jobs(quick=False)
    chosen = compose_config(runs[ALL])
    for name in CHANGES:
        learnt, felt = (compose_config(runs[which]) for which in (without(name), alone(without(name))))
        assert learnt != chosen
        assert felt.feedforward._target_.endswith("NoFeedforward")
        same = ("gait", "force_control", "posture", "terrain", "controller", "sampling_period", "reference", "plant")
        assert all(getattr(learnt, part) == getattr(felt, part) for part in same)


def test_the_command_leaves_a_report(tmp_path):
    done = python("-m", "pipelines.dynamic_body", "--quick", "--folder", str(tmp_path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "dynamic_body-quick"
    with (folder / "claims.csv").open() as file:
        verdicts = {line["claim"]: line["verdict"] for line in csv.DictReader(file)}
    assert verdicts["with the constants of the paper the machine walks"] == "contradicted"
    assert verdicts["learning makes foot positions better"] == "reproduced"
    assert verdicts["learning makes the contact forces better"] == "contradicted"
    assert verdicts["without the posture rate term it is worse than feedback alone"] == "reproduced"
    names = {path.name for path in (folder / "figures").iterdir()}
    assert {"dynamic_ladder.png", "dynamic_learning.png", "dynamic_slow_force.png"} <= names


def test_without_mujoco_it_says_how_to_install_it(tmp_path):
    (tmp_path / "mujoco.py").write_text("raise ImportError('not here')\n")
    done = python("-m", "pipelines.dynamic_body", "--quick", "--folder", "studies", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == 'error: plant=mujoco: MuJoCo is not installed: python -m pip install -e ".[mujoco]"\n'
    assert not (tmp_path / "studies" / "runs").exists()
