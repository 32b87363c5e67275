"""The quadruped walks (Lin & Song 1997, section 6): what it must show, with posture control and without."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.command import python
from support.walks import (
    ALL_THREE,
    FALLING,
    FALLING_AT_ONCE,
    FEEDBACK,
    HIPS,
    LIFT_OFF,
    LITERAL,
    PATCHY,
    PERIOD,
    STEPS,
    WALKS,
    WEIGHT,
)

from cmacexp.data.signals import TRUE_MARGINS

# The plant


def feet_in_world(run):
    """Feet (steps, 4, 3) turned by roll about x, then by pitch about y, then lifted by the height."""
    trace, body = run.trace, run.body
    pitch, roll = (body[name].to_numpy()[:, None] for name in ("pitch", "roll"))
    x, y, z = HIPS[:, 0] + trace["x"], HIPS[:, 1], -trace["y"]
    left, up = y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)
    ahead, up = x * np.cos(pitch) + up * np.sin(pitch), up * np.cos(pitch) - x * np.sin(pitch)
    return np.stack([ahead, left, body.height.to_numpy()[:, None] + up], axis=2)


@pytest.mark.parametrize("command", WALKS, ids=" ".join)
def test_contact_forces_balance_weight_and_moments_at_every_step(walk, command):
    run = walk(*command)
    force, feet = run.trace["force"], feet_in_world(run)
    assert_allclose(force.sum(axis=1), WEIGHT, atol=1e-6 * WEIGHT)
    assert_allclose((force[..., None] * feet[..., :2]).sum(axis=1), 0.0, atol=1e-6 * WEIGHT)


def test_contact_forces_are_those_of_the_depressed_ground(walk):
    run = walk(*ALL_THREE)
    assert_allclose(run.trace["force"], 1e4 * np.maximum(0.0, -feet_in_world(run)[..., 2]), atol=1e-8)


def steady(metrics):
    """Those that are of a cycle by itself; from one to the next a periodic walk changes by rounding alone."""
    return metrics.drop(columns=["feedback_change", "feedback_growth"])


TRUE_MINIMA = [f"{name}_min" for name in TRUE_MARGINS]
"""A few millimetres at the instant in which feet take over from each other: compared in metres."""


def test_ten_substeps_change_no_metric_of_the_steady_walk_by_two_percent(walk):
    one, ten = walk(*FEEDBACK), walk(*FEEDBACK, "plant.substeps=10")
    pooled = [steady(run.pooled().loc[2:]).drop(columns=TRUE_MINIMA) for run in (ten, one)]
    assert_allclose(*pooled, rtol=0.02)
    assert_allclose(*(run.body_metrics[TRUE_MINIMA].loc[2:] for run in (ten, one)), atol=5e-4)
    assert_allclose(steady(ten.metrics.loc[2:]), steady(one.metrics.loc[2:]), rtol=0.02)


def test_ten_substeps_change_nothing_of_learning_by_two_percent_either(walk):
    one, ten = walk(*ALL_THREE).pooled().loc[:5], walk("cycles=5", "plant.substeps=10").pooled()
    ten = ten.drop(columns=TRUE_MINIMA)
    assert_allclose(ten, one[ten.columns], rtol=0.02)


@pytest.mark.parametrize("command", WALKS, ids=" ".join)
def test_a_body_in_balance_has_its_centre_of_gravity_within_the_feet_that_carry(walk, command):
    body = walk(*command).body
    assert body.true_stability_margin.notna().any()
    assert body.true_stability_margin.min() > -1e-6


# With and without posture control


def test_feedback_alone_falls_within_a_second(walk):
    run = walk(*FALLING_AT_ONCE)
    assert run.code == 3
    assert run.manifest["status"] == "fell"
    assert run.manifest["steps"] * PERIOD <= 1.0


def test_a_fall_keeps_trace_and_metrics_and_says_when_and_why(walk):
    run = walk(*FALLING)
    step, time = re.match(r"at step (\d+) \(t = ([\d.]+) s\): .+", run.manifest["cause"]).groups()
    assert int(step) == run.manifest["steps"] == len(run.body) == len(run.trace["x"])
    assert float(time) == pytest.approx(int(step) * PERIOD)
    assert f"fell {run.manifest['cause']}" in run.done.stdout
    assert np.isfinite(run.trace["force"]).all()
    assert run.body_metrics.tilt_max[1] > 0.2
    assert python("-m", "cmacexp.verify", str(run.folder), folder=run.folder).returncode == 0


def test_the_true_margin_vanishes_in_a_fall_while_the_planned_one_grows(walk):
    last = walk(*FALLING).body.tail(10)
    assert (last.stability_margin.diff().dropna() > 0.0).all()
    assert (last.true_stability_margin.diff().dropna() < 0.0).all()
    assert last.true_stability_margin.iloc[-1] < 5e-3


def test_feedback_with_posture_control_is_periodic(walk):
    run = walk(*FEEDBACK)
    assert_allclose(steady(run.metrics.loc[10]), steady(run.metrics.loc[2]), rtol=1e-3)
    assert run.metrics.feedback_change.loc[10].max() < 1e-9
    assert_allclose(run.body_metrics.loc[10], run.body_metrics.loc[2], rtol=1e-3)


def test_feedback_walks_the_right_side_as_the_left_half_a_cycle_later(walk):
    run = walk(*FEEDBACK)
    for name in ("x", "y", "force", "tau_feedback_2"):
        left, right = run.of_cycle(name, 9)[:, [0, 2]], run.of_cycle(name, 9)[:, [1, 3]]
        assert_allclose(np.roll(left, STEPS // 2, axis=0), right, atol=1e-3 * np.abs(left).max())


# All three


@pytest.mark.parametrize(
    ("axis", "cycle", "limit"), [("x", 5, 8e-3), ("x", 10, 2e-3), ("y", 5, 22e-3), ("y", 10, 8e-3)]
)
def test_transfer_error_falls(walk, axis, cycle, limit):
    run = walk(*ALL_THREE)
    assert max(run.transfer_rmse(axis, later) for later in range(cycle, 21)) <= limit


def test_the_feedforward_takes_over(walk):
    run = walk(*ALL_THREE)
    assert run.share(1) == 0.0
    assert run.share(2) >= 0.65
    assert min(run.share(cycle) for cycle in range(8, 21)) >= 0.8


@pytest.mark.parametrize(("cycle", "limit"), [(5, 75e-3), (10, 60e-3), (20, 15e-3)])
def test_the_body_levels_off(walk, cycle, limit):
    body = walk(*ALL_THREE).body
    tilt = body[body.cycle == cycle][["pitch", "roll"]].abs().max(axis=None)
    assert tilt <= limit
    assert walk(*ALL_THREE).body_metrics.tilt_max[cycle] == tilt


def test_the_body_keeps_its_height_from_cycle_8(walk):
    body = walk(*ALL_THREE).body
    assert (body[body.cycle >= 8].height - 0.5).abs().max() <= 10e-3


def test_on_three_feet_forces_are_as_desired_by_cycle_5(walk):
    pooled = walk(*ALL_THREE).pooled().force_rmse_three_feet
    assert pooled[1] > 2.0
    assert pooled.loc[5:].max() < 0.5


# The paper's story (Fig. 17 to 20)


def test_the_force_of_foot_2_falls_to_1_to_2_newtons_within_60_ms(walk):
    run, within = walk(*ALL_THREE), slice(LIFT_OFF[2], LIFT_OFF[2] + 13)
    for cycle in range(10, 21):
        force = run.of_cycle("force", cycle)[within, 1]
        assert force[0] > 3.0
        assert 1.0 <= force.min() <= 2.0


def test_foot_1_unloads_late_early_in_learning_and_in_time_later(walk):
    run = walk(*ALL_THREE)
    late = [int(np.argmax(run.of_cycle("force", cycle)[LIFT_OFF[0] :, 0] == 0.0)) for cycle in range(1, 21)]
    assert late[1] * PERIOD >= 0.02
    assert max(late[4:]) * PERIOD <= 0.01


def test_with_the_literal_reference_the_body_leans(walk):
    run = walk(*LITERAL)
    tilt = run.body_metrics.tilt_max.loc[8:10]
    assert run.code == 0
    assert tilt.min() >= 80e-3
    assert tilt.max() <= 140e-3


@pytest.mark.parametrize("command", WALKS, ids=" ".join)
def test_supporting_legs_are_the_bits_of_the_feet_that_press(walk, command):
    run = walk(*command)
    mask = sum((run.trace["force"][:, leg] > 0.0).astype(int) << leg for leg in range(4))
    assert_array_equal(run.body.supporting_legs, mask)


@pytest.mark.parametrize("gait", [(), ("gait.stroke=0.2", "gait.duty_factor=0.9", "gait.cycle_time=4")])
def test_the_centre_of_gravity_advances_by_a_stride_each_cycle(walk, gait):
    run = walk(*(("cycles=2", *gait) if gait else ALL_THREE))
    stride, cycle_time = (0.2 / 0.9, 4.0) if gait else (0.3 / 0.8, 3.0)
    assert_allclose(run.body.cog_x, run.body.time * stride / cycle_time, rtol=1e-12)
    assert not run.body.cog_y.any()


def test_it_walks_over_patches(walk):
    run = walk(*PATCHY)
    assert run.code == 0
    assert not np.allclose(run.body.height, walk(*ALL_THREE).body.height[: len(run.body)], atol=1e-5)
