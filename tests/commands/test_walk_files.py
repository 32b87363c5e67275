"""What a walk leaves behind: its tables, their scores, and the refusal of bad input."""

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pandas.testing import assert_frame_equal
from support.command import python
from support.walks import ALL_THREE, FALLING, LIFT_OFF, PERIOD, STEPS, TOUCH_DOWN

from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.trace import assemble
from cmacexp.metrics import compute

BODY = {
    "step": "", "time": "s", "cycle": "", "height": "m", "pitch": "rad", "roll": "rad", "yaw": "rad",
    "cog_x": "m", "cog_y": "m",
    "stability_margin": "m", "margin_front": "m", "margin_rear": "m", "supporting_legs": "",
    "true_stability_margin": "m", "true_margin_front": "m", "true_margin_rear": "m",
}  # fmt: skip
BODY_METRICS = {
    "cycle": None, "height_mean": "m", "height_min": "m", "height_max": "m", "tilt_max": "rad",
    "stability_margin_min": "m", "margin_front_min": "m", "margin_rear_min": "m",
    "true_stability_margin_min": "m", "true_margin_front_min": "m", "true_margin_rear_min": "m",
}  # fmt: skip


@pytest.mark.parametrize(("file", "columns"), [("body", BODY), ("body_metrics", BODY_METRICS)])
def test_tables_of_the_body_have_the_columns_of_the_contract_with_unit_and_meaning(walk, file, columns):
    schema = pq.read_schema(walk(*ALL_THREE).folder / f"{file}.parquet")
    assert schema.names == list(columns)
    for name, unit in columns.items():
        if unit is not None:
            assert schema.field(name).metadata[b"unit"].decode() == unit
            assert schema.field(name).metadata[b"meaning"]


def test_files_of_a_walk(walk):
    assert set(walk(*ALL_THREE).manifest["files"]) == {
        "trace.parquet", "body.parquet", "memory.parquet", "metrics.parquet", "metrics.csv", "body_metrics.parquet",
    }  # fmt: skip


def test_a_walk_has_a_row_per_step_and_leg_and_a_row_of_the_body_per_step(walk):
    run = walk(*ALL_THREE)
    assert_array_equal(run.trace["step"], np.tile(np.arange(20 * STEPS)[:, None], 4))
    assert_array_equal(run.body.step, np.arange(20 * STEPS))
    assert_array_equal(run.body.cycle, np.arange(20 * STEPS) // STEPS + 1)
    assert_allclose(run.body.time, np.arange(20 * STEPS) * PERIOD, rtol=1e-15)
    assert run.metrics.index.tolist() == [(cycle, leg) for cycle in range(1, 21) for leg in (1, 2, 3, 4)]
    assert run.body_metrics.index.tolist() == list(range(1, 21))


def test_the_trace_transfers_where_the_gait_diagram_does(walk):
    transfer = walk(*ALL_THREE).of_cycle("phase", 3) == "transfer"
    for leg, (lift_off, touch_down) in enumerate(zip(LIFT_OFF, TOUCH_DOWN, strict=True)):
        assert_array_equal(np.flatnonzero(transfer[:, leg]), range(lift_off, touch_down or STEPS))


THREE_FEET = {
    "whole": ([], np.r_[90:150, 210:270, 390:450, 510:570]),
    "across two cycles": (["gait.touch_down=[0.1, 0.6, 0.9, 0.4]"], np.r_[0:30, 150:210, 270:330, 450:510, 570:600]),
    "cut short by a fall": (["posture.gain=0"], np.r_[90:147]),
}


@pytest.mark.parametrize("case", THREE_FEET)
def test_force_on_three_feet_is_measured_in_the_middle_half_of_their_planned_intervals(make_config, case):
    overrides, middle = THREE_FEET[case]
    rollout = roll_out(make_scenario(make_config("scenario=quadruped", "cycles=1", *overrides)))
    columns = rollout.columns()
    measured = compute(assemble(rollout.plan, columns, PERIOD), STEPS)["force_rmse_three_feet"]
    error = (columns["force"] - rollout.plan.force_desired[: len(rollout.samples)])[middle]
    assert_allclose(measured, np.sqrt((error**2).mean(axis=0)), rtol=1e-12)


def test_body_metrics_are_ranges_and_minima_of_each_cycle(walk):
    run = walk(*ALL_THREE)
    cycles = run.body.groupby("cycle")
    expected = pd.DataFrame(
        {
            "height_mean": cycles.height.mean(),
            "height_min": cycles.height.min(),
            "height_max": cycles.height.max(),
            "tilt_max": cycles[["pitch", "roll"]].agg(lambda angle: angle.abs().max()).max(axis=1),
            **{f"{name}_min": cycles[name].min() for name in BODY if "margin" in name},
        }
    )
    assert_frame_equal(run.body_metrics, expected, rtol=1e-14, check_index_type=False)


def test_score_gives_the_same_metrics_of_the_body_again(walk):
    folder = walk(*FALLING).folder
    before = (folder / "body_metrics.parquet").read_bytes()
    (folder / "body_metrics.parquet").unlink()
    assert python("-m", "cmacexp.score", str(folder), folder=folder).returncode == 0
    assert (folder / "body_metrics.parquet").read_bytes() == before
