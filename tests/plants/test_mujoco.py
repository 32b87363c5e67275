"""Plants in MuJoCo: the leg is our leg, the body obeys mechanics, and what goes wrong in the engine ends a run."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from support.doors import (
    BadInput,
    Diverged,
    Leg,
    foot_position,
    forward_dynamics,
    legs_on_stand,
    legs_under_body,
    make_scenario,
    trigonometry,
)
from support.grounds import still_ground
from support.robots import OWN
from support.rollout import roll_out

from cmacexp.planning import Setup
from cmacexp.plants.kernels import new_state
from cmacexp.plants.mujoco_kernels import Bodies, Feet, press
from cmacexp.plants.mujoco_model import make_planar
from cmacexp.plants.mujoco_plant import MujocoConfig, MujocoPlant
from cmacexp.plants.touch import Touch

pytestmark = pytest.mark.ci
LEG = Leg(0.35, 0.30, 0.5, 0.4, -1.0)
GROUND = still_ground(1e4, damping=50.0)
FREE = Touch(GROUND._replace(damping=0.0))
STICKY = Touch(GROUND, 0.6, 1e4, 50.0)
TORSO = 1.0, (0.05, 0.06, 0.1)
HIPS = [(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)]
WALK = ("scenario=quadruped", "plant=mujoco_quadruped", "feedforward=none")


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


# One leg


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
        assert_allclose(hip_height - plant.data.geom_xpos[0, 2], measured.foot[0, 1], atol=1e-12)


def test_a_leg_moves_and_learns_the_same_in_both_engines_on_level_changing_and_sloping_ground(make_config):
    changes = (
        (),
        ("terrain.step_time=4.5", "terrain.step_factor=3"),
        ("terrain.slope=-0.2", "terrain.slope_start=0.02", "terrain.damping=2"),
    )
    forces = []
    for ground in changes:
        run = ("scenario=one_leg", "cycles=2", "learning.start_cycle=1", *ground)
        ours, theirs = (
            roll_out(make_scenario(make_config(*run, f"plant={plant}"))).columns()
            for plant in ("analytic", "mujoco_leg")
        )
        for name in ("x", "y", "force", "tau_feedforward_1", "tau_feedforward_2"):
            assert_allclose(theirs[name], ours[name], atol=1e-6, err_msg=name)
        forces.append(ours["force"])
    assert all(np.abs(force - forces[0]).max() > 0.1 for force in forces[1:])


# A body


def test_body_and_feet_are_measured_in_our_frames(begin):
    """By way of MuJoCo's quaternion, and its rates of the trunk in the frame of the trunk."""
    draw, h = np.random.default_rng(1), 1e-7
    q, dq = draw.uniform(-1, 1, (4, 2)), draw.uniform(-2, 2, (4, 2))
    pose, rate = np.array([0.6, 0.1, -0.2]), np.array([0.3, 0.5, -0.7])
    plant = begin(legs_under_body([LEG] * 4, 0.5, HIPS, 40.0), STICKY, q, TORSO)
    turn, later = (Rotation.from_euler("ZYX", [0.3, *at[1:]]) for at in (pose, pose + h * rate))
    plant.data.qpos[:7] = [1.0, 2.0, pose[0], *turn.as_quat()[[3, 0, 1, 2]]]
    plant.data.qvel[:] = [0.3, -0.2, rate[0], *(turn.inv() * later).as_rotvec() / h, *dq.ravel()]
    plant.mujoco.mj_step1(plant.model, plant.data)
    measured = plant.measure()
    assert_allclose(measured.body, pose, atol=1e-12)
    assert_allclose(measured.body_rate, rate, atol=1e-6)
    assert_allclose(measured.travel, [1.0, 2.0, 0.3], atol=1e-12)
    for place, (x, y), foot in zip(plant.data.geom_xpos, HIPS, measured.foot, strict=True):
        assert_allclose(place, plant.data.qpos[:3] + turn.apply([x + foot[0], y, -foot[1]]), atol=1e-12)


@pytest.mark.parametrize(
    ("place", "velocity", "pull", "held"),
    [
        ((3e-4, 0.0, -1e-3), (0.0, 0.0, 0.0), (-3.0, 0.0, 10.0), (0.0, 0.0)),
        ((3e-3, 4e-3, -1e-3), (0.0, 0.0, 0.0), (-3.6, -4.8, 10.0), (3e-3 - 0.36e-3, 4e-3 - 0.48e-3)),
        ((1.0, 2.0, 0.1), (1.0, 1.0, -1.0), (0.0, 0.0, 0.0), (1.0, 2.0)),
    ],
    ids=["sticks", "slides", "in the air"],
)
def test_friction_by_hand(place, velocity, pull, held):
    """Depth 1 mm: 10 N carry at most 6 N of friction, which the spring of 10 N/mm gives at 0.6 mm."""
    bodies = Bodies(*np.zeros((5, 1, 6)), np.zeros(3), np.zeros(9), np.zeros(6))
    bodies.place[0, :3], bodies.motion[0, 3:] = place, velocity
    bodies.mass_centre[:] = bodies.place
    anchors, leg = np.zeros((1, 2)), np.zeros(1, int)
    press(STICKY, bodies, Feet(leg, leg, leg, 0), new_state(1), anchors, in_stage=False)
    assert_allclose(bodies.pull[0, :3], pull)
    assert_allclose(anchors[0], held)


def test_it_starts_at_rest_pressed_in_as_planned_or_where_its_seed_tells(make_config):
    def start(*overrides):
        return make_scenario(make_config(*WALK, *overrides))

    planned, spread = start(), start("plant.start_spread=0.02").first.q
    assert_allclose(planned.first.force, planned.setup.plan.force_desired[0], atol=1e-9)
    assert_array_equal(planned.first.dq, 0.0)
    assert_array_equal(spread, start("plant.start_spread=0.02").first.q)
    assert np.abs(spread - planned.setup.start).max() <= 0.02
    assert (spread != start("plant.start_spread=0.02", "plant.start_seed=1").first.q).all()


@pytest.fixture(scope="module")
def walked(make_config):
    """Samples of the last cycle of a walk with a body that has inertia: of the legs, of the body, and its config."""

    def walk(*overrides):
        config = make_config(*WALK, "cycles=2", "plant.start_spread=0.01", *overrides)
        run, last = roll_out(make_scenario(config)), slice(-config.steps_per_cycle, None)
        assert run.status == "completed"
        legs, body = ({name: values[last] for name, values in columns.items()}
                      for columns in (run.columns(), run.body_columns()))  # fmt: skip
        return legs, body, config

    return walk


def test_a_dynamic_body_walks_as_it_was_planned_and_a_payload_presses_where_it_lies(walked):
    """Over a cycle of a periodic walk the ground carries the weight: momentum comes back to what it was."""

    def loads(legs):
        hips = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
        force, x = legs["force"], legs["x"] + hips[:, 0]
        return np.array([part.sum(axis=1).mean() for part in (force, force * x, force * hips[:, 1])])

    legs, body, config = walked()
    assert loads(legs)[0] == pytest.approx(49.05, rel=0.01)
    assert np.ptp(body["cog_x"]) == pytest.approx(config.body_speed * config.gait.cycle_time, rel=0.1)
    assert 0.0 < np.abs(body["yaw"]).max() < 0.1
    loaded = loads(walked("payload.weight=10", "payload.x=0.05", "payload.y=0.1")[0])
    assert_allclose(loaded - loads(legs), [10.0, 0.5, 1.0], atol=0.45)  # the body leans towards it


def test_on_a_slope_a_body_tells_its_height_above_the_ground_below_it(walked):
    assert_allclose(walked("terrain.slope=0.05")[1]["height"], 0.5, atol=0.05)


# What goes wrong


@pytest.mark.parametrize(
    ("plant", "change", "place"),
    [
        ("mujoco_leg", ("sensors=real", "sensors.velocity.bias=-999999999"), "joint 1 of leg 1"),
        ("mujoco_quadruped", ("sensors=real", "sensors.velocity.bias=-999999999"), "the body"),
        ("mujoco_quadruped", ("machine.leg.mass_2=1e-12",), "joint 2 of leg"),
    ],
)
def test_a_warning_of_the_engine_ends_a_run_as_diverged(make_config, tmp_path, monkeypatch, plant, change, place):
    """The engine would put the machine back at its start and go on, and write a log into the current folder."""
    monkeypatch.chdir(tmp_path)
    scenario = "one_leg" if plant == "mujoco_leg" else "quadruped"
    end = roll_out(make_scenario(make_config(f"scenario={scenario}", "cycles=1", f"plant={plant}", *change)))
    assert (end.status, end.steps, len(end.samples)) == ("diverged", 1, 1)
    assert place in end.cause
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("array", "what", "place"),
    [("qpos", "position", "RL_calf_joint"), ("qvel", "velocity", "RL_calf_joint"), ("qvel", "velocity", "the trunk")],
)
def test_a_diverged_robot_stays_where_it_is_and_its_joint_is_named_as_in_its_model(make_config, array, what, place):
    plant = make_scenario(
        make_config("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "feedforward=none")
    ).plant
    legs = plant.robot.legs
    index = {"qpos": legs.qpos[2, 2], "qvel": legs.dof[2, 2] if place != "the trunk" else legs.base_dof}[array]
    getattr(plant.data, array)[index] = 1e11
    with pytest.raises(Diverged, match=f"{what} of {place}"):
        plant.step(np.zeros((4, 3)))
    assert np.abs(getattr(plant.data, array)).max() > 9e10


def test_without_mujoco_the_message_says_how_to_install_it(make_config, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(BadInput, match=r"pip install"):
        make_scenario(make_config("plant=mujoco_leg"))
