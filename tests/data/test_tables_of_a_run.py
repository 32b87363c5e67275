"""What a walk leaves behind: its tables, their scores, and the refusal of bad input."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.walks import ALL_THREE, LIFT_OFF, PERIOD, STEPS, TOUCH_DOWN

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
