"""The study of one leg: verdicts follow the data, statics are those of eq. 13, and the command leaves a report."""

import csv

import numpy as np
import pandas as pd
import pytest
from support.command import python

from cmacexp.data.integrity import faults
from pipelines.analysis import one_leg_claims as claims
from pipelines.analysis import one_leg_torque_claims as torque_claims
from pipelines.analysis.figures_one_leg import derivative, phases, touch_down, velocity_jumps
from pipelines.analysis.one_leg_measures import (
    force_oscillation,
    judged,
    torque_oscillation,
    torque_step,
    without_trend,
)
from pipelines.analysis.one_leg_statics import (
    feedback_force,
    learned_error,
    literal_depth,
    weight_at_foot,
    weight_for,
)
from pipelines.lead_design import both_claim, defaults_claim, objectives

CONFIG = {
    "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
    "force_control": {"desired_force": 1.0, "force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1},
    "terrain": {"stiffness": 10.0},
    "gait": {"stroke": 0.2, "lift": 0.16},
    "machine": {"leg": {"length_1": 0.35, "length_2": 0.35, "mass_1": 0.5, "mass_2": 0.5, "knee": "back"}},
}
PERIOD, STEPS, LANDING = 0.005, 600, 120


def cycle(**columns) -> pd.DataFrame:
    """A cycle of the paper's length that is at rest, but for the columns given."""
    step = np.arange(STEPS)
    support = step >= LANDING
    zero = np.zeros(STEPS)
    given = {
        "time": PERIOD * step,
        "phase": np.where(support, "support", "transfer"),
        "progress": np.where(support, (step - LANDING) / (STEPS - LANDING), step / LANDING),
        "force": support.astype(float),
        "force_desired": support.astype(float),
        "q1": np.full(STEPS, 2.2),
        "q2": np.full(STEPS, -1.2),
    }
    flat = ("x", "y", "x_desired", "y_desired", "tau_feedback_1", "tau_feedforward_1")
    return pd.DataFrame({**given, **dict.fromkeys(flat, zero), **columns})


def metrics(**columns) -> pd.DataFrame:
    """Five cycles in which all is well from the second on, but for the columns given."""
    given = {
        "transfer_rmse_x": [10e-3, 5e-3, 2e-3, 1e-3, 0.5e-3],
        "transfer_rmse_y": [40e-3, 20e-3, 9e-3, 5e-3, 3e-3],
        "support_rmse_x": [10e-3, 5e-3, 2e-3, 1e-3, 0.5e-3],
        "force_rmse": [0.3, 0.2, 0.1, 0.1, 0.1],
        "force_settled": [0.9, 1.0, 1.0, 1.0, 1.0],
        "force_steady_state_error": [-0.1, 0.04, 0.03, 0.02, 0.01],
        "force_ripple": [0.01] * 5,
        "feedback_rms": [1.0, 0.5, 0.4, 0.3, 0.2],
        "feedforward_share": [0.0, 0.5, 0.6, 0.7, 0.8],
    }
    return pd.DataFrame({"cycle": range(1, 6), **given, **columns})


def wave(first: int, last: int, size: float, samples: int = 6) -> np.ndarray:
    """Zero, but for an oscillation between two samples."""
    step = np.arange(STEPS)
    return np.where((step >= first) & (step < last), size * np.sin(2.0 * np.pi * step / samples), 0.0)


def test_parts_of_a_verdict():
    assert judged(True, True) == "reproduced"
    assert judged(True, False) == "reproduced in part"
    assert judged(False, False) == "not reproduced"
    assert judged(False, failed="contradicted") == "contradicted"


def test_eq_13_and_its_bias_by_hand():
    assert literal_depth(CONFIG) == pytest.approx(0.215)
    assert learned_error(CONFIG) == pytest.approx(0.215 / 0.205 - 1.0)
    assert feedback_force(CONFIG, 0.0) == pytest.approx(1.0)
    assert feedback_force(CONFIG, 7.4) == pytest.approx((21.5 + 7.4) / 21.5)
    assert weight_for(CONFIG, feedback_force(CONFIG, 3.0)) == pytest.approx(3.0)


def test_weight_at_the_foot_is_that_of_virtual_work():
    """A foot that moves by dy under the weight of knee and foot, with x held, does the work of both weights."""
    rows = cycle().iloc[[LANDING]]
    q1, q2 = rows["q1"].iloc[0], rows["q2"].iloc[0]
    length, mass = 0.35, 0.5

    def height(angles: np.ndarray) -> float:
        knee = length * np.sin(angles[0])
        return mass * 9.81 * (2.0 * knee + length * np.sin(angles.sum()))

    def foot(angles: np.ndarray) -> np.ndarray:
        return length * np.array([np.cos(angles[0]) + np.cos(angles.sum()), np.sin(angles[0]) + np.sin(angles.sum())])

    h = 1e-6
    steps = [np.array([h, 0.0]), np.array([0.0, h])]
    at = np.array([q1, q2])
    slope = np.array([(height(at + d) - height(at - d)) / (2.0 * h) for d in steps])
    jacobian = np.array([(foot(at + d) - foot(at - d)) / (2.0 * h) for d in steps]).T
    assert weight_at_foot(rows, CONFIG) == pytest.approx(np.linalg.solve(jacobian.T, slope)[1], rel=1e-6)


def test_phases_and_differences_leave_a_jump_a_jump():
    speed = np.where(np.arange(STEPS) < LANDING, 2.0, 0.0)
    rows = cycle(y_desired=np.where(np.arange(STEPS) < LANDING, 2.0 * PERIOD * np.arange(STEPS), 7.0))
    assert [(part.start, part.stop) for part in phases(rows)] == [(0, LANDING), (LANDING, STEPS)]
    assert touch_down(rows) == LANDING
    assert derivative(rows, rows["y_desired"].to_numpy()) == pytest.approx(speed)
    assert velocity_jumps(rows, "y") == pytest.approx((2.0, -2.0))


def test_a_moving_mean_takes_off_a_slow_change_and_leaves_a_fast_one():
    slow = np.linspace(0.0, 1.0, STEPS)
    fast = wave(0, STEPS, 1.0, samples=4)
    left = without_trend(slow + fast, 0.2, PERIOD)[50:-50]
    assert left == pytest.approx(fast[50:-50], abs=0.06)


def test_fairly_large_errors():
    def verdict(x: float, y: float) -> str:
        rows = cycle(x=np.full(STEPS, x), y=np.full(STEPS, y))
        return claims.large_errors(rows, CONFIG, []).verdict

    assert verdict(0.011, -0.009) == "reproduced"
    assert verdict(0.009, 0.009) == "reproduced in part"
    assert verdict(0.0, 0.0) == "not reproduced"


@pytest.mark.parametrize(
    ("fifth", "verdict"),
    [(3e-3, "reproduced"), (9e-3, "reproduced in part"), (39e-3, "not reproduced")],
)
def test_errors_virtually_eliminated(fifth, verdict):
    table = metrics(transfer_rmse_y=[40e-3, 20e-3, 20e-3, 20e-3, fifth])
    assert claims.errors_vanish(table, CONFIG, []).verdict == verdict


def test_force_of_feedback_alone_is_compared_with_both_of_the_papers_figures():
    def judge(peak: float, settled: float):
        force = np.where(np.arange(STEPS) == LANDING + 5, peak, settled)
        table = metrics(force_settled=[settled, 1.0, 1.0, 1.0, 1.0])
        return claims.force_of_feedback(cycle(force=force), table, CONFIG, [])

    assert judge(1.1, 0.9).verdict == "reproduced"
    assert judge(1.1, 1.0).verdict == "reproduced in part"
    assert judge(1.5, 1.35).verdict == "not reproduced"
    assert "lifted with 2.2 N" in judge(1.5, 1.35).measured


def test_below_5_percent_in_the_cycle_of_the_claim_or_later():
    def verdict(*errors: float) -> str:
        return claims.below_5_percent(metrics(force_steady_state_error=[0.3, *errors]), []).verdict

    assert verdict(-0.04, 0.07, 0.04, 0.04) == "reproduced"
    assert verdict(0.07, 0.04, 0.051, 0.049) == "reproduced in part"
    assert verdict(0.07, -0.06, 0.06, 0.06) == "not reproduced"


def test_improvement_and_steadiness_of_the_second_cycle():
    assert claims.some_improvement(metrics(), []).verdict == "reproduced"
    worse = metrics(force_rmse=[0.1] + [0.2] * 4)
    assert claims.some_improvement(worse, []).verdict == "reproduced in part"
    assert claims.force_is_steady(metrics(), CONFIG, []).verdict == "reproduced"
    assert claims.force_is_steady(metrics(force_ripple=[0.03] * 5), CONFIG, []).verdict == "not reproduced"


def test_more_oscillation_is_told_from_less():
    calm, wild = (cycle(force=1.0 + wave(LANDING + 60, STEPS, size)) for size in (0.01, 0.02))
    assert force_oscillation(wild) == pytest.approx(2.0 * force_oscillation(calm))
    assert claims.more_oscillation(calm, wild, []).verdict == "reproduced"
    assert claims.more_oscillation(wild, calm, []).verdict == "contradicted"


def test_the_landing_is_no_oscillation():
    assert force_oscillation(cycle(force=1.0 + wave(LANDING, LANDING + 15, 1.0))) == pytest.approx(0.0, abs=1e-12)


def test_more_learning_is_judged_by_both_errors():
    assert claims.more_learning_is_no_better(metrics(), []).verdict == "contradicted"
    error = [0.3, 0.03, 0.03, 0.04, 0.05]
    assert (
        claims.more_learning_is_no_better(metrics(force_steady_state_error=error), []).verdict == "reproduced in part"
    )
    both = metrics(force_steady_state_error=error, force_rmse=[0.3, 0.1, 0.1, 0.1, 0.2])
    assert claims.more_learning_is_no_better(both, []).verdict == "reproduced"


def test_improvement_in_all_spaces():
    assert claims.all_improve(metrics(), []).verdict == "reproduced"
    assert claims.all_improve(metrics(support_rmse_x=[0.01] * 5), []).verdict == "reproduced in part"


def test_torque_that_oscillates_at_touch_down_or_everywhere():
    event = wave(LANDING, LANDING + 60, 1.0)
    rows = cycle(tau_feedforward_1=event + wave(0, STEPS, 0.01))
    after, middle = torque_oscillation(rows)
    assert after == pytest.approx(np.sqrt(0.5), rel=0.15)
    assert middle == pytest.approx(0.01 * np.sqrt(0.5), rel=0.1)
    assert torque_claims.torque_oscillates_at_events(rows, []).verdict == "reproduced"
    everywhere = cycle(tau_feedforward_1=wave(0, STEPS, 1.0))
    assert torque_claims.torque_oscillates_at_events(everywhere, []).verdict == "not reproduced"


def test_major_part():
    assert torque_claims.major_part(metrics(), []).verdict == "reproduced"
    assert torque_claims.major_part(metrics(feedforward_share=[0.0] + [0.4] * 4), []).verdict == "not reproduced"


def test_a_ramp_is_milder_if_the_torque_steps_less():
    step = np.arange(STEPS)
    hard = cycle(tau_feedback_1=np.where(step >= LANDING, 2.0, 0.0))
    soft = cycle(tau_feedback_1=np.clip((step - LANDING) / 20.0, 0.0, 1.0) * 2.0)
    assert torque_step(hard) == pytest.approx(2.0)
    assert torque_step(soft) == pytest.approx(0.1)
    assert torque_claims.ramp_is_milder(hard, soft, 0.2, []).verdict == "reproduced"
    assert torque_claims.ramp_is_milder(hard, hard, 0.2, []).verdict == "not reproduced"


def test_a_ramp_is_learnt_better_by_torque_and_share():
    less = metrics(feedback_rms=[1.0, 0.5, 0.4, 0.3, 0.1])
    assert torque_claims.ramp_is_learnt_better(metrics(), less, []).verdict == "reproduced in part"
    both = metrics(feedback_rms=[1.0, 0.5, 0.4, 0.3, 0.1], feedforward_share=[0.0, 0.5, 0.6, 0.7, 0.9])
    assert torque_claims.ramp_is_learnt_better(metrics(), both, []).verdict == "reproduced"
    assert torque_claims.ramp_is_learnt_better(both, metrics(), []).verdict == "not reproduced"


def test_feedback_fades_early_and_for_good():
    assert torque_claims.feedback_fades(metrics(), []).verdict == "reproduced"
    grows = pd.concat([metrics(), metrics().iloc[[1]].assign(cycle=6)])
    assert torque_claims.feedback_fades(grows, []).verdict == "reproduced in part"


@pytest.mark.parametrize(
    ("feedback", "status", "verdict"),
    [
        ([1.0, 0.5, 0.4, 0.3, 0.2], "completed", "reproduced"),
        ([1.0, 0.5, 0.4, 0.3, 0.7], "completed", "contradicted"),
        ([1.0, 0.5, 0.4, 0.3, 0.2], "diverged", "contradicted"),
    ],
)
def test_convergence(feedback, status, verdict):
    assert torque_claims.law_converges(metrics(feedback_rms=feedback), status, []).verdict == verdict


def loops(*rows) -> pd.DataFrame:
    names = ("scenario", "omega", "alpha", "resonance", "bandwidth", "open_bandwidth", "stable")
    return objectives(pd.DataFrame(rows, columns=names))


def test_lead_objectives():
    good, peaked, fast, unstable = (
        ("leg", 5.0, 10.0, 1.05, 10.5, 10.0, True),
        ("leg", 5.0, 10.0, 1.20, 10.5, 10.0, True),
        ("leg", 5.0, 10.0, 1.05, 30.0, 10.0, True),
        ("leg", 5.0, 10.0, 1.05, 10.5, 10.0, False),
    )
    assert both_claim(loops(good, fast)).verdict == "reproduced"
    assert both_claim(loops(peaked, fast, unstable)).verdict == "not reproduced"
    assert both_claim(loops(peaked)).verdict == "not reproduced"
    assert defaults_claim(loops(good, fast), "a", "").verdict == "reproduced"
    assert defaults_claim(loops(good, fast), "b", "").verdict == "reproduced in part"
    assert defaults_claim(loops(peaked), "a", "").verdict == "not reproduced"


def read_claims(folder) -> list[dict[str, str]]:
    with (folder / "claims.csv").open() as file:
        return list(csv.DictReader(file))


def test_quick_study_leaves_report_claims_and_figures(tmp_path):
    done = python("-m", "pipelines.one_leg_learning", "--quick", "--folder", "studies", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    report = tmp_path / "studies" / "one_leg_learning-quick"
    assert faults(report) == []
    drawn = {f"fig_{number:02d}" for number in range(7, 14)} | {"one_leg", "bias", "divergence", "exact_model"}
    assert {path.name for path in (report / "figures").iterdir()} == {
        f"{n}.{k}" for n in drawn for k in ("png", "svg")
    }
    found = {row["claim"]: row["verdict"] for row in read_claims(report)}
    assert found["CMAC provides the major part of the overall control torques"] == "reproduced"
    assert all((report / folder).is_dir() for row in read_claims(report) for folder in row["runs"].split())
    page = (report / "report.html").read_text()
    assert all(f"Fig. {number}:" in page for number in range(7, 14))


def test_lead_study_tells_of_a_table_that_its_manifest_lists(tmp_path):
    done = python("-m", "pipelines.lead_design", "--quick", "--folder", "studies", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    report = tmp_path / "studies" / "lead_design-quick"
    assert [row["verdict"] for row in read_claims(report)] == [
        "reproduced in part",
        "not reproduced",
        "not reproduced",
    ]
    table = report / "lead_design.parquet"
    assert faults(report) == []
    table.write_bytes(table.read_bytes() + b" ")
    assert faults(report) == ["lead_design.parquet: changed since it was written"]


@pytest.mark.parametrize("study", ["one_leg_learning", "lead_design"])
def test_help(study, tmp_path):
    done = python("-m", f"pipelines.{study}", "--help", folder=tmp_path)
    assert done.returncode == 0
    assert "--quick" in done.stdout
