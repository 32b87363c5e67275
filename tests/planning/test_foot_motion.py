"""The planned motion of feet and joints: paths, ramps, the reference of the controller, reach."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import BadInput, foot_position, foot_velocity, get_leg, make_mechanism, make_scenario, trigonometry

from cmacexp.planning.foot_path import cubic, line, quintic, two_cubics
from cmacexp.planning.motion import _plan_samples_plainly, check_apex, make_ramp
from cmacexp.planning.plan import make_plan
from cmacexp.planning.reference import Motion, X, Y

PERIOD = 0.005
lengths, durations = st.floats(-1.0, 1.0), st.floats(0.05, 5.0)


# Foot paths


@given(lengths, lengths, st.floats(-2.0, 2.0), durations)
def test_quintic_meets_position_velocity_and_acceleration_at_both_ends(start, end, speed, duration):
    position, velocity, acceleration = quintic(start, end, speed, np.array([0.0, 1.0]), duration)
    scale = (1.0 + abs(speed) * duration) / duration
    assert_allclose(position, [start, end], atol=1e-12 * (1.0 + abs(speed) * duration))
    assert_allclose(velocity, speed, atol=1e-12 * scale)
    assert_allclose(acceleration, 0.0, atol=1e-11 * scale / duration)


@given(lengths, lengths, st.floats(0.01, 1.0), durations)
def test_vertical_paths_join_both_ends_and_turn_at_mid_transfer_at_their_lift(start, end, lift, duration):
    s = np.array([0.0, 0.5 - 1e-12, 0.5, 1.0])
    for path, resting in ((cubic, slice(2, 3)), (two_cubics, slice(None))):
        position, velocity, _ = path(start, end, lift, s, duration)
        assert_allclose(position, [start, start - lift, start - lift, end], atol=1e-11)
        assert_allclose(velocity[resting], 0.0, atol=1e-9 / duration)
    s = np.linspace(0.0, 1.0, 21)
    position, velocity, acceleration = cubic(start, start, lift, s, duration)
    assert_allclose(position, start - 4.0 * lift * s * (1.0 - s), atol=1e-12)
    assert_allclose(velocity[[0, -1]], [-4.0 * lift / duration, 4.0 * lift / duration], rtol=1e-9)
    assert_allclose(acceleration, 8.0 * lift / duration**2, rtol=1e-9)


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


@pytest.mark.parametrize("shape", ["linear", "cosine"])
@given(st.floats(0.01, 2.0), st.floats(0.0, 3.0))
def test_a_ramp_rises_from_nothing_to_all_at_its_rate(shape, duration, part):
    at, near = part * duration, 1e-6 * duration
    times = np.array([0.0, duration, max(at - near, 0.0), at, at + near])
    (start, end, before, share, after), rate = make_ramp(shape, times, duration)
    assert (start, end) == (0.0, 1.0)
    assert 0.0 <= share <= 1.0
    if abs(part - 1.0) > 1e-5 and part > 1e-5:
        assert_allclose(rate[3] / duration, (after - before) / (2.0 * near), atol=1e-3 / duration)


@pytest.mark.parametrize("gap", [0.02, -0.02])
def test_one_cubic_between_different_depths_needs_a_lift_of_5_quarters_of_the_gap(make_config, gap):
    walk = ("scenario=quadruped", "gait.vertical=cubic")
    check_apex(make_config(*walk, "gait.lift=0.02502"), gap)
    with pytest.raises(BadInput, match=r"gait\.lift"):
        check_apex(make_config(*walk, "gait.lift=0.02498"), gap)


# The motion of feet and joints over a cycle


@pytest.mark.parametrize(
    "gait",
    [
        ("scenario=one_leg",),
        ("scenario=one_leg", "gait.load_ramp=0.1", "gait.vertical=two_cubics"),
        ("scenario=quadruped", "gait.load_ramp=0.06", "gait.vertical=two_cubics", "machine.leg.length_1=0.4"),
    ],
    ids=" ".join,
)
def test_a_foot_moves_with_the_ground_in_support_and_joins_both_ends_in_transfer(plan_of, make_config, gait):
    plan, config = plan_of(*gait), make_config(*gait)
    lift, speed = config.gait.lift, config.gait.stroke / (plan.support[:, 0].sum() * PERIOD)
    depth = plan.desired.position[..., Y] - config.machine.hip_height
    assert_allclose((depth * config.assumed_stiffness)[plan.support], plan.force_desired[plan.support], atol=1e-9)
    for leg, support in enumerate(plan.support.T):
        first = int(np.flatnonzero(support & ~np.roll(support, 1))[0])
        motion = np.roll(np.array(plan.desired)[:, :, leg], -first, axis=1)
        down, up = (Motion(*part) for part in np.split(motion, [support.sum()], axis=1))
        x, y = down.position.T
        assert_allclose(down.velocity[:, X], -speed)
        assert_allclose(x, config.gait.stroke / 2.0 - speed * PERIOD * np.arange(len(x)), atol=1e-12)
        assert_array_equal(down.acceleration, 0.0)
        assert_allclose(up.position[[0, len(up.position) // 2], Y], [y[-1], y[-1] - lift], atol=0.02 * lift)
        landing = np.polynomial.Polynomial.fit(np.arange(-6, 0), up.position[-6:, Y], 3)(0)
        assert landing == pytest.approx(y[0], abs=1e-7)
        of_place, of_rate = np.concatenate(up[:2], axis=1).T, np.concatenate(up[1:], axis=1).T
        for place, rate in zip(of_place, of_rate, strict=True):
            middle = (rate[1:] + rate[:-1]) / 2.0
            curved = np.abs(np.diff(rate)).max()  # or jumps, as at the apex of two cubics
            assert_allclose(np.diff(place), PERIOD * middle, atol=PERIOD * curved)


@pytest.mark.parametrize("overrides", [(), ("gait.load_ramp=0.2", "gait.vertical=two_cubics")], ids=" ".join)
@pytest.mark.parametrize("knee", ["back", "forward"])
def test_planned_joints_move_the_foot_along_the_desired_path(make_config, plan_of, overrides, knee):
    machine = ("scenario=one_leg", "sampling_period=0.002", f"machine.leg.knee={knee}", "machine.leg.length_1=0.4")
    plan, leg = plan_of(*machine, *overrides), get_leg(make_mechanism(make_config(*machine).machine), 0)
    (q, dq, ddq), (foot, velocity, _) = ([values[:, 0] for values in each] for each in (plan.joints, plan.desired))
    assert (np.sign(q[:, 1]) == (-1.0 if knee == "back" else 1.0)).all()
    for k, angles in enumerate(q):
        trig = trigonometry(*angles)
        assert_allclose(foot_position(leg, trig), foot[k], atol=1e-12)
        assert_allclose(foot_velocity(leg, trig, *dq[k]), velocity[k], atol=1e-12)
    inside = np.r_[10:140, 160:290, 410:1490]  # away from where velocity or acceleration jumps
    slope = (dq[inside + 1] - dq[inside - 1]) / 0.004
    assert_allclose(ddq[inside], slope, rtol=1e-3, atol=2e-2)


# What the controller gets


def test_in_support_the_foot_of_the_paper_is_sent_deeper_than_it_is_meant_to_be(plan_of):
    """Desired at 0.6 m, sent to 0.715 m; half as deep on ground that is assumed to be twice as stiff."""
    support = np.arange(600) >= 120
    for ground, desired, sent in (((), 0.6, 0.715), (("terrain.assumed_stiffness=20",), 0.55, 0.665)):
        plan = plan_of("scenario=one_leg", *ground)
        assert_array_equal(plan.support[:, 0], support)
        assert_allclose(plan.progress[:, 0], np.r_[np.arange(120) / 120, np.arange(480) / 480])
        assert_allclose(plan.desired.position[support, 0, Y], desired)
        assert_allclose(plan.reference.position[:, support, 0, Y], sent)
        for followed, wanted in zip(plan.reference[:2], plan.desired[:2], strict=True):
            assert_allclose(followed[..., X], [wanted[..., X]] * 2)
            assert_allclose(followed[:, ~support], [wanted[~support]] * 2)


@pytest.mark.parametrize("ramp", [0.1, 0.4])
def test_a_load_ramp_takes_force_depth_and_reference_up_in_a_line(plan_of, ramp):
    plan = plan_of("scenario=one_leg", f"gait.load_ramp={ramp}", "force_control.desired_force=1.5", "gait.lift=0.25")
    steps = round(ramp / PERIOD)
    wanted = 1.5 * np.minimum(np.arange(480) / steps, 1.0)
    assert_allclose(plan.force_desired[120:, 0], wanted, atol=1e-12)
    assert_allclose(plan.desired.position[120:, 0, Y], 0.5 + wanted / 10.0)
    assert_allclose(plan.desired.velocity[120:, 0, Y], np.where(np.arange(480) < steps, 0.15 / ramp, 0), atol=1e-12)
    assert_allclose(plan.reference.position[0, 120:, 0, Y], 0.5 + 0.215 * wanted)


@pytest.mark.parametrize("damping", [0, 20])
def test_with_the_rate_of_the_load_the_reference_moves_as_its_velocity_says(make_config, plan_of, damping):
    """Of a foot in support, K_n D + c dD/dt is the desired force; without that rate its velocity reference is 0."""
    walk = ("scenario=quadruped", "gait.load_ramp=0.12", "gait.unload_ramp=0.12", f"terrain.damping={damping}")
    config = make_config(*walk)
    method = ("force_control.elasticity=0", "force_control.admittance=0", "reference=force_feedforward")
    moving, still = (plan_of(*walk, *method, f"force_control.load_rate={on}") for on in ("true", "false"))
    assert_array_equal(still.reference.velocity[1, still.support, Y], 0.0)
    for leg, support in enumerate(moving.support.T):
        place, rate, *_, force = (values[1, :, leg] for values in moving.reference)
        inner = support & np.roll(support, 1) & np.roll(support, -1)  # the ends jump, where the foot lifts
        change, sinking = np.roll(place[:, Y], -1) - np.roll(place[:, Y], 1), rate[inner, Y]
        assert_allclose(change[inner], 2.0 * PERIOD * sinking, atol=1e-12)
        depth, fastest = place[inner, Y] - config.machine.hip_height, np.abs(sinking).max()
        balance = config.terrain.stiffness * depth + damping * sinking - force[inner]
        assert np.median(np.abs(balance)) < 1e-2 * damping * fastest + 1e-9
        assert fastest > 0.01


# Reach


@pytest.mark.parametrize(
    ("key", "value", "others"),
    [
        ("gait.stroke", 1.3, ["machine.hip_height=0.4"]),
        ("gait.stroke", 1.3, ["machine.hip_height=0.59", "gait.load_ramp=0.1"]),
        ("gait.lift", 0.55, ["machine.hip_height=0.45"]),
        ("gait.lift", 0.55, ["machine.hip_height=0.45", "machine.leg.length_2=0.25"]),
        ("gait.lift", 1.4, []),  # above the hip
        ("machine.hip_height", 0.8, ["gait.stroke=0"]),
        ("machine.hip_height", 0.8, ["gait.stroke=0", "machine.leg.length_1=0.25"]),
        ("machine.hip_height", 0.8, ["gait.stroke=0", "machine.leg.length_2=0.25"]),
    ],
)
def test_what_is_out_of_reach_is_refused_and_the_limit_named_is_where_reach_ends(plan_of, key, value, others):
    with pytest.raises(BadInput) as caught:
        plan_of(f"{key}={value}", *others)
    limit = float(re.search(r"must be (?:at most|below) (\S+)", str(caught.value))[1])
    assert caught.value.key == key
    assert np.isfinite(plan_of(f"{key}={limit * 0.999}", *others).joints.position).all()
    with pytest.raises(BadInput, match=key):
        plan_of(f"{key}={limit * 1.01}", *others)


@pytest.mark.ci
def test_plans_that_are_compiled_are_those_of_plain_python(make_config, compiled):
    config = make_config("scenario=quadruped", "gait.stroke=0.123", "machine.legs.right_rear.knee=back")
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config, mechanism, True)
    expected = Motion(*np.empty_like(plan.joints))
    _plan_samples_plainly(mechanism, plan.desired, expected)
    assert_array_equal(plan.joints, expected)


def test_a_run_that_changes_its_plan_changes_that_of_no_other(make_config):
    plans, adapts = [], ("learning.start_cycle=2", "force_control.load_sharing=adaptive", "machine.weight=null")
    for feedforward in ("cmac", "none"):
        config = make_config("scenario=quadruped", f"feedforward={feedforward}", *adapts)
        plans.append(make_scenario(config).setup.plan)
        plans[-1].joints.position[...] = plans[-1].reference.position[...] = 0.0
    assert plans[0].start_step == config.steps_per_cycle < 10**12 < plans[1].start_step
    assert make_plan(config, make_mechanism(config.machine), True).joints.position.any()
