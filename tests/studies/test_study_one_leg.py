"""What the study of one leg measures, against made cycles and statics by hand."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.study.results import Results, Row
from pipelines.one_leg_learning import final_feedback, final_share, largest_rise_of_share
from pipelines.one_leg_learning_trace import (
    differentiate,
    feedback_at_lift_off,
    feedback_force,
    force_oscillation,
    force_peak,
    learned_error,
    peak_error,
    phases,
    reference_depth,
    torque_oscillation,
    torque_step,
    touch_down,
    weight_at_foot,
    without_trend,
)

PERIOD, STEPS, LANDING = 0.005, 600, 120
CONFIG = {
    "sampling_period": PERIOD,
    "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
    "force_control": {"desired_force": 1.0, "force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1},
    "terrain": {"stiffness": 10.0},
    "gait": {"stroke": 0.2, "lift": 0.16},
    "machine": {"leg": {"length_1": 0.35, "length_2": 0.35, "mass_1": 0.5, "mass_2": 0.5, "knee": "back"}},
}
STEP = np.arange(STEPS)


def cycle(**columns) -> pd.DataFrame:
    """A cycle of the paper's length that is at rest, but for the columns given."""
    support = STEP >= LANDING
    given = {
        "time": PERIOD * STEP,
        "phase": np.where(support, "support", "transfer"),
        "progress": np.where(support, (STEP - LANDING) / (STEPS - LANDING), STEP / LANDING),
        "force": support.astype(float),
        "q1": np.full(STEPS, 2.2),
        "q2": np.full(STEPS, -1.2),
    }
    torques = ("tau_feedback_1", "tau_feedback_2", "tau_feedforward_1")
    return pd.DataFrame({**given, **dict.fromkeys(("x", "y", "x_desired", "y_desired", *torques), 0.0), **columns})


def wave(first: int, last: int, size: float, samples: int = 6) -> np.ndarray:
    """Zero, but for an oscillation between two samples."""
    return np.where((first <= STEP) & (last > STEP), size * np.sin(2.0 * np.pi * STEP / samples), 0.0)


def test_eq_13_and_its_bias_by_hand():
    assert reference_depth(CONFIG) == pytest.approx(0.215)
    assert learned_error(CONFIG) == pytest.approx(0.215 / 0.205 - 1.0)
    assert feedback_force(CONFIG, 0.0) == pytest.approx(1.0)
    assert feedback_force(CONFIG, 7.4) == pytest.approx((21.5 + 7.4) / 21.5)


def test_weight_at_the_foot_is_that_of_virtual_work():
    """A foot that moves by dy under the weight of knee and foot, with x held, does the work of both weights."""
    length, mass, at, h = 0.35, 0.5, np.array([2.2, -1.2]), 1e-6

    def height(angles: np.ndarray) -> float:
        knee = length * np.sin(angles[0])
        return mass * 9.81 * (2.0 * knee + length * np.sin(angles.sum()))

    def foot(angles: np.ndarray) -> np.ndarray:
        return length * np.array([np.cos(angles[0]) + np.cos(angles.sum()), np.sin(angles[0]) + np.sin(angles.sum())])

    steps = [np.array([h, 0.0]), np.array([0.0, h])]
    motion = np.array([(foot(at + step) - foot(at - step)) / (2.0 * h) for step in steps]).T
    work = np.array([(height(at + step) - height(at - step)) / (2.0 * h) for step in steps])
    down = np.linalg.solve(motion, np.array([0.0, 1.0]))  # joint rates that move the foot straight down
    assert weight_at_foot(cycle(), CONFIG) == pytest.approx(work @ down)


def test_jumps_of_the_desired_speed_stay_jumps():
    rows = cycle(y_desired=np.where(STEP < LANDING, 2.0 * PERIOD * STEP, 7.0))
    assert [(part.start, part.stop) for part in phases(rows)] == [(0, LANDING), (LANDING, STEPS)]
    assert touch_down(rows) == LANDING
    assert differentiate(rows, rows["y_desired"].to_numpy()) == pytest.approx(np.where(STEP < LANDING, 2.0, 0.0))


def test_peaks_count_in_their_phase_alone():
    rows = cycle(x=np.where(STEP == 3, -0.02, np.where(STEP == 300, 9.0, 0.0)), force=np.where(STEP == 3, 9.0, 1.2))
    assert peak_error("x", "stroke")(rows, CONFIG) == pytest.approx(0.1)
    assert force_peak(rows, CONFIG) == pytest.approx(1.2)


def test_a_moving_mean_takes_off_a_slow_change_and_leaves_a_fast_one():
    fast = wave(0, STEPS, 1.0, samples=4)
    left = without_trend(np.linspace(0.0, 1.0, STEPS) + fast, 0.2, PERIOD)[50:-50]
    assert left == pytest.approx(fast[50:-50], abs=0.06)


def test_force_oscillates_in_proportion_and_the_landing_is_no_oscillation():
    calm, wild = (
        force_oscillation(cycle(force=1.0 + wave(LANDING + 60, STEPS, size)), CONFIG) for size in (0.01, 0.02)
    )
    assert wild == pytest.approx(2.0 * calm)
    landing = cycle(force=1.0 + wave(LANDING, LANDING + 15, 1.0))
    assert force_oscillation(landing, CONFIG) == pytest.approx(0.0, abs=1e-12)


def test_torque_that_oscillates_at_touch_down_or_everywhere():
    event = cycle(tau_feedforward_1=wave(LANDING, LANDING + 60, 1.0) + wave(0, STEPS, 0.01))
    assert torque_oscillation(event, CONFIG) == pytest.approx(101.0, rel=0.15)
    everywhere = cycle(tau_feedforward_1=wave(0, STEPS, 1.0))
    assert torque_oscillation(everywhere, CONFIG) == pytest.approx(1.0, rel=0.05)


def test_step_of_the_torque_is_that_of_one_sample_near_touch_down():
    hard = cycle(
        tau_feedback_1=np.where(STEP >= LANDING, 2.0, 0.0), tau_feedforward_1=np.where(STEP >= 500, 9.0, 0.0)
    )
    soft = cycle(tau_feedback_1=np.clip((STEP - LANDING) / 20.0, 0.0, 1.0) * 2.0)
    assert torque_step(hard, CONFIG) == pytest.approx(2.0)
    assert torque_step(soft, CONFIG) == pytest.approx(0.1)


def test_feedback_after_lift_off_is_a_share_of_both_joints():
    early = np.where(STEP < 20, 1.0, 0.0)
    rows = cycle(tau_feedback_1=early, tau_feedback_2=np.where((STEP >= 20) & (STEP < 80), 1.0, 0.0))
    assert feedback_at_lift_off(rows, CONFIG) == pytest.approx(0.25)


def results(status: str, feedback: list[float], share: list[float]) -> Results:
    """Of one run with these metrics by cycle."""
    metrics = {"feedback_rms": np.array(feedback), "feedforward_share": np.array(share)}
    summary = RunSummary(Path("run"), status, "", {}, len(feedback), metrics)
    return Results([Row(summary, {}, {}, {})])


def test_what_feedback_ends_with_counts_from_its_least_and_a_run_that_ended_is_the_worst():
    feedback, share = [1.0, 0.5, *[0.6] * 10], [0.0, 0.8, *[0.7] * 10]
    whole, ended = (results(status, feedback, share) for status in ("completed", "diverged"))
    assert final_feedback(whole) == pytest.approx([1.2])
    assert final_share(whole) == pytest.approx([1.5])
    assert final_feedback(ended) == pytest.approx([np.inf])
    assert final_share(ended) == pytest.approx([5.0])


def test_the_largest_rise_of_the_share_is_that_between_neighbouring_cycles():
    share = [0.0, 0.5, 0.75, 0.7, 0.85]
    assert largest_rise_of_share(results("completed", [1.0] * 5, share)) == pytest.approx([1.2])
