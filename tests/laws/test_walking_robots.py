"""A robot of the project's own walks: what physics, plan and controller must agree about."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import SmallMargin, find_centres, height_at, make_ground, stiffness_at
from support.robots import (
    EXACT,
    HEAVY,
    ON_MODEL,
    OWN,
    RIGID,
    ROBOT,
    SHORT,
    TWO,
    UNGUARDED,
    change,
    find_feet,
    find_foot_error,
    find_torque,
    in_world,
    needs_models,
    over_last_cycle,
    read,
    walk_robot,
)

import cmacexp

pytestmark = pytest.mark.ci
PAYLOAD = ("payload.weight=20", "payload.x=0.06", "payload.y=-0.04")
on_both_grounds = pytest.mark.parametrize("plant", [(), (RIGID,)], ids=["elastic", "rigid"])

# The plant


@on_both_grounds
@pytest.mark.parametrize("payload", [(), PAYLOAD], ids=["alone", "with a payload"])
def test_over_a_cycle_the_ground_bears_the_weight_below_masses_and_payload(plant, payload):
    walked = walk_robot(EXACT, *TWO, *plant, *payload)
    load, weight = walked.config.payload, walked.setup.mechanism.weight
    borne = over_last_cycle(walked, walked.force.sum(axis=1))
    assert borne == pytest.approx(weight + load.weight, rel=1e-3)
    centre = find_centres(walked.config.machine, np.stack([walked.q1, walked.q2, walked.q3], axis=2)).T
    pressed = (walked.force[..., None] * find_feet(walked)).sum(axis=1)
    masses = weight * in_world(walked, centre) + load.weight * in_world(walked, np.array([load.x, load.y, 0.0]))
    assert_allclose(over_last_cycle(walked, pressed - masses)[:2], 0.0, atol=0.1)


@on_both_grounds
def test_the_body_advances_by_a_stride_each_cycle_and_by_what_spheres_roll_on_a_rigid_floor(plant):
    walked = walk_robot(EXACT, *TWO, *plant)
    gait, joints, support = walked.config.gait, walked.setup.plan.joints, walked.setup.plan.support
    angle = joints.position[..., 1:].sum(axis=2)
    turned = [np.ptp(angle[:, leg][support[:, leg]]) for leg in range(4)]
    rolled = read().model.geom("FL").size[0] * np.mean(turned) if plant else 0.0
    advance = walked.cog_x[-1] - walked.cog_x[-1 - walked.config.steps_per_cycle]
    assert advance == pytest.approx((gait.stroke + rolled) / gait.duty_factor, rel=0.02)


FEET = 'size="0.02" contype="1" conaffinity="1" condim="3" friction="0.8"'
OWN_FLOOR = '<geom name="floor" type="plane" size="0 0 0.01" contype="1" conaffinity="1"/>'
SAME_FLOOR = {
    "feet with a margin": (FEET, f'{FEET} margin="0.002"'),
    "feet with a gap": (FEET, f'{FEET} margin="0.003" gap="0.001"'),
    "rough feet": (FEET, FEET.replace("0.8", "2.0")),
    "soft feet": (FEET, f'{FEET} solref="0.05 1" solimp="0.5 0.6 0.01" priority="3"'),
    "feet that touch nothing": (FEET, 'size="0.02"'),
    "no floor": (OWN_FLOOR, ""),
    "a pair": ("<actuator>", '<contact><pair geom1="FL" geom2="floor"/></contact><actuator>'),
    "a pair of feet": ("<actuator>", '<contact><pair geom1="FL" geom2="FR" margin="1"/></contact><actuator>'),
    "contacts switched off": (
        "<worldbody>",
        '<option><flag contact="disable" override="enable"/></option><worldbody>',
    ),
}


@pytest.mark.parametrize("what", SAME_FLOOR)
def test_what_a_model_says_of_contacts_does_not_change_the_rigid_floor(tmp_path, what):
    own = walk_robot(EXACT, RIGID, *SHORT)
    other = walk_robot(EXACT, RIGID, *SHORT, path=change(tmp_path, *SAME_FLOOR[what]))
    assert own.force.max() > 0.2 * own.setup.mechanism.weight
    for name in ("force", "q2", "cog_x"):
        assert_allclose(vars(other)[name], vars(own)[name], rtol=0, atol=1e-9)


def test_feet_feel_the_elastic_ground_below_them_on_slopes_patches_and_after_a_step():
    """Its stiffness times the depth, of every foot at every step; without damping."""
    slope = ("terrain.slope=0.08", "terrain.slope_start=0.05")
    patches = ("terrain.patch_spread=0.3", "terrain.patch_size=0.05")
    step = ("terrain.step_time=0.5", "terrain.step_factor=0.7", "terrain.step_legs=[2]")
    walked = walk_robot(EXACT, *TWO, "terrain.damping=0", *slope, *patches, *step)
    feet, terrain, period = find_feet(walked), walked.config.terrain, walked.config.sampling_period
    ground = make_ground(terrain, period)
    stiffness = np.array([[stiffness_at(ground, *foot) for foot in row] for row in feet[..., :2]])
    stiffness[round(0.5 / period) :, 1] *= 0.7
    depth = height_at(0.08, 0.05, feet[..., 0]) - feet[..., 2]
    within = (np.abs(feet[..., :2] % 0.05 - 0.025) < 0.02499).all(axis=2)  # not on the edge of a patch
    assert_allclose(walked.force[within], (stiffness * np.maximum(depth, 0.0))[within], atol=1e-6)
    assert walked.cog_x[-1] > 0.1
    assert_allclose(walked.height, walked.config.machine.hip_height, atol=0.01)


@pytest.mark.parametrize("friction", [0.05, 0.8])
def test_the_ground_pushes_a_foot_at_its_centre_with_no_more_than_friction_can(friction):
    walked = walk_robot(EXACT, *SHORT, f"plant.friction={friction}", *PAYLOAD)
    data, legs = walked.plant.data, read().legs
    feet = walked.plant.model.geom_bodyid[legs.foot_geom]
    force, moment = np.split(data.xfrc_applied, 2, axis=1)
    assert set(np.flatnonzero(force.any(axis=1))) <= {legs.base, *feet}
    pushed, arm = force[feet], data.xipos[feet] - data.geom_xpos[legs.foot_geom]
    assert_allclose(moment[feet] + np.cross(arm, pushed), 0.0, atol=1e-12)
    assert_allclose(pushed[:, 2], walked.plant.measure().force)
    sideways = np.linalg.norm(pushed[:, :2], axis=1)
    assert (sideways <= friction * pushed[:, 2] * (1.0 + 1e-12)).all()
    assert sideways.max() > 1.0


def test_a_mirrored_robot_walks_a_mirrored_gait_as_a_mirror_shows_it(tmp_path):
    mirrored = change(tmp_path, 'pos="0.05 0.03 0.05"', 'pos="0.05 -0.03 0.05"')
    gait = "gait.touch_down=[0.5, 0.0, 0.25, 0.75]"
    one, other = walk_robot(EXACT, *TWO), walk_robot(EXACT, *TWO, gait, path=mirrored)
    for name in ("x", "y", "z", "q1", "q2", "q3", "force", "tau_feedback_1", "tau_feedforward_1", "tau_feedback_3"):
        own, sign = vars(one)[name], -1.0 if name.endswith(("z", "1")) else 1.0
        mirror = sign * vars(other)[name][:, [1, 0, 3, 2]]
        assert_allclose(mirror, own, rtol=0, atol=1e-4 * np.ptp(own), err_msg=name)
    for name in ("height", "pitch", "roll", "yaw", "cog_x", "cog_y"):
        sign = -1.0 if name in ("roll", "yaw", "cog_y") else 1.0
        assert_allclose(vars(other)[name] * sign, vars(one)[name], rtol=0, atol=1e-6, err_msg=name)


# Feedforward; the guard of learning would begin with a cycle of feedback only


@on_both_grounds
def test_the_better_the_model_the_smaller_the_error_of_feet_and_a_cmac_mends_one_that_is_too_heavy(plant):
    kinds = ([EXACT], [EXACT, HEAVY], ["feedforward=none"], [ON_MODEL, HEAVY, UNGUARDED])
    exact, heavy, none, mended = (find_foot_error(walk_robot(*kind, *TWO, *plant)) for kind in kinds)
    assert 2.0 * exact < heavy < none / 2.0
    assert mended < heavy / 2.0


def test_the_trace_splits_the_feedforward_into_the_model_and_what_is_learned(tmp_path):
    settings = (*ROBOT, f"machine.path={OWN}", HEAVY, *SHORT, "cycles=2", "warn=false", "record=trace", UNGUARDED)
    first, second = (
        cmacexp.run([*settings, ON_MODEL, f"learning.start_cycle={n}"], tmp_path / str(n)).trace for n in (1, 2)
    )
    model = walk_robot(EXACT, HEAVY, *SHORT)
    for n in (1, 2, 3):
        total, known = (first[f"tau_{part}_{n}"].to_numpy().reshape(-1, 4) for part in ("feedforward", "model"))
        assert_allclose(known, np.tile(vars(model)[f"tau_feedforward_{n}"], (2, 1)), atol=1e-12)
        learned = np.abs(total - known)
        assert not learned[0].any()
        assert learned[len(learned) // 2 :].max() > 0.01
        assert not second[second.cycle == 1][[f"tau_model_{n}", f"tau_feedforward_{n}"]].to_numpy().any()


@needs_models
@pytest.mark.parametrize("machine", ["go1", "go2", "mini_cheetah"])
def test_a_real_robot_walks_and_learns(machine, tmp_path):
    run = cmacexp.run(["scenario=robot", f"machine={machine}", "cycles=3", "record=metrics"], tmp_path)
    errors = run.metrics.groupby("cycle")["transfer_rmse"].mean().tolist()
    assert (run.status, len(errors)) == ("completed", 3)
    assert errors[-1] < 0.6 * errors[0]


# Actuators


def test_no_torque_exceeds_the_limit_of_the_actuator_or_that_of_its_joint(tmp_path):
    weak = change(tmp_path, '<motor ctrlrange="-40 40"/>', '<motor ctrlrange="-7 7"/>')
    free, limited, by_model = (
        np.abs(find_torque(walk_robot(EXACT, *SHORT, *limit, path=path))).max(axis=(0, 1))
        for limit, path in (((), OWN), (("actuator.torque_limit=7.5",), OWN), ((), weak))
    )
    assert free[2] > 10.0
    assert limited.max() == pytest.approx(7.5, rel=1e-12)
    assert by_model[2] == pytest.approx(7.0, rel=1e-12)
    assert by_model[0] > 8.0


BY_RULE = (
    *("controller position_gain", "controller velocity_gain", "posture gain", "posture rate_gain"),
    *("force_control elasticity", "force_control admittance"),
)


def test_a_declared_delay_is_counted_in_period_gains_and_lead_and_not_simulated():
    late = walk_robot(EXACT, *SHORT, "machine.latency=0.001")
    config = late.config
    parts = {name: vars(getattr(config, name)) for name in ("controller", "posture", "force_control")}
    typed = [f"{part}.{name}={parts[part][name]}" for part, name in map(str.split, BY_RULE)]
    same = walk_robot(EXACT, *SHORT, f"sampling_period={config.sampling_period}", *typed)
    assert (find_torque(late) == find_torque(same)).all()
    assert late.setup.lead == same.setup.lead + round(0.001 / config.sampling_period)
    assert config.gains[1] < walk_robot(EXACT, *SHORT, f"sampling_period={config.sampling_period}").config.gains[1]


def test_a_run_with_little_margin_of_delay_says_so_unless_warnings_are_off(tmp_path):
    walk = [*ROBOT, f"machine.path={OWN}", *SHORT, "actuator.lag=0.01", "feedforward=none", "record=metrics"]
    with pytest.warns(SmallMargin, match=r"^machine\.latency=0: feedback bears .* ms .* controller=drives$"):
        cmacexp.run(walk, tmp_path / "small")
    with warnings.catch_warnings(action="error"):
        cmacexp.run([*walk, "warn=false"], tmp_path / "off")


def test_a_robot_walks_with_delay_below_its_margin_and_falls_with_thrice_as_much():
    walk = [*ROBOT, f"machine.path={OWN}", "cycles=2", "sampling_period=0.001", "actuator.lag=0.005", EXACT]
    with pytest.warns(SmallMargin, match="bears 1.2 ms"):
        below, beyond = (cmacexp.run([*walk, f"plant.delay={samples}"]) for samples in (1, 4))
    assert (below.status, beyond.status) == ("completed", "fell")
