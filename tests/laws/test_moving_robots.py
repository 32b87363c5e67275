"""Laws of robots that move: a trot as planned, load and slope by the feet, a push, and a robot that is as built."""

from dataclasses import asdict

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import BadInput, compose_config, make_mechanism, make_scenario, roll_out
from support.robots import EXACT, OWN, ROBOT, TWO, walk_robot

pytestmark = pytest.mark.ci
OWN_ROBOT = (*ROBOT, f"machine.path={OWN}")


def make(*overrides):
    return make_scenario(compose_config([*OWN_ROBOT, *overrides]))


def roll(*overrides):
    return roll_out(make(*overrides))


def test_a_trot_is_walked_as_planned():
    walked = walk_robot(EXACT, "gait=trot", "cycles=4")
    last = slice(-walked.config.steps_per_cycle, None)
    planned = walked.config.body_speed * walked.config.gait.cycle_time
    assert np.ptp(walked.cog_x[last]) == pytest.approx(planned, rel=0.03)
    assert np.abs(np.stack([walked.pitch, walked.roll])[:, last]).max() < 0.03


def test_feet_tell_a_load_and_where_it_is():
    carried = roll(EXACT, *TWO, "cycles=8", "payload.weight=15", "payload.x=0.01", "payload.y=-0.005").carried[-1]
    weight = make_mechanism(compose_config(OWN_ROBOT).machine).weight
    assert carried.weight == pytest.approx(weight + 15, rel=0.01)
    assert_allclose([carried.x, carried.y], np.array([0.01, -0.005]) * 15 / (weight + 15), atol=5e-4)


def test_the_plan_takes_a_third_of_the_change_of_the_load_that_its_feet_measured():
    """With a cycle of 1 s, over 2 s."""
    run = roll(EXACT, *TWO[:-1], "cycles=5", "payload.weight=15", "payload.time=2")
    force, before = run.columns()["force"].sum(axis=1).reshape(5, -1).mean(axis=1), None
    for used in run.carried:
        measured = used.measured_weight
        assert measured == pytest.approx(force[used.cycle - 2], rel=1e-9)
        assert used.weight == pytest.approx(measured if before is None else before + (measured - before) / 3.0)
        before = used.weight
    assert measured - before > 2.0


def test_feet_tell_the_slope_and_then_press_as_desired():
    sloped = ("terrain.slope=0.04", "terrain.slope_start=-1", "cycles=10", *TWO[:-1])
    adapted, fixed = (roll(EXACT, *sloped, f"force_control.load_sharing={how}") for how in ("adaptive", "dynamic"))
    slope = adapted.carried[-1]
    assert [slope.slope_x, slope.slope_y] == pytest.approx([0.04, 0.0], abs=2e-3)
    assert not fixed.carried
    errors = []
    for run in (adapted, fixed):
        last = run.columns()["force"][-len(run.plan.support) :]
        errors.append(np.sqrt(((last - run.plan.force_desired)[run.plan.support] ** 2).mean()))
    assert errors[0] < 0.85 * errors[1]


def test_a_robot_as_built_differs_from_what_its_planner_knows():
    changes = ("joint_friction=0.3", "trunk_mass_factor=1.5", "leg_mass_factor=2", "trunk_shift=0.02")
    built, modelled = make(*TWO, *(f"plant.as_built.{change}" for change in changes)), make(*TWO)
    assert asdict(built.setup.config.gait) == asdict(modelled.setup.config.gait)
    assert_array_equal(built.setup.plan.force_desired, modelled.setup.plan.force_desired)
    legs, one, other = built.plant.robot.legs, built.plant.model, modelled.plant.model
    assert (one.dof_frictionloss[legs.dof] == 0.3).all()
    assert one.body_mass[legs.base] == pytest.approx(1.5 * other.body_mass[legs.base])
    thighs_and_calves = one.jnt_bodyid[legs.joint[:, 1:]]
    assert_allclose(one.body_mass[thighs_and_calves], 2.0 * other.body_mass[thighs_and_calves])
    assert one.body_ipos[legs.base, 0] - other.body_ipos[legs.base, 0] == pytest.approx(0.02)


def built(joint):
    """Every leg joint of the project's robot as ``joint`` says, as an override."""
    names = (f"{leg}_{name}_joint" for leg in ("FL", "FR", "RL", "RR") for name in ("hip", "thigh", "calf"))
    return f"+plant.as_built.joints={{{','.join(f'{name}: {joint}' for name in names)}}}"


def test_joints_as_built_have_friction_and_a_spring_over_their_angle():
    plain = ("rotor_inertia=0.02", "joint_damping=0.3", "joint_friction=0.2")
    even = "{rotor_inertia: 0.02, viscous_friction: 0.3, coulomb_friction: [0.2, 0.2], range: [-3.0, 3.0]}"
    as_all, each = roll(*TWO[:-1], *(f"plant.as_built.{own}" for own in plain)), roll(*TWO[:-1], built(even))
    for name, values in as_all.columns().items():
        assert_array_equal(each.columns()[name], values)
    slanted = make(*TWO, built(even.replace("[0.2, 0.2]", "[0.1, 0.4], offset: 0.05, spring: -0.2")))
    slanted.plant.step(np.full((4, 3), 0.5))
    legs, model, data = slanted.plant.robot.legs, slanted.plant.model, slanted.plant.data
    unit = (slanted.setup.start + 3.0) / 6.0
    assert_allclose(model.dof_frictionloss[legs.dof], 0.1 + 0.3 * unit, rtol=1e-12)
    assert_allclose(data.qfrc_applied[legs.dof], 0.5 + 0.05 - 0.2 * (2.0 * unit - 1.0), rtol=1e-12)
    for joints, words in ((even.replace("-3.0", "4.0"), "the lower one first"), ("", "must be")):
        with pytest.raises(BadInput, match=words):
            make(*TWO, built(joints) if joints else f"+plant.as_built.joints={{FL_hip_joint: {even}}}")


def test_a_push_moves_the_body_by_its_impulse():
    plain, pushed = (roll("gait=trot", "cycles=1", *more).body_columns()["cog_y"]
                     for more in ((), ("plant.push=20", "plant.push_time=0.1")))  # fmt: skip
    begin = round(0.1 / compose_config([*OWN_ROBOT, "gait=trot"]).sampling_period)
    assert_allclose(pushed[: begin + 1], plain[: begin + 1], atol=1e-12)
    assert pushed[2 * begin] > plain[2 * begin] + 1e-4


def test_a_robot_of_another_weight_than_its_model_has_is_refused_after_a_cycle():
    end = roll(*TWO, "plant.as_built.trunk_mass_factor=0.1", "plant.as_built.leg_mass_factor=0.1")
    assert (end.status, end.steps) == ("failed", len(end.plan.support))
