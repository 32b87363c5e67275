"""Metrics against cases worked out by hand; what is undefined is NaN, and nothing warns."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.made_traces import NOTHING, PERIOD, compute, make_trace, measure

from cmacexp.metrics.registry import METRICS

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def all_nan(metrics, *names):
    return all(np.isnan(metrics[name]).all() for name in names)


FORCE_METRICS = (
    "force_rmse", "force_settled", "force_steady_state_error", "force_overshoot", "force_ripple",
    "force_settling_time", "force_iae", "force_itae",
)  # fmt: skip

ONE_CYCLE = {
    "x": [3e-3, 4e-3, 1e-3, -1e-3, 1e-3, -1e-3], "x_desired": 0.0,
    "y": [0.502, 0.498, 0.509, 0.5, 0.5, 0.5], "y_desired": 0.5,
    "force": [0.0, 0.4, 1.5, 1.2, 1.1, 0.9], "force_desired": [0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
    "tau_feedback_1": [1.0, -1.0] * 3, "tau_feedback_2": 0.0,
    "tau_feedforward_1": [3.0, -3.0] * 3, "tau_feedforward_2": -1.0, "dq1": 2.0, "dq2": -0.5,
}  # fmt: skip
BY_HAND = {
    "transfer_rmse_x": math.sqrt((9.0 + 16.0) / 2.0) * 1e-3,
    "transfer_rmse_y": 2e-3,
    "support_rmse_x": 1e-3,
    "force_rmse": math.sqrt((0.25 + 0.04 + 0.01 + 0.01) / 4.0),
    "force_rmse_three_feet": math.nan,
    "force_rmse_cycle": math.sqrt((0.16 + 0.25 + 0.04 + 0.01 + 0.01) / 6.0),
    "force_settled": 1.0,
    "force_steady_state_error": 0.0,
    "force_overshoot": 0.5,
    "force_ripple": 0.1,
    "force_settling_time": NOTHING,  # 0.9 is the last sample, and 10 % off
    "force_iae": (0.5 + 0.2 + 0.1 + 0.1) * PERIOD,
    "force_itae": (0.0 * 0.5 + 0.1 * 0.2 + 0.2 * 0.1 + 0.3 * 0.1) * PERIOD,
    "feedback_rms": math.sqrt(0.5),
    "feedforward_rms": math.sqrt((9.0 + 1.0) / 2.0),
    "torque_peak": 4.0,
    "energy": (4.0 * 2.0 + 1.0 * 0.5) * 6 * PERIOD,
    "feedforward_share": 4.0 / 5.0,
}
OF_MEMORY = ("weight_norm", "memory_used", "cells_colliding", "guard_state")
BY_HAND |= dict.fromkeys(("feedback_change", "feedback_growth", "drift_cycle", *OF_MEMORY), NOTHING)


@pytest.mark.parametrize("name", METRICS)
def test_metric_of_one_cycle_is_what_it_is_by_hand(name):
    assert_allclose(measure("TTSSSS", **ONE_CYCLE)[name], [BY_HAND[name]], rtol=1e-12, atol=1e-12)


def test_each_cycle_and_leg_has_its_own_row():
    force = np.arange(1.0, 17.0).reshape(8, 2)  # two cycles of four steps, two legs
    metrics = measure("TSSS", rows=8, legs=2, force=force, force_desired=1.0)
    assert metrics["cycle"].tolist() == [1, 1, 2, 2]
    assert metrics["leg"].tolist() == [1, 2, 1, 2]
    assert_allclose(metrics["force_settled"], [7.0, 8.0, 15.0, 16.0])
    assert_allclose(metrics["force_overshoot"], [6.0, 7.0, 14.0, 15.0])


def test_unit_meaning_undefined_and_source_stand_in_the_table():
    table = compute(make_trace("TTSSSS", **ONE_CYCLE), 6)
    assert table.schema.field("force_iae").metadata == {
        b"unit": b"N s",
        b"meaning": b"integral of the absolute force error over support",
        b"undefined": b"no sample of support, or one sample in all",
        b"source": b"Graham & Lathrop 1953",
    }


@pytest.mark.parametrize(
    ("force", "time"),
    [
        ([1.0, 1.0, 1.0, 1.0, 1.0], 0.0),
        ([1.5, 0.5, 1.0, 1.0, 1.0], 0.2),
        ([1.5, 1.0, 1.03, 1.0, 0.99], 0.3),
        ([1.5, 1.0, 1.0, 1.0, 0.9], NOTHING),
        ([0.0, 0.0, 1.0, 2.0, 3.0], NOTHING),
        ([2.0, 1.3, 1.3, 1.3, 1.3], 0.1),  # settled, if not where desired
    ],
)
def test_settling_time_is_from_touch_down_until_within_two_percent_for_good(force, time):
    metrics = measure("TSSSSS", force=[0.0, *force], force_desired=1.0)
    assert_allclose(metrics["force_settling_time"], [time], atol=1e-12)


def test_without_support_force_metrics_are_nan_and_the_others_stand():
    metrics = measure("TTTT", x=0.1, force=0.2)
    assert all_nan(metrics, *FORCE_METRICS, "support_rmse_x")
    assert_allclose(metrics["transfer_rmse_x"], [0.1])
    assert_allclose(metrics["force_rmse_cycle"], [0.2])


def test_without_transfer_transfer_metrics_are_nan_and_the_others_stand():
    metrics = measure("SSSS", x=0.1, force=[2.0, 1.0, 1.0, 1.0], force_desired=1.0)
    assert all_nan(metrics, "transfer_rmse_x", "transfer_rmse_y")
    assert_allclose(metrics["support_rmse_x"], [0.1])
    assert_allclose(metrics["force_settling_time"], [0.1])


def test_of_a_single_sample_what_needs_more_is_nan():
    metrics = measure("SSSS", rows=1, x=0.1, force=1.5, force_desired=1.0)
    assert metrics["cycle"].tolist() == [1]
    assert_allclose([metrics["support_rmse_x"], metrics["force_rmse"]], [[0.1], [0.5]])
    settled = ("force_settled", "force_steady_state_error", "force_overshoot", "force_ripple", "force_settling_time")
    assert all_nan(metrics, *settled, "transfer_rmse_x")
    assert all_nan(metrics, "force_iae", "force_itae")


def test_of_no_sample_there_are_no_metrics():
    table = compute(make_trace("TSSS", **dict.fromkeys(("x", "y"), 0.0)).slice(0, 0), 4)
    assert table.num_rows == 0
    assert table.column_names == ["cycle", "leg", *METRICS]


def test_a_cycle_cut_short_is_measured_as_far_as_it_goes():
    force = [0.0, 0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 0.0, 3.0]
    metrics = measure("TTSSSS", rows=9, x=[1.0] * 6 + [2.0] * 3, force=force, force_desired=1.0)
    assert_allclose(metrics["transfer_rmse_x"], [1.0, 2.0])
    assert_allclose(metrics["force_rmse"], [0.5, 2.0])
    assert_allclose(metrics["force_settled"], [1.0, NOTHING])
    assert_allclose(metrics["force_settling_time"], [0.1, NOTHING])
    assert_allclose(metrics["force_iae"], [0.1, 0.2])


def test_settling_time_of_a_support_cut_short_in_its_second_half_is_nan():
    metrics = measure("TTSSSS", rows=11, force=1.0, force_desired=1.0)
    assert_allclose(metrics["force_settled"], [1.0, 1.0])
    assert_allclose(metrics["force_settling_time"], [0.0, NOTHING])


def test_overshoot_is_nan_where_the_desired_force_moves_in_the_second_half():
    moving = measure("TSSSS", force=2.0, force_desired=[0.0, 1.0, 1.0, 1.0, 1.5])
    assert all_nan(moving, "force_overshoot")
    assert_allclose(moving["force_steady_state_error"], [2.0 / 1.25 - 1.0])
    ramped = measure("TSSSS", force=2.0, force_desired=[0.0, 0.0, 0.5, 1.0, 1.0])
    assert_allclose(ramped["force_overshoot"], [1.0])


def test_errors_keep_their_sign_where_the_force_stays_below():
    metrics = measure("TSSSS", force=[0.0, 0.5, 0.8, 0.7, 0.7], force_desired=1.0)
    assert_allclose(metrics["force_overshoot"], [-0.2])
    assert_allclose(metrics["force_steady_state_error"], [-0.3])


def test_relative_errors_of_no_desired_force_are_nan():
    assert all_nan(measure("TSSSS", force=0.5), "force_overshoot", "force_steady_state_error")


STRADDLING = {"force": [1.1, 1.0, 0.9, 0.0, 0.0, 3.0, 2.0, 1.0], "force_desired": [1.0] * 3 + [0.0] * 2 + [1.0] * 3}
"""Of ``SSSTTSSS``: a support that begins at the sixth sample and ends with the third of the next cycle."""


def test_a_support_that_straddles_two_cycles_settles_in_its_own_second_half():
    metrics = measure("SSSTTSSS", **STRADDLING)
    assert_allclose(metrics["force_settled"], [1.0])
    assert_allclose(metrics["force_ripple"], [math.sqrt(0.02 / 3.0)])
    assert_allclose(metrics["force_overshoot"], [2.0])
    assert all_nan(metrics, "force_settling_time", "force_itae")


def test_feedforward_share_is_0_without_feedforward_1_without_feedback_and_nan_without_torque():
    assert_allclose(measure("TS", tau_feedback_1=-2.0)["feedforward_share"], [0.0])
    assert_allclose(measure("TS", tau_feedforward_2=-2.0)["feedforward_share"], [1.0])
    assert all_nan(measure("TS"), "feedforward_share")
