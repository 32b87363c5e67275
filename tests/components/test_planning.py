"""Laws of the plan: foot paths, timing, references, reach, joints."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.errors import BadInput
from cmacexp.models.leg import foot_position, foot_velocity, trigonometry
from cmacexp.models.mechanism import get_leg
from cmacexp.planning import make_plan
from cmacexp.planning.columns import VY, Y
from cmacexp.planning.foot_path import VERTICAL, cubic, line, quintic, two_cubics
from cmacexp.planning.gait import make_timing
from cmacexp.planning.machine import make_mechanism

ENDS = np.array([0.0, 1.0])
lengths, durations = st.floats(-1.0, 1.0), st.floats(0.05, 5.0)


# Foot paths


@given(lengths, lengths, st.floats(-2.0, 2.0), durations)
def test_quintic_meets_position_velocity_and_acceleration_at_both_ends(start, end, speed, duration):
    position, velocity, acceleration = quintic(start, end, speed, ENDS, duration)
    scale = (1.0 + abs(speed) * duration) / duration
    assert_allclose(position, [start, end], atol=1e-12 * (1.0 + abs(speed) * duration))
    assert_allclose(velocity, speed, atol=1e-12 * scale)
    assert_allclose(acceleration, 0.0, atol=1e-11 * scale / duration)


@given(lengths, lengths, st.floats(0.01, 1.0), durations)
def test_cubic_joins_both_ends_and_turns_at_mid_transfer_at_its_lift(start, end, lift, duration):
    position, velocity, _ = cubic(start, end, lift, np.array([0.0, 0.5, 1.0]), duration)
    assert_allclose(position, [start, start - lift, end], atol=1e-12)
    assert velocity[1] == pytest.approx(0.0, abs=1e-11 / duration)


@given(lengths, st.floats(0.01, 1.0), durations)
def test_cubic_between_equal_ends_is_a_parabola_that_starts_with_a_jump_in_velocity(y0, lift, duration):
    s = np.linspace(0.0, 1.0, 21)
    position, velocity, acceleration = cubic(y0, y0, lift, s, duration)
    assert_allclose(position, y0 - 4.0 * lift * s * (1.0 - s), atol=1e-12)
    assert_allclose(velocity[[0, -1]], [-4.0 * lift / duration, 4.0 * lift / duration], rtol=1e-9)
    assert_allclose(acceleration, 8.0 * lift / duration**2, rtol=1e-9)


@pytest.mark.parametrize("path", VERTICAL)
@pytest.mark.parametrize("end", [0.6, 0.5, 0.63])
def test_nothing_is_higher_than_the_apex_at_mid_transfer(path, end):
    s = np.linspace(0.0, 1.0, 1001)
    position = VERTICAL[path](0.6, end, 0.16, s, 0.6)[0]
    assert s[position.argmin()] == 0.5
    assert position.min() == pytest.approx(0.6 - 0.16)


@given(lengths, lengths, st.floats(0.01, 1.0), durations)
def test_two_cubics_rest_at_both_ends_and_at_the_apex(start, end, lift, duration):
    position, velocity, _ = two_cubics(start, end, lift, np.array([0.0, 0.5 - 1e-12, 0.5, 1.0]), duration)
    assert_allclose(position, [start, start - lift, start - lift, end], atol=1e-11)
    assert_allclose(velocity, 0.0, atol=1e-9 / duration)


@pytest.mark.parametrize(
    "path",
    [
        lambda s, t: line(0.1, -0.1, s, t),
        lambda s, t: quintic(-0.1, 0.1, -0.08, s, t),
        lambda s, t: cubic(0.6, 0.55, 0.16, s, t),
        lambda s, t: two_cubics(0.6, 0.55, 0.16, s, t),
    ],
    ids=["line", "quintic", "cubic", "two_cubics"],
)
def test_velocity_and_acceleration_are_derivatives(path):
    duration, h = 0.7, 1e-6
    s = np.array([0.03, 0.2, 0.4, 0.6, 0.8, 0.97])
    before, now, after = (path(s + shift, duration) for shift in (-h, 0.0, h))
    for order in (0, 1):
        slope = (after[order] - before[order]) / (2.0 * h * duration)
        assert_allclose(now[order + 1], slope, rtol=1e-6, atol=1e-6)


# Timing


def test_one_leg_transfers_in_steps_0_to_119_and_supports_in_120_to_599(plan_of):
    plan = plan_of("scenario=one_leg")
    assert_array_equal(plan.support[:, 0], np.arange(600) >= 120)
    assert_allclose(plan.progress[:120, 0], np.arange(120) / 120)
    assert_allclose(plan.progress[120:, 0], np.arange(480) / 480)


def gait(pattern, duty_factor):
    return SimpleNamespace(pattern=pattern, duty_factor=duty_factor, touch_down=None)


@given(st.integers(2, 5000), st.data())
def test_duty_factor_is_exact_and_phases_are_half_open(samples, data):
    support = data.draw(st.integers(1, samples - 1))
    timing = make_timing(gait("transfer_first", support / samples), samples)
    assert_array_equal(timing.support[:, 0], np.arange(samples) >= samples - support)
    assert (timing.transfer_samples, timing.support_samples) == (samples - support, support)
    assert_array_equal(timing.sample[:, 0], [*range(samples - support), *range(support)])
    assert timing.progress.min() == 0.0
    assert timing.progress.max() < 1.0


@given(st.integers(2, 5000))
def test_standing_is_one_support_phase(samples):
    timing = make_timing(gait("standing", 1.0), samples)
    assert timing.support.all()
    assert_array_equal(timing.sample[:, 0], np.arange(samples))


# Plan


def test_in_support_the_foot_is_meant_to_be_at_0_6_and_is_sent_to_0_715(plan_of):
    plan = plan_of("scenario=one_leg")
    support = plan.support[:, 0]
    assert_allclose(plan.desired[support, 0, 1], 0.6)
    assert_allclose(plan.reference[:, support, 0, 1], 0.5 + 0.215)
    assert_allclose(plan.force_desired[:, 0], support * 1.0)
    assert_allclose(plan.reference[:, ~support, :, :4], [plan.desired[~support, :, :4]] * 2)
    assert_allclose(plan.reference[:, support, 0, 0], [plan.desired[support, 0, 0]] * 2)


def test_planned_depression_follows_the_assumed_stiffness(plan_of):
    plan = plan_of("scenario=one_leg", "terrain.assumed_stiffness=20", "terrain.stiffness=5")
    support = plan.support[:, 0]
    assert_allclose(plan.desired[support, 0, 1], 0.55)
    assert_allclose(plan.reference[:, support, 0, 1], 0.5 + 0.165)


def test_the_foot_is_lifted_by_the_lift_above_where_it_took_off(plan_of):
    for overrides in ([], ["gait.load_ramp=0.1"], ["gait.vertical=two_cubics", "gait.load_ramp=0.1"]):
        y = plan_of("scenario=one_leg", *overrides).desired[:, 0, 1]
        assert y.argmin() == 60
        assert y[60] == pytest.approx(y[-1] - 0.16)


def test_load_ramp_takes_the_desired_force_up_in_a_line(plan_of):
    plan = plan_of("scenario=one_leg", "gait.load_ramp=0.1", "force_control.desired_force=1.5", "gait.lift=0.25")
    wanted = 1.5 * np.minimum(np.arange(480) / 20, 1.0)
    assert_allclose(plan.force_desired[120:, 0], wanted, atol=1e-12)
    assert_allclose(plan.desired[120:, 0, 1], 0.5 + wanted / 10.0)
    assert_allclose(plan.desired[120:, 0, 3], np.where(np.arange(480) < 20, 1.5, 0.0))
    assert_allclose(plan.reference[0, 120:, 0, 1], 0.5 + 0.215 * wanted)


@pytest.mark.parametrize("ramp", [0.1, 0.25, 0.4])
def test_the_planned_rate_of_the_load_adds_up_to_the_desired_depression(plan_of, ramp):
    """No sample more than the ramp has."""
    plan = plan_of("scenario=one_leg", f"gait.load_ramp={ramp}")
    descent = 0.005 * np.where(plan.support[:, 0], plan.desired[:, 0, VY], 0.0).sum()
    assert descent == pytest.approx(plan.desired[plan.support[:, 0], 0, Y].max() - 0.5)


@pytest.mark.parametrize("overrides", [[], ["gait.load_ramp=0.2"], ["gait.vertical=two_cubics"]])
@pytest.mark.parametrize("knee", ["back", "forward"])
def test_planned_joints_move_the_foot_along_the_desired_path(make_config, overrides, knee):
    legs = f"machine.leg.knee={knee}", "machine.leg.length_1=0.4"
    config = make_config("scenario=one_leg", "sampling_period=0.001", *legs, *overrides)
    mechanism = make_mechanism(config.machine)
    plan, leg = make_plan(config, mechanism, True), get_leg(mechanism, 0)
    joints, desired = plan.joints[:, 0], plan.desired[:, 0]
    assert (np.sign(joints[:, 1]) == (-1.0 if knee == "back" else 1.0)).all()
    for q, foot in zip(joints, desired, strict=True):
        trig = trigonometry(q[0], q[1])
        assert_allclose(foot_position(leg, trig), foot[:2], atol=1e-12)
        assert_allclose(foot_velocity(leg, trig, q[2], q[3]), foot[2:4], atol=1e-12)
    inside = np.r_[10:290, 310:590, 810:2990]  # away from where velocity or acceleration jumps
    slope = (joints[inside + 1, 2:4] - joints[inside - 1, 2:4]) / 0.002
    assert_allclose(joints[inside, 4:], slope, rtol=1e-3, atol=1e-2)


# Reach


def refusal(plan_of, *overrides):
    """The key that a plan is refused for, and the limit that the message names."""
    with pytest.raises(BadInput) as caught:
        plan_of(*overrides)
    return caught.value.key, float(re.search(r"must be (?:at most|below) (\S+)", str(caught.value))[1])


@pytest.mark.parametrize("hip_height", [0.3, 0.4, 0.5, 0.58, 0.59])
@pytest.mark.parametrize("ramp", [0.0, 0.1])
def test_a_stroke_out_of_reach_is_refused_and_the_limit_named_can_be_reached(plan_of, hip_height, ramp):
    others = f"machine.hip_height={hip_height}", f"gait.load_ramp={ramp}"
    key, limit = refusal(plan_of, "gait.stroke=1.3", *others)
    assert key == "gait.stroke"
    assert np.isfinite(plan_of(f"gait.stroke={limit}", *others).joints).all()
    assert refusal(plan_of, f"gait.stroke={limit * 1.01}", *others)[0] == "gait.stroke"


@pytest.mark.parametrize("second", [0.35, 0.25])
def test_a_lift_that_folds_the_leg_is_refused_and_just_below_the_limit_named_is_not(plan_of, second):
    leg = f"machine.leg.length_2={second}", "machine.leg.length_1=0.35", "machine.hip_height=0.45"
    key, limit = refusal(plan_of, "gait.lift=0.55", *leg)
    assert key == "gait.lift"
    assert np.isfinite(plan_of(f"gait.lift={limit * 0.999}", *leg).joints).all()


def test_a_hip_out_of_reach_is_refused_by_its_height(plan_of):
    key, limit = refusal(plan_of, "machine.hip_height=0.8", "gait.stroke=0")
    assert key == "machine.hip_height"
    assert np.isfinite(plan_of(f"machine.hip_height={limit * 0.999}", "gait.stroke=0").joints).all()


def test_a_lift_above_the_hip_out_of_reach_is_not_blamed_on_the_hip(plan_of):
    with pytest.raises(BadInput) as caught:
        plan_of("gait.lift=1.4")
    assert caught.value.key == "gait.lift"
