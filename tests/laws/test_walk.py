"""The quadruped walks (Lin & Song 1997, section 6): what it must show, with posture control and without."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support import walks
from support.walks import ALL_THREE, FEEDBACK, FELL, LIFT_OFF, ONE, PATCHY, PERIOD, STEPS, WEIGHT, of_cycle, of_legs

TRUE_MINIMA = [f"true_{name}_min" for name in ("stability_margin", "margin_front", "margin_rear")]
"""A few millimetres at the instant in which feet take over from each other: compared in metres."""


@pytest.fixture(
    params=[ONE, FELL, FEEDBACK, *(pytest.param(each, marks=pytest.mark.ci) for each in (PATCHY, ALL_THREE))],
    ids=" ".join,
)
def any_walk(request, stored):
    return stored(*request.param)


def test_contact_forces_balance_weight_and_moments_and_are_those_of_the_depressed_ground(any_walk):
    force, poses = of_legs(any_walk, "force"), any_walk.body[["height", "pitch", "roll"]].to_numpy()
    foot = np.stack([of_legs(any_walk, name) for name in ("x", "y")], axis=2)
    feet = np.array([*map(walks.feet_in_world, poses, foot)])
    assert_allclose(force.sum(axis=1), WEIGHT, atol=1e-6 * WEIGHT)
    assert_allclose((force[..., None] * feet[..., :2]).sum(axis=1), 0.0, atol=1e-6 * WEIGHT)
    if any_walk.config["terrain"]["patch_spread"] == 0.0:
        assert_allclose(force, 1e4 * np.maximum(0.0, -feet[..., 2]), atol=1e-8)
    assert_array_equal(any_walk.body.supporting_legs, ((force > 0.0) << np.arange(4)).sum(axis=1))


@pytest.mark.parametrize("gait", [(), ("gait.stroke=0.2", "gait.duty_factor=0.9", "gait.cycle_time=4")])
def test_the_centre_of_gravity_advances_by_a_stride_each_cycle(stored, gait):
    run, (stride, cycle_time) = stored(*ONE, *gait), (0.2 / 0.9, 4.0) if gait else (0.3 / 0.8, 3.0)
    assert_allclose(run.body.cog_x, run.body.time * stride / cycle_time, rtol=1e-12)
    assert not run.body.cog_y.any()


@pytest.mark.ci
def test_ten_substeps_change_no_metric_of_the_steady_walk_by_two_percent(stored):
    one, ten = stored(*FEEDBACK), stored(*FEEDBACK, "plant.substeps=10")
    pooled = [walks.pool(run).loc[2:] for run in (ten, one)]
    assert_allclose(*(each.drop(columns=TRUE_MINIMA) for each in pooled), rtol=0.02)
    assert_allclose(*(each[TRUE_MINIMA] for each in pooled), atol=5e-4)
    assert_allclose(*(walks.metrics_of(run).loc[2:] for run in (ten, one)), rtol=0.02)


# With and without posture control


def test_feedback_only_falls_within_a_second(stored):
    run = stored(*FELL, "feedforward=none")
    assert run.status == "fell"
    assert run.manifest["steps"] * PERIOD <= 1.0


def test_a_fall_keeps_trace_and_metrics_and_says_when(stored):
    run = stored(*FELL)
    step, time = re.match(r"at step (\d+) \(t = ([\d.]+) s\): .+", run.manifest["cause"]).groups()
    assert int(step) == run.manifest["steps"] == len(run.body) == len(of_legs(run, "x"))
    assert float(time) == pytest.approx(int(step) * PERIOD)
    assert np.isfinite(of_legs(run, "force")).all()
    assert run.body_metrics.tilt_max[0] > 0.2


def test_the_true_margin_vanishes_in_a_fall_while_the_planned_one_grows(stored):
    last = stored(*FELL).body.tail(10)
    assert (last.stability_margin.diff().dropna() > 0.0).all()
    assert (last.true_stability_margin.diff().dropna() < 0.0).all()
    assert last.true_stability_margin.iloc[-1] < 5e-3


def test_feedback_with_posture_control_is_periodic(stored):
    run = stored(*FEEDBACK)
    metrics, body = walks.metrics_of(run), run.body_metrics.set_index("cycle")
    assert_allclose(metrics.loc[3], metrics.loc[2], rtol=1e-3)
    assert_allclose(body.loc[3], body.loc[2], rtol=1e-3, atol=1e-6)
    for name in ("x", "y", "force", "tau_feedback_2"):  # the right side as the left, half a cycle later
        last = of_cycle(run, name, 3)
        left, right = last[:, [0, 2]], last[:, [1, 3]]
        assert_allclose(np.roll(left, STEPS // 2, axis=0), right, atol=2e-3 * np.abs(left).max())


# All three: feedback, posture control and CMAC


@pytest.mark.ci
def test_the_feedforward_takes_over_and_transfer_errors_fall(stored):
    run = stored(*ALL_THREE)
    share, errors = run.metrics.groupby("cycle").feedforward_share.mean(), walks.pool(run)
    assert share[1] == 0.0
    assert share[2] >= 0.65
    assert share.loc[8:].min() >= 0.8
    for axis, cycle, limit in (("x", 5, 8e-3), ("x", 10, 2e-3), ("y", 5, 22e-3), ("y", 10, 8e-3)):
        assert errors[f"transfer_rmse_{axis}"].loc[cycle:].max() <= limit


@pytest.mark.ci
def test_the_body_levels_off_at_its_height_and_three_feet_press_as_desired(stored):
    run = stored(*ALL_THREE)
    tilt = run.body.groupby("cycle")[["pitch", "roll"]].agg(lambda angle: angle.abs().max()).max(axis=1)
    assert (tilt[[5, 10, 20]] <= [75e-3, 60e-3, 15e-3]).all()
    assert_array_equal(run.body_metrics.tilt_max, tilt)
    assert (run.body[run.body.cycle >= 8].height - 0.5).abs().max() <= 10e-3
    force = walks.pool(run).force_rmse_three_feet
    assert force[1] > 2.0
    assert force.loc[5:].max() < 0.5


@pytest.mark.ci
def test_feet_unload_as_in_figures_17_to_20(stored):
    """Foot 2 falls to 1 to 2 N within 60 ms of the lift-off of foot 3; foot 1 unloads in time once it has learnt."""
    run = stored(*ALL_THREE)
    for cycle in range(10, 21):
        force = of_cycle(run, "force", cycle)[LIFT_OFF[2] : LIFT_OFF[2] + 13, 1]
        assert force[0] > 3.0
        assert 1.0 <= force.min() <= 2.0
    late = [int(np.argmax(of_cycle(run, "force", cycle)[LIFT_OFF[0] :, 0] == 0.0)) for cycle in range(1, 21)]
    assert late[1] * PERIOD >= 0.02
    assert max(late[4:]) * PERIOD <= 0.01


@pytest.mark.ci
def test_with_the_literal_reference_the_body_leans(stored):
    run = stored(*walks.LITERAL)
    tilt = run.body_metrics.set_index("cycle").tilt_max.loc[8:10]
    assert run.status == "completed"
    assert 80e-3 <= tilt.min() <= tilt.max() <= 140e-3
