"""Plants in MuJoCo: the leg is our leg, the body obeys mechanics, and what they need is asked for in one line."""

import signal
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.grounds import still_ground
from support.robots import OWN
from support.rollout import roll_out

from cmacexp.control import HybridController
from cmacexp.errors import BadInput, Diverged
from cmacexp.loop.builtin import find_external
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.leg import Leg, foot_position, foot_velocity, forward_dynamics, trigonometry
from cmacexp.models.mechanism import legs_on_stand, legs_under_body
from cmacexp.planning.machine import compute_weight_of_masses
from cmacexp.planning.setup import Setup
from cmacexp.plants import Measurement
from cmacexp.plants.kernels import new_state
from cmacexp.plants.mujoco_kernels import Bodies, Feet, Touch, press
from cmacexp.plants.mujoco_leg import MujocoLeg
from cmacexp.plants.mujoco_model import make_planar
from cmacexp.plants.mujoco_plant import MujocoConfig, MujocoPlant

LEG = Leg(0.35, 0.30, 0.5, 0.4, -1.0)
GROUND = still_ground(1e4, damping=50.0)
FREE = Touch(GROUND._replace(damping=0.0))
STICKY = Touch(GROUND, 0.6, 1e4, 50.0)
TORSO = 1.0, (0.05, 0.06, 0.1)
HIPS = [(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)]
WALK = ("scenario=quadruped", "plant=mujoco_quadruped")


@pytest.fixture
def begin(make_config):
    """A plant of some legs, on a stand or under ``torso``, at ``start``, rad."""
    config = make_config("scenario=one_leg")

    def make(mechanism, touch, start, torso=(), substeps=1, period=1e-3):
        plant = MujocoPlant(MujocoConfig(substeps))
        setup = Setup(replace(config, sampling_period=period), mechanism, plan=None, start=np.asarray(start))
        plant.begin(setup, make_planar(mechanism, *torso), touch)
        return plant

    return make


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_are_those_of_our_equations(begin, seed):
    """In the air and on the ground: eq. 17 and 23 against an engine that has never heard of them."""
    draw = np.random.default_rng(seed)
    q, dq, tau = draw.uniform(-2, 2, 2), draw.uniform(-5, 5, 2), draw.uniform(-10, 10, 2)
    trig = trigonometry(*q)
    for hip_height in (10.0, foot_position(LEG, trig)[1] - 1e-3):
        plant = begin(legs_on_stand([LEG], hip_height), FREE, [q])
        plant.data.qvel[:], plant.data.qfrc_applied[:] = dq, tau
        plant.mujoco.mj_forward(plant.model, plant.data)
        measured = plant.measure()
        assert (measured.force[0] > 0.0) == (hip_height != 10.0)
        assert_allclose(plant.data.qacc, forward_dynamics(LEG, trig, *dq, *tau, measured.force[0]), rtol=1e-9)
        assert_allclose(measured.foot[0], foot_position(LEG, trig), atol=1e-12)


def test_a_leg_learns_the_same_in_both_engines(make_config):
    """Asked for: foot within 1 mm, force within 2 %, over 5 cycles; with one method of integration it is rounding."""
    ours, theirs = (
        roll_out(make_scenario(make_config("scenario=one_leg", "cycles=5", f"plant={plant}")))
        for plant in ("analytic", "mujoco_leg")
    )
    assert theirs.status == "completed"
    for name in ("x", "y", "force", "tau_feedforward_1", "tau_feedforward_2"):
        assert_allclose(theirs.columns()[name], ours.columns()[name], atol=1e-9, err_msg=name)


def falling(begin, steps):
    """A machine thrown through the air: its energy at the start and 0.2 s later, J."""
    random = np.random.default_rng(0)
    start = random.uniform(-1, 1, (4, 2))
    plant = begin(legs_under_body([LEG] * 4, 100.0, HIPS, 40.0), STICKY, start, TORSO, steps, 0.2)
    mujoco, model, data = plant.mujoco, plant.model, plant.data
    data.qvel[:] = random.uniform(-3, 3, model.nv)
    energies = []
    for _ in range(2):
        mujoco.mj_forward(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        energies.append(data.energy.sum())
        plant.step(np.zeros((4, 2)))
    return energies


def test_energy_is_conserved_in_the_air(begin):
    lost = []
    for steps in (50, 100, 200):
        before, after = falling(begin, steps)
        lost.append(abs(after - before))
    assert lost[-1] < 1e-4
    for coarse, fine in pairwise(lost):
        assert coarse > 8.0 * fine


def measured(begin, q, dq, pose, pose_rate):
    """A machine whose body is at height, pitch, roll with their rates; by way of MuJoCo's quaternion."""
    from scipy.spatial.transform import Rotation

    plant = begin(legs_under_body([LEG] * 4, 0.5, HIPS, 40.0), STICKY, q, TORSO)
    height, pitch, roll = pose
    turn = Rotation.from_euler("ZYX", [0.3, pitch, roll])
    plant.data.qpos[:3], plant.data.qpos[3:7] = [1.0, 2.0, height], turn.as_quat()[[3, 0, 1, 2]]
    h = 1e-7
    later = Rotation.from_euler("ZYX", [0.3, pitch + h * pose_rate[1], roll + h * pose_rate[2]])
    plant.data.qvel[:3] = [0.3, -0.2, pose_rate[0]]
    plant.data.qvel[3:6] = (turn.inv() * later).as_rotvec() / h
    plant.data.qvel[6:] = dq.ravel()
    plant.mujoco.mj_step1(plant.model, plant.data)
    return plant.measure()


def test_body_and_feet_are_measured_in_our_frames(begin):
    draw = np.random.default_rng(1)
    q, dq = draw.uniform(-1, 1, (4, 2)), draw.uniform(-2, 2, (4, 2))
    pose, rate = [0.6, 0.1, -0.2], [0.3, 0.5, -0.7]
    m: Measurement = measured(begin, q, dq, pose, rate)
    assert_allclose(m.body, pose, atol=1e-12)
    assert_allclose(m.body_rate, rate, atol=1e-6)
    assert_allclose(m.travel, [1.0, 2.0, 0.3], atol=1e-12)
    for i in range(4):
        trig = trigonometry(*q[i])
        assert_allclose(m.foot[i], foot_position(LEG, trig), atol=1e-12)
        assert_allclose(m.velocity[i], foot_velocity(LEG, trig, *dq[i]), atol=1e-12)


def one_foot(place, velocity, anchor, touch=STICKY):
    """Forces on a foot at ``place`` (m) that moves (m/s), held at ``anchor``; and where it sticks then."""
    bodies = Bodies(*np.zeros((5, 1, 6)), np.zeros(3), np.zeros(9), np.zeros(6))
    bodies.place[0, :3], bodies.motion[0, 3:] = place, velocity
    bodies.mass_centre[:] = bodies.place
    anchors, leg = np.array([anchor], dtype=float), np.zeros(1, int)
    press(touch, bodies, Feet(leg, leg, leg, 0), new_state(1), anchors, in_stage=False)
    return bodies.pull[0, :3], anchors[0]


def test_friction_by_hand():
    """Depth 1 mm: 10 N carry at most 6 N of friction, which the spring of 10 N/mm gives at 0.6 mm."""
    pull, held = one_foot([3e-4, 0.0, -1e-3], [0.0, 0.0, 0.0], [0.0, 0.0])
    assert_allclose(pull, [-3.0, 0.0, 10.0])
    assert_allclose(held, [0.0, 0.0])
    pull, held = one_foot([3e-3, 4e-3, -1e-3], [0.0, 0.0, 0.0], [0.0, 0.0])
    assert_allclose(pull, [-3.6, -4.8, 10.0])
    assert_allclose(held, [3e-3 - 0.36e-3, 4e-3 - 0.48e-3])
    pull, held = one_foot([1.0, 2.0, 0.1], [1.0, 1.0, -1.0], [0.0, 0.0])
    assert_allclose(pull, 0.0)
    assert_allclose(held, [1.0, 2.0])


def test_a_dynamic_body_walks_as_it_was_planned(make_config):
    """Over whole cycles of a periodic walk the ground carries the weight: momentum comes back to what it was."""
    config = make_config(*WALK, "cycles=3", "plant.start_spread=0.01")
    run = roll_out(make_scenario(config))
    assert run.status == "completed"
    n = config.steps_per_cycle
    force = run.columns()["force"][-n:].sum(axis=1).mean()
    assert force == pytest.approx(compute_weight_of_masses(config.machine), rel=0.01)
    body = run.body_columns()
    advance = body["cog_x"][-1] - body["cog_x"][-n]
    assert advance == pytest.approx(config.body_speed * config.gait.cycle_time, rel=0.1)
    assert body["cog_y"].any()
    assert body["yaw"].any()
    assert np.abs(body["yaw"]).max() < 0.1


def test_it_starts_pressed_in_as_planned(make_config):
    scenario = make_scenario(make_config(*WALK))
    assert_allclose(scenario.first.force, scenario.setup.plan.force_desired[0], atol=1e-9)
    assert_array_equal(scenario.first.dq, 0.0)


def test_the_seed_of_the_start_tells_where_it_starts(make_config):
    def start(*overrides):
        return make_scenario(make_config(*WALK, "plant.start_spread=0.02", *overrides)).first.q

    planned = make_scenario(make_config(*WALK)).setup.start
    assert_array_equal(start(), start())
    assert np.abs(start() - planned).max() <= 0.02
    assert (start() != start("plant.start_seed=1")).all()


def test_the_plant_chooses_settings_that_walk_and_the_command_line_wins(make_config):
    chosen = make_config(*WALK)
    assert (chosen.sampling_period, chosen.reference, chosen.learning.lead) == (0.002, "force_feedforward", "auto")
    assert make_config(*WALK, "learning.lead=0", "sampling_period=0.005").learning.lead == 0
    assert make_config("scenario=quadruped").learning.lead == 0


STEP_AFTER = {"one_leg": "at step 1 (t = 0.005 s)", "quadruped": "at step 1 (t = 0.002 s)"}


@pytest.mark.parametrize(
    ("scenario", "change", "place"),
    [
        ("one_leg", ("sensors=real", "sensors.velocity.bias=-999999999"), "joint 1 of leg 1"),
        ("one_leg", ("machine.leg.mass_2=1e-12",), "joint 2 of leg 1"),
        ("quadruped", ("sensors=real", "sensors.velocity.bias=-999999999"), "the body"),
        ("quadruped", ("machine.leg.mass_2=1e-12",), "joint 2 of leg 1"),
    ],
)
def test_a_warning_of_the_engine_ends_a_run_as_diverged(make_config, tmp_path, monkeypatch, scenario, change, place):
    """The engine would put the machine back at its start and go on, and write a log into the current folder."""
    monkeypatch.chdir(tmp_path)
    plant = {"one_leg": "mujoco_leg", "quadruped": "mujoco_quadruped"}[scenario]
    end = roll_out(make_scenario(make_config(f"scenario={scenario}", "cycles=1", f"plant={plant}", *change)))
    reported = f"MuJoCo reports that the acceleration of {place} is not finite or huge"
    assert (end.status, end.cause) == ("diverged", f"{STEP_AFTER[scenario]}: {reported}")
    assert end.steps == len(end.samples) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("array", "index", "cause"),
    [
        ("qpos", 0, "the position of joint 1 of leg 1"),
        ("qvel", 3, "the velocity of joint 2 of leg 2"),
    ],
)
def test_a_diverged_machine_stays_where_it_is(begin, array, index, cause):
    plant = begin(legs_on_stand([LEG, LEG], 1.0), FREE, np.full((2, 2), 0.5))
    getattr(plant.data, array)[index] = 1e11
    with pytest.raises(Diverged, match=f"^MuJoCo reports that {cause} is not finite or huge$"):
        plant.step(np.zeros((2, 2)))
    assert np.abs(getattr(plant.data, array)).max() >= 1e11


@pytest.mark.parametrize(
    ("array", "what", "place"),
    [("qpos", "position", "RL_calf_joint"), ("qvel", "velocity", "RL_calf_joint"), ("qvel", "velocity", "the trunk")],
)
def test_the_joint_of_a_robot_that_diverged_is_named_as_in_its_model(make_config, array, what, place):
    config = make_config("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "feedforward=none")
    plant = make_scenario(config).plant
    legs = plant.robot.legs
    index = {"qpos": legs.qpos[2, 2], "qvel": legs.dof[2, 2] if place != "the trunk" else legs.base_dof}[array]
    getattr(plant.data, array)[index] = 1e11
    with pytest.raises(Diverged, match=f"^MuJoCo reports that the {what} of {place} is not finite or huge$"):
        plant.step(np.zeros((4, 3)))


def test_a_handler_of_warnings_that_the_user_installed_stays(make_config):
    import mujoco

    def handler(message):
        raise AssertionError(message)

    mujoco.set_mju_user_warning(handler)
    try:
        end = roll_out(make_scenario(make_config("plant=mujoco_leg", "machine.leg.mass_2=1e-12")))
        assert end.status == "diverged"
        assert mujoco.get_mju_user_warning() is handler
    finally:
        mujoco.set_mju_user_warning(None)


def test_without_mujoco_the_message_says_how_to_install_it(make_config, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(BadInput, match=r'MuJoCo is not installed: .*pip install -e "\.\[mujoco\]"'):
        make_scenario(make_config("plant=mujoco_leg"))


@pytest.mark.parametrize(
    "change",
    [
        ("terrain.step_time=4.5", "terrain.step_factor=3"),
        ("terrain.slope=-0.2", "terrain.slope_start=0.02", "terrain.damping=2"),
    ],
    ids=["step of the stiffness", "slope"],
)
def test_a_leg_feels_the_same_change_of_its_ground_in_both_engines(make_config, change):
    calm, ours, theirs = (
        roll_out(make_scenario(make_config("scenario=one_leg", "cycles=2", f"plant={plant}", *more)))
        for plant, more in (("analytic", ()), ("analytic", change), ("mujoco_leg", change))
    )
    assert_allclose(theirs.columns()["force"], ours.columns()["force"], atol=1e-6)
    assert np.abs(calm.columns()["force"] - ours.columns()["force"]).max() > 0.1


def test_a_payload_presses_where_it_lies(make_config):
    """Mean forces of a cycle: feet take 10 N more together, and its moments about the middle."""

    def loads(*more):
        columns = roll_out(make_scenario(make_config(*WALK, "cycles=2", "feedforward=none", *more))).columns()
        force, x = columns["force"][1500:], columns["x"][1500:] + np.array([0.225, 0.225, -0.225, -0.225])
        y = [0.225, -0.225, 0.225, -0.225]
        return np.array([force.sum(axis=1).mean(), (force * x).sum(axis=1).mean(), (force * y).sum(axis=1).mean()])

    more = loads("payload.weight=10", "payload.x=0.05", "payload.y=0.1") - loads()
    assert_allclose(more, [10.0, 0.5, 1.0], atol=0.45)  # the body leans towards it


def test_on_a_slope_a_body_tells_its_height_above_the_ground_below_it(make_config):
    rollout = roll_out(make_scenario(make_config(*WALK, "cycles=2", "feedforward=none", "terrain.slope=0.05")))
    assert rollout.status == "completed"
    assert_allclose(rollout.body_samples[:, 0], 0.5, atol=0.05)


class OwnLeg(MujocoLeg):
    """A subclass: an external component."""


class OwnController(HybridController):
    """Likewise."""


def test_a_plant_that_is_external_gives_the_bits_of_the_built_in_one(make_config):
    config = make_config("scenario=one_leg", "plant=mujoco_leg", "cycles=2", "learning.start_cycle=1")
    external = make_scenario(config, plant=OwnLeg(config.plant))
    assert find_external(external).plant
    one, other = roll_out(make_scenario(config)), roll_out(external)
    assert other.samples.tobytes() == one.samples.tobytes()


def test_an_interrupt_in_a_function_that_the_engine_calls_ends_the_run(make_config, monkeypatch):
    """An error raised there would be dropped."""
    press, calls = MujocoPlant._press_in_stage, []

    def interrupted(plant, model, data):
        calls.append(1)
        if len(calls) == 30:
            signal.raise_signal(signal.SIGINT)
        press(plant, model, data)

    monkeypatch.setattr(MujocoPlant, "_press_in_stage", interrupted)
    config = make_config("scenario=one_leg", "plant=mujoco_leg", "cycles=50")
    for given in ({}, {"controller": OwnController(config.controller)}, {"plant": OwnLeg(config.plant)}):
        calls.clear()
        end = roll_out(make_scenario(config, **given))
        assert end.status == "interrupted"
        assert 7 <= end.steps < 25000
