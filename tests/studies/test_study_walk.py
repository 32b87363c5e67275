"""The study of the walk: moments from a made-up walk, verdicts that follow the data, and the command line."""

import csv
import re

import numpy as np
import pandas as pd
import pytest
from support.command import python

from cmacexp.recording.run_view import LegView, RunView
from cmacexp.recording.window import Window
from pipelines.analysis import walk_claims
from pipelines.analysis.figures_walk import pooled
from pipelines.analysis.gait_events import Walk, gait, instants, lift_off_of_3, touch_down_of_2, touch_down_of_3
from pipelines.analysis.walk_claims import CONTRADICTED, IN_PART, NOT_REPRODUCED, REPRODUCED, End

PERIOD = 0.1
STEPS = 30
TOUCH_DOWN = {1: 0, 2: 15, 3: 24, 4: 9}
HIPS = ((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2))


def a_walk(force=None, cycles=3) -> Walk:
    """A level machine over its hips' feet in a wave gait of 30 steps, duty factor 0.8; forces (30, 4) as planned
    unless given: 10 N in support, none in transfer."""
    sample = np.arange(STEPS)
    support = np.stack([(sample - TOUCH_DOWN[leg]) % STEPS < 24 for leg in range(1, 5)], axis=1)
    desired = np.where(support, 10.0, 0.0)
    force = desired if force is None else np.asarray(force(support, desired.copy()))
    n = STEPS * cycles
    zero = np.zeros(n)
    legs = [
        LegView(
            i + 1,
            "",
            {
                "x": zero,
                "y": zero + 0.5,
                "force": np.tile(force[:, i], cycles),
                "force_desired": np.tile(desired[:, i], cycles),
            },
            np.tile(support[:, i], cycles),
            (0.3, 0.3),
            HIPS[i],
        )
        for i in range(4)
    ]
    names = ("stability_margin", "margin_front", "margin_rear")
    body = {"height": zero + 0.5} | dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll"), zero)
    body |= {name: np.linspace(0.01, 0.2, n) for name in names}
    time = np.arange(n) * PERIOD
    step = np.arange(n)
    window = Window(1, cycles, 1, n)
    return Walk(RunView(legs, time, step, step // STEPS + 1, body, {}, window, "made", ""))


def test_the_gait_is_read_from_the_planned_phases():
    table = gait(a_walk())
    assert table["duty_factor"].tolist() == [0.8] * 4
    assert (table["touch_down"] * STEPS).round().tolist() == [0, 15, 24, 9]
    assert (table["lift_off"] * STEPS).round().tolist() == [24, 9, 18, 3]


def test_a_late_foot_is_late_by_the_steps_that_it_still_carries():
    def late(support, force):
        force[24:26, 0] = 3.0  # foot 3 touches down in step 24; foot 1 should be off
        return force

    table = touch_down_of_3(a_walk(late))
    assert table.index.tolist() == [1, 2, 3]
    assert table["delay"].tolist() == pytest.approx([0.2] * 3)
    assert table["margin"].tolist() == pytest.approx([0.2] * 3)  # four feet, each 0.2 m from the centre
    assert touch_down_of_3(a_walk())["delay"].tolist() == [0.0] * 3


def test_margins_are_those_of_the_feet_that_carry():
    def shared(support, force):
        force[18:24, 1] = np.arange(6.0) + 1.0
        return force

    table = lift_off_of_3(a_walk(shared))
    assert table["correlation"].tolist() == pytest.approx([1.0] * 3)
    assert table["force_2_least"].tolist() == [1.0] * 3
    assert table["rear"].tolist() == pytest.approx([0.0] * 3)  # 1, 2 and 4 leave the centre on the diagonal
    assert touch_down_of_2(a_walk())["front"].tolist() == pytest.approx([0.0] * 3)
    assert touch_down_of_2(a_walk())["front_after"].tolist() == pytest.approx([0.2] * 3)


def test_forces_of_a_lift_off_are_those_of_the_step_in_which_the_foot_leaves():
    def late(support, force):
        force[18, 2] = 4.0  # foot 3 leaves the ground a step after step 18, in which it is to
        return force

    walk = a_walk(late)
    walk.desired[:, 1] = np.arange(len(walk.desired))
    assert lift_off_of_3(walk)["desired_2"].tolist() == [19.0, 49.0, 79.0]


def test_stability_is_restored_when_it_is_for_good():
    def bounce(support, force):
        force[16, 0] = 0.0  # foot 2 touches down in step 15, foot 1 lets go in the next
        return force

    table = touch_down_of_2(a_walk(bounce))
    assert table["restored"].tolist() == pytest.approx([0.2] * 3)
    assert table["force_1_after"].tolist() == [0.0] * 3
    assert touch_down_of_2(a_walk())["restored"].tolist() == [0.0] * 3


def test_instants_follow_the_forces_not_the_plan():
    def shifted(support, force):
        force[18, 2] = 4.0  # foot 3 leaves the ground a step late
        force[14, 1] = 5.0  # foot 2 comes a step early
        return force

    assert instants(a_walk(), 2) == {17: 48, 18: 54, 19: 44, 20: 45}
    assert instants(a_walk(shifted), 2) == {17: 49, 18: 54, 19: 43, 20: 44}


def test_legs_are_pooled_by_root_mean_square_and_shares_by_mean():
    legs = {
        "cycle": [1, 1],
        "transfer_rmse_x": [3.0, 4.0],
        "feedforward_share": [0.2, 0.4],
        "feedback_rms": [1.0, 1.0],
    }
    table = pooled(pd.DataFrame(legs))
    assert table.loc[1, "transfer_rmse_x"] == pytest.approx(np.sqrt(12.5))
    assert table.loc[1, "feedforward_share"] == pytest.approx(0.3)


WAVE = pd.DataFrame({"duty_factor": 0.8, "lift_off": [0.8, 0.3, 0.6, 0.1]}, index=pd.Index([1, 2, 3, 4]))


@pytest.mark.parametrize(
    ("change", "feet", "verdict"),
    [
        ({}, 3, REPRODUCED),
        ({"duty_factor": 0.75}, 3, IN_PART),
        ({"lift_off": [0.6, 0.1, 0.8, 0.3]}, 3, IN_PART),
        ({"lift_off": [0.8, 0.4, 0.6, 0.1]}, 3, IN_PART),
        ({}, 2, CONTRADICTED),
    ],
)
def test_a_wave_lifts_from_hind_to_front(change, feet, verdict):
    assert walk_claims.gait_is_a_wave(WAVE.assign(**change), feet, []).verdict == verdict


@pytest.mark.parametrize(
    ("status", "tilt", "height", "verdict"),
    [
        ("completed", 0.01, 0.502, REPRODUCED),
        ("completed", 0.03, 0.502, IN_PART),
        ("completed", 0.01, 0.53, IN_PART),
        ("fell", 0.01, 0.502, NOT_REPRODUCED),
    ],
)
def test_steady_is_level_and_at_its_height_in_the_end(status, tilt, height, verdict):
    body = pd.DataFrame({"tilt_max": [0.2, 0.2, 0.2, tilt], "height_min": 0.499, "height_max": height})
    body["height_mean"] = 0.5
    claim = walk_claims.walks_steadily(End(status, 1.0, 4), body, 0.5, "", [])
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("without", "with_it", "verdict"),
    [
        ("fell", "completed", REPRODUCED),
        ("completed", "completed", NOT_REPRODUCED),
        ("fell", "fell", NOT_REPRODUCED),
    ],
)
def test_posture_control_is_what_keeps_it_up(without, with_it, verdict):
    claim = walk_claims.posture_carries({"a": End(without, 0.7, 5)}, {"b": End(with_it, 15.0, 5)}, 0.0, [])
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("planned", "measured", "verdict"),
    [(0.02, 0.018, REPRODUCED), (0.1, 0.018, IN_PART), (0.02, -0.001, CONTRADICTED)],
)
@pytest.mark.parametrize("which", ["front", "rear"])
def test_a_margin_is_short_but_positive(planned, measured, verdict, which):
    assert walk_claims.margin_is_short(planned, measured, 0.45, which, []).verdict == verdict


@pytest.mark.parametrize(
    ("least", "correlation", "verdict"),
    [(1.0, 0.99, REPRODUCED), (1.0, 0.2, IN_PART), (0.0, 0.99, IN_PART), (0.0, float("nan"), NOT_REPRODUCED)],
)
def test_an_indicator_follows_the_margin(least, correlation, verdict):
    table = pd.DataFrame(
        {"force_2": 1.4, "desired_2": 1.4, "force_2_least": [2.0, least], "correlation": correlation}
    )
    assert walk_claims.force_2_tells(table, 0.1, []).verdict == verdict


@pytest.mark.parametrize(
    ("force", "margin", "verdict"),
    [
        ([5.0, 4.0, 3.0], 0.1, REPRODUCED),
        ([5.0, 4.0, 3.0], 0.001, IN_PART),
        ([5.0, 4.0, 0.0], 0.1, IN_PART),
        ([0.0, 0.0, 3.0], 0.1, IN_PART),
        ([0.0, 0.0, 0.0], 0.1, NOT_REPRODUCED),
    ],
)
def test_a_late_foot_does_no_harm_while_the_margin_stays(force, margin, verdict):
    table = pd.DataFrame({"force_1": force, "delay": 0.02, "margin": margin})
    assert walk_claims.foot_1_is_late(table, table, 0.015, []).verdict == verdict


@pytest.mark.parametrize(
    ("planned", "after", "restored", "verdict"),
    [
        (0.28, 0.27, 0.0, REPRODUCED),
        (0.28, 0.01, 0.07, IN_PART),
        (0.28, 0.01, 0.2, NOT_REPRODUCED),
        (0.01, 0.27, 0.0, NOT_REPRODUCED),
    ],
)
def test_stability_is_restored_at_once_or_soon_or_not(planned, after, restored, verdict):
    row = {"front_planned": 0.02, "front_planned_after": planned, "front": 0.017, "contact": -0.005, "force_2": 11.0}
    table = pd.DataFrame([row | {"force_1_after": 0.0, "front_after": after, "restored": restored}])
    assert walk_claims.foot_2_restores(table, []).verdict == verdict


@pytest.mark.parametrize(
    ("share", "verdict"), [([0.0, 0.6, 0.9], REPRODUCED), ([0.0, 0.6, 0.7], IN_PART), ([0.0, 0.6, 0.5], CONTRADICTED)]
)
def test_the_feedback_diminishes_from_the_first_cycle_with_cmac(share, verdict):
    claim = walk_claims.feedback_diminishes(pd.Series(share, index=[1, 2, 3]), [])
    assert claim.verdict == verdict
    assert "40 % in cycle 2" in claim.measured


@pytest.mark.parametrize(
    ("factors", "verdict"),
    [((0.1, 0.1, 0.1, 0.5), REPRODUCED), ((0.1, 0.1, 1.1, 0.9), IN_PART), ((1.0, 1.0, 1.1, 0.9), NOT_REPRODUCED)],
)
def test_learning_improves_every_error_or_some_or_none(factors, verdict):
    alone = pd.Series({name: 0.1 for name in walk_claims.ERRORS}, name=20)
    learned = pd.Series(dict(zip(walk_claims.ERRORS, 0.1 * np.array(factors), strict=True)), name=20)
    assert walk_claims.control_improves(learned, alone, "", []).verdict == verdict


def test_the_study_runs_from_the_command_line(tmp_path):
    done = python("-m", "pipelines.quadruped_walking", "--quick", "--folder", "studies", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "studies" / "quadruped_walking-quick"
    page = (folder / "report.html").read_text()
    for number in range(14, 21):
        assert f"Fig. {number}: " in page
        assert (folder / "figures" / f"fig{number}.png").exists()
        assert (folder / "figures" / f"fig{number}.svg").exists()
    with (folder / "claims.csv").open() as file:
        claims = list(csv.DictReader(file))
    assert len(claims) == 12
    assert not re.search(r"\bnan\b|\binf\b", re.sub(r'base64,[^"]*', "", page))
    for link in {run for claim in claims for run in claim["runs"].split()}:
        assert (folder / link / "manifest.json").exists()
