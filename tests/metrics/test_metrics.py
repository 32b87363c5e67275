"""Metrics against cases worked out by hand; what is undefined is NaN, and nothing warns."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.made_traces import NOTHING, PERIOD, make_trace, measure, score

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

ONE_CYCLE = {
    "x": [3e-3, 4e-3, 1e-3, -1e-3, 1e-3, -1e-3], "x_desired": 0.0,
    "y": [0.502, 0.498, 0.509, 0.5, 0.5, 0.5], "y_desired": 0.5,
    "force": [0.0, 0.4, 1.5, 1.2, 1.1, 0.9], "force_desired": [0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
    "tau_feedback_1": [2.0, -2.0, 1.0, -1.0, 1.0, -1.0], "tau_feedback_2": 0.0,
    "tau_feedforward_1": [5.0, -5.0, 3.0, -3.0, 3.0, -3.0], "tau_feedforward_2": -1.0,
    "dq1": [3.0, 3.0, 2.0, 2.0, 2.0, 2.0], "dq2": -0.5,
}  # fmt: skip
UNDEFINED_HERE = (
    "force_rmse_three_feet", "feedback_change", "feedback_growth", "drift_cycle",
    "weight_norm", "memory_used", "cells_colliding", "guard_state",
)  # fmt: skip
BY_HAND = {
    "cycle": 1,
    "leg": 1,
    "transfer_rmse_x": math.sqrt((9.0 + 16.0) / 2.0) * 1e-3,
    "transfer_rmse_y": 2e-3,
    "support_rmse_x": 1e-3,
    "force_rmse": math.sqrt((0.25 + 0.04 + 0.01 + 0.01) / 4.0),
    "force_rmse_cycle": math.sqrt((0.16 + 0.25 + 0.04 + 0.01 + 0.01) / 6.0),
    "force_settled": 1.0,
    "force_steady_state_error": 0.0,
    "force_overshoot": 0.5,
    "force_ripple": 0.1,
    "force_settling_time": NOTHING,  # 0.9 is the last sample, and 10 % off
    "force_iae": (0.5 + 0.2 + 0.1 + 0.1) * PERIOD,
    "force_itae": (0.0 * 0.5 + 0.1 * 0.2 + 0.2 * 0.1 + 0.3 * 0.1) * PERIOD,
    "feedback_rms": 1.0,
    "feedforward_rms": math.sqrt((86.0 / 6.0 + 1.0) / 2.0),
    "torque_peak": 7.0,
    "energy": (2 * 7.0 * 3.0 + 4 * 4.0 * 2.0 + 6 * 1.0 * 0.5) * PERIOD,
    "feedforward_share": 28.0 / 36.0,
    **dict.fromkeys(UNDEFINED_HERE, NOTHING),
}


def test_each_metric_of_one_cycle_is_what_it_is_by_hand():
    found = measure("TTSSSS", **ONE_CYCLE)
    assert {name: values.tolist() for name, values in found.items()} == {
        name: pytest.approx([value], rel=1e-12, abs=1e-12, nan_ok=True) for name, value in BY_HAND.items()
    }


def test_each_cycle_and_leg_has_its_own_row():
    force = np.arange(1.0, 17.0).reshape(8, 2)  # two cycles of four steps, two legs
    metrics = measure("TSSS", rows=8, legs=2, force=force, force_desired=1.0)
    assert metrics["cycle"].tolist() == [1, 1, 2, 2]
    assert metrics["leg"].tolist() == [1, 2, 1, 2]
    assert_allclose(metrics["force_settled"], [7.0, 8.0, 15.0, 16.0])
    assert_allclose(metrics["force_overshoot"], [6.0, 7.0, 14.0, 15.0])


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


def undefined(*names):
    return {name: [NOTHING] for name in names}


OF_TRANSFER, OF_SETTLING = ("transfer_rmse_x", "transfer_rmse_y"), ("force_settling_time", "force_itae")
RELATIVE = ("force_steady_state_error", "force_overshoot")
OF_SUPPORT = (
    "support_rmse_x", "force_rmse", "force_settled", "force_ripple", "force_iae", *RELATIVE, *OF_SETTLING,
)  # fmt: skip
STRADDLING = {"force": [1.1, 1.0, 0.9, 0.0, 0.0, 3.0, 2.0, 1.0], "force_desired": [1.0] * 3 + [0.0] * 2 + [1.0] * 3}
"""Of ``SSSTTSSS``: a support that begins at the sixth sample and ends with the third of the next cycle."""
CUT_SHORT = {
    "rows": 9, "x": [1.0] * 6 + [2.0] * 3, "force": [0.0, 0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 0.0, 3.0],
    "force_desired": 1.0,
}  # fmt: skip
CASES = {
    "no support": (
        "TTTT",
        {"x": 0.1, "force": 0.2},
        {"transfer_rmse_x": [0.1], "force_rmse_cycle": [0.2]} | undefined(*OF_SUPPORT),
    ),
    "no transfer": (
        "SSSS",
        {"x": 0.1, "force": [2.0, 1.0, 1.0, 1.0], "force_desired": 1.0},
        {"support_rmse_x": [0.1], "force_settling_time": [0.1]} | undefined(*OF_TRANSFER),
    ),
    "a single sample": (
        "SSSS",
        {"rows": 1, "x": 0.1, "force": 1.5, "force_desired": 1.0},
        {"cycle": [1], "support_rmse_x": [0.1], "force_rmse": [0.5]}
        | undefined("force_settled", "force_ripple", "force_iae", *RELATIVE, *OF_SETTLING, *OF_TRANSFER),
    ),
    "a last cycle cut short": (
        "TTSSSS",
        CUT_SHORT,
        {
            "transfer_rmse_x": [1.0, 2.0], "force_rmse": [0.5, 2.0], "force_settled": [1.0, NOTHING],
            "force_settling_time": [0.1, NOTHING], "force_iae": [0.1, 0.2],
        },
    ),
    "a support cut short in its second half": (
        "TTSSSS",
        {"rows": 11, "force": 1.0, "force_desired": 1.0},
        {"force_settled": [1.0, 1.0], "force_settling_time": [0.0, NOTHING]},
    ),
    "a desired force that moves in the second half": (
        "TSSSS",
        {"force": 2.0, "force_desired": [0.0, 1.0, 1.0, 1.0, 1.5]},
        {"force_steady_state_error": [2.0 / 1.25 - 1.0]} | undefined("force_overshoot"),
    ),
    "a desired force that moves in the first half": (
        "TSSSS",
        {"force": 2.0, "force_desired": [0.0, 0.0, 0.5, 1.0, 1.0]},
        {"force_overshoot": [1.0]},
    ),
    "a force that stays below": (
        "TSSSS",
        {"force": [0.0, 0.5, 0.8, 0.7, 0.7], "force_desired": 1.0},
        {"force_overshoot": [-0.2], "force_steady_state_error": [-0.3]},
    ),
    "no desired force": ("TSSSS", {"force": 0.5}, undefined(*RELATIVE)),
    "a support that straddles two cycles": (
        "SSSTTSSS",
        STRADDLING,
        {"force_settled": [1.0], "force_ripple": [math.sqrt(0.02 / 3.0)], "force_overshoot": [2.0]}
        | undefined(*OF_SETTLING),
    ),
    "feedback only": ("TS", {"tau_feedback_1": -2.0}, {"feedforward_share": [0.0]}),
    "feedforward only": ("TS", {"tau_feedforward_2": -2.0}, {"feedforward_share": [1.0]}),
    "no torque": ("TS", {}, undefined("feedforward_share")),
    "feedback that changes from cycle to cycle": (
        "TTSS",
        {"rows": 12, "tau_feedback_1": np.repeat([1.0, 4.0, 2.0], 4), "tau_feedback_2": 0.0},
        {"feedback_change": np.array([NOTHING, 3.0, 2.0]) / np.sqrt(2.0)},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("phases", "columns", "expected"), CASES.values(), ids=CASES)
def test_metrics_are_those_of_the_samples_that_are_there_and_else_undefined(phases, columns, expected):
    found = measure(phases, **columns)
    for name, values in expected.items():
        assert_allclose(found[name], values, rtol=1e-7, atol=1e-12, err_msg=name)


def test_of_no_sample_there_is_an_empty_table_whose_columns_have_units():
    table = score(make_trace("TSSS", x=0.0, y=0.0).select(slice(0)), 4).legs
    assert (table.num_rows, {*table.column_names}) == (0, {*BY_HAND})
    assert table.schema.field("force_iae").metadata[b"unit"] == b"N s"
