"""Laws of robots that move: the sway of a body on two feet, load and slope by the feet, and the course."""

from dataclasses import asdict

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.robot_walks import EXACT, ROBOT, TWO, walk_robot
from support.robots import OWN
from support.rollout import roll_out

from cmacexp.config.compose import compose_config
from cmacexp.control.steering import AHEAD, ASIDE, MOST, TURN, Steering, scale_ahead, scale_aside, steer
from cmacexp.data.manifest_fields import RUN_FIELDS, find_misfit
from cmacexp.errors import BadInput
from cmacexp.loop.adaptation import SMOOTHING
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.body import describe_load
from cmacexp.models.lateness import Lateness
from cmacexp.models.leg import GRAVITY
from cmacexp.models.robot_gains import MOST_SHARE, find_delay_margin
from cmacexp.planning import make_plan
from cmacexp.planning.body_motion import find_pressure, find_sway
from cmacexp.planning.columns import X, Z
from cmacexp.planning.machine import make_mechanism

FEET = np.array([[[0.2, 0.1], [0.2, -0.1], [-0.2, 0.1], [-0.2, -0.1]]])
DIAGONAL = np.array([[1.0, 0.0, 0.0, 1.0]])
OWN_ROBOT = (*ROBOT, f"machine.path={OWN}")


def roll(*overrides):
    return roll_out(make_scenario(compose_config([*OWN_ROBOT, *overrides])))


def test_the_centre_of_pressure_of_two_feet_is_between_them_and_of_four_feet_where_it_is_wanted():
    wanted = np.array([[0.02, 0.03]])
    on_line = find_pressure(FEET, DIAGONAL, wanted)[0]
    assert on_line[1] == pytest.approx(on_line[0] * 0.1 / 0.2)
    assert np.linalg.norm(on_line - wanted) < 1.2 * abs(wanted[0] @ [0.1, -0.2]) / np.hypot(0.1, 0.2)
    assert_allclose(find_pressure(FEET, np.ones((1, 4)), wanted), wanted, atol=0.02)
    assert_allclose(find_pressure(FEET, np.ones((1, 4)), 0.0 * wanted), 0.0, atol=1e-15)


def test_a_swaying_body_presses_where_it_should():
    random, height, period = np.random.default_rng(0), 0.3, 0.002
    pressure = random.normal(size=(50, 2))
    sway = find_sway(pressure, height, period)
    assert_allclose(sway.place - height / GRAVITY * sway.acceleration, pressure, atol=1e-9)
    assert_allclose(sway.rate.sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("gait", ["walk", "amble", "trot"])
def test_forces_of_a_gait_on_two_feet_balance_weight_and_moments(gait):
    config = compose_config([*OWN_ROBOT, f"gait={gait}"])
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config, mechanism, True)
    feet = plan.desired[..., [X, Z]] + mechanism.hips
    force = plan.force_desired
    assert (plan.support.sum(axis=1) == 2).any()
    assert force.min() >= 0.0
    assert_allclose(force.sum(axis=1), plan.load.force)
    centre = (force[..., None] * feet).sum(axis=1) / force.sum(axis=1)[:, None]
    assert_allclose(centre, plan.load.centre, atol=1e-3)
    assert np.abs(np.diff(force, axis=0)).max() < 0.25 * mechanism.weight


def test_a_gait_that_tips_a_body_over_is_refused():
    config = compose_config([*OWN_ROBOT, "gait=pace"])
    with pytest.raises(BadInput, match=r"gait.pattern=pace: tips this body over.* use gait=wave"):
        make_plan(config, make_mechanism(config.machine), True)


def test_a_trot_is_walked_as_planned():
    walked = walk_robot(EXACT, "gait=trot", "cycles=4")
    last = slice(-walked.config.steps_per_cycle, None)
    assert walked.cog_x[last][-1] - walked.cog_x[last][0] == pytest.approx(
        walked.config.body_speed * walked.config.gait.cycle_time, rel=0.03
    )
    assert np.abs(np.stack([walked.pitch, walked.roll])[:, last]).max() < 0.03


def test_feet_tell_a_load_and_where_it_is():
    carried = roll(EXACT, *TWO, "cycles=8", "payload.weight=15", "payload.x=0.01", "payload.y=-0.005").carried[-1][1]
    weight = make_mechanism(compose_config(OWN_ROBOT).machine).weight
    assert carried.weight == pytest.approx(weight + 15, rel=0.01)
    assert_allclose([carried.x, carried.y], np.array([0.01, -0.005]) * 15 / (weight + 15), atol=5e-4)


def test_the_load_that_was_measured_stands_beside_the_part_of_it_that_the_plan_uses():
    run = roll(EXACT, *TWO[:-1], "cycles=5", "payload.weight=15", "payload.time=2")
    force, gain = run.columns()["force"].sum(axis=1), 1.0 / (1.0 + SMOOTHING)
    before = None
    for cycle, used, measured in run.carried:
        last = force[(cycle - 2) * len(run.plan.support) : (cycle - 1) * len(run.plan.support)]
        assert measured == pytest.approx(last.mean(), rel=1e-9)
        assert used.weight == pytest.approx(measured if before is None else before + gain * (measured - before))
        before = used.weight
    assert measured - used.weight > 2.0
    entry = {"cycle": cycle, "measured_weight": measured, **used._asdict()}
    assert f"{used.weight:.4g} N ({measured:.4g} N measured), " in describe_load({"carried": [entry]})
    del entry["measured_weight"]  # as in manifests of earlier versions
    assert f"{used.weight:.4g} N, " in describe_load({"carried": [entry]})
    assert find_misfit([entry], RUN_FIELDS["carried?"], "carried") is None


def test_feet_tell_the_slope_and_then_press_as_desired():
    sloped = ("terrain.slope=0.04", "terrain.slope_start=-1", "cycles=10", *TWO[:-1])
    adapted, fixed = (roll(EXACT, *sloped, f"force_control.load_sharing={how}") for how in ("adaptive", "dynamic"))
    assert adapted.carried[-1][1].slope_x == pytest.approx(0.04, abs=2e-3)
    assert adapted.carried[-1][1].slope_y == pytest.approx(0.0, abs=2e-3)
    errors = []
    for run in (adapted, fixed):
        last = run.columns()["force"][-len(run.plan.support) :]
        errors.append(np.sqrt(((last - run.plan.force_desired)[run.plan.support] ** 2).mean()))
    assert errors[0] < 0.85 * errors[1]
    assert not fixed.carried


def test_a_robot_as_built_differs_from_what_its_planner_knows():
    changes = ("joint_friction=0.3", "trunk_mass_factor=1.5", "leg_mass_factor=2", "trunk_shift=0.02")
    built, modelled = (
        make_scenario(compose_config([*OWN_ROBOT, *TWO, *overrides]))
        for overrides in ([f"plant.as_built.{change}" for change in changes], [])
    )
    assert asdict(built.setup.config.gait) == asdict(modelled.setup.config.gait)
    np.testing.assert_array_equal(built.setup.plan.force_desired, modelled.setup.plan.force_desired)
    legs, one, other = built.plant.robot.legs, built.plant.model, modelled.plant.model
    assert (one.dof_frictionloss[legs.dof] == 0.3).all()
    assert one.body_mass[legs.base] == pytest.approx(1.5 * other.body_mass[legs.base])
    thighs_and_calves = one.jnt_bodyid[legs.joint[:, 1:]]
    assert_allclose(one.body_mass[thighs_and_calves], 2.0 * other.body_mass[thighs_and_calves])
    assert one.body_ipos[legs.base, 0] - other.body_ipos[legs.base, 0] == pytest.approx(0.02)
    assert one.body_subtreemass[0] > 1.2 * other.body_subtreemass[0]


def make_steering(course=1.0, heading=1.0):
    shape = (0.5, 0.001, 0.25, np.zeros((10, 2)), MOST, np.zeros(3))
    return Steering(course, heading, *shape, 0.3, 0.2, np.zeros(1), np.zeros(4))


SUPPORT = np.array([True, False, False, True])


@pytest.mark.parametrize(("travel", "which"), [((-0.01, 0, 0), AHEAD), ((0, -0.01, 0), ASIDE), ((0, 0, -0.01), TURN)])
def test_a_body_off_its_course_is_moved_back(travel, which):
    steering = make_steering()
    steer(steering, np.array(travel, dtype=float), 0, 0, SUPPORT)
    assert 0.0 < steering.command[which] <= MOST
    assert np.count_nonzero(steering.command) == 1
    steer(steering, 100.0 * np.array(travel), 0, 0, SUPPORT)
    assert steering.command[which] == MOST


@pytest.mark.parametrize(("rate", "place"), [(0.5, 0.15), (-0.5, -0.15), (0.9, 0.2), (0.1, 0.0)])
def test_feet_in_transfer_go_where_they_catch_a_body_that_leaves_its_course(rate, place):
    steering = make_steering()
    for step in range(300):
        steer(steering, np.array([0.0, rate * step * steering.period, 0.0]), step, 0, SUPPORT)
    assert_allclose(steering.offset, np.where(SUPPORT, 0.0, place), rtol=1e-3)
    for step in range(300):
        steer(steering, np.zeros(3), step, 0, SUPPORT)
    assert_allclose(steering.offset, 0.0, atol=1e-4)


def test_a_push_moves_the_body_by_its_impulse():
    pushed = roll("gait=trot", "cycles=1", "plant.push=20", "plant.push_time=0.1").body_columns()["cog_y"]
    plain = roll("gait=trot", "cycles=1").body_columns()["cog_y"]
    begin = round(0.1 / compose_config([*OWN_ROBOT, "gait=trot"]).sampling_period)
    assert_allclose(pushed[: begin + 1], plain[: begin + 1], atol=1e-12)
    assert pushed[2 * begin] > plain[2 * begin] + 1e-4


def test_a_robot_of_another_weight_than_its_model_has_is_refused_after_a_cycle():
    end = roll(*TWO, "plant.as_built.trunk_mass_factor=0.1", "plant.as_built.leg_mass_factor=0.1")
    assert (end.status, end.steps) == ("failed", len(end.plan.support))
    assert "feet carried" in end.cause


def test_a_turning_body_moves_its_feet_round_its_centre():
    steering, hips = make_steering(), np.array([[0.2, 0.15], [-0.2, -0.15]])
    steering.command[TURN] = 0.05
    rate, vx = 0.05 * 0.5 / 0.25, -0.5  # of the body, and of a foot that supports
    for i, (x, y) in enumerate(hips):
        assert vx * scale_ahead(steering, hips, i) == pytest.approx(vx + rate * y)
        assert vx * scale_aside(steering, hips, i) == pytest.approx(-rate * x)
    assert (scale_ahead(None, hips, 0), scale_aside(None, hips, 0)) == (1.0, 0.0)


def test_the_margin_of_delay_ends_where_feedback_is_unstable():
    period, foot_mass, lead_gain = 0.001, 0.2, 2.9
    gain = 0.5 * foot_mass / (lead_gain * period)
    margin = find_delay_margin(foot_mass, gain, lead_gain, period, Lateness())
    assert Lateness(margin).find_critical_gain(period) > 0.5 >= Lateness(margin + 1).find_critical_gain(period)
    with pytest.raises(BadInput, match=r"velocity_gain.*unstable.*by rule"):
        find_delay_margin(foot_mass, gain, lead_gain, period, Lateness(2))
    most = MOST_SHARE * Lateness(1).find_critical_gain(period) / 0.5
    assert find_delay_margin(foot_mass, 0.99 * most * gain, lead_gain, period, Lateness(1)) >= 1


def test_stroke_and_cycle_follow_from_the_speed_of_a_robot():
    slow, fast = (compose_config([*OWN_ROBOT, "gait=trot", f"gait.speed={v}"]) for v in (0.2, 2.0))
    for config, speed in ((slow, 0.2), (fast, 2.0)):
        assert config.body_speed == pytest.approx(speed, rel=1e-4)
    assert fast.gait.cycle_time < slow.gait.cycle_time
    assert fast.gait.lift < slow.gait.lift
    with pytest.raises(BadInput, match=r"gait.stroke=0.3: must be .* with gait.speed=0.2"):
        compose_config([*OWN_ROBOT, "gait=trot", "gait.speed=0.2", "gait.stroke=0.3"])
    with pytest.raises(BadInput, match=r"gait.pattern=trot: needs a body that moves"):
        compose_config(["scenario=quadruped", "gait=trot"])
