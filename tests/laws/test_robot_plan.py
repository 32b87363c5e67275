"""What a robot plans: forces of feet and torques of joints that agree with its masses."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.robot_walks import EXACT, ROBOT
from support.robots import OWN, read

from cmacexp.config.compose import compose_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.robot import load_mujoco
from cmacexp.planning.columns import JOINT_COLUMNS, X, Z
from cmacexp.planning.robot import find_centres
from cmacexp.planning.robot_dynamics import compute_load, compute_needs, make_model, planned_torques


@pytest.fixture(scope="module")
def planned():
    """Setup of the usual gait; joint angles, their rates and accelerations (N, 4, 3), forces, what masses need."""
    setup = make_scenario(compose_config([*ROBOT, f"machine.path={OWN}", EXACT])).setup
    joints = setup.plan.joints
    angles, rates, accelerations = (joints[..., JOINT_COLUMNS[name]] for name in JOINT_COLUMNS)
    needs, _ = compute_needs(setup.config, joints, setup.plan.sway)
    return SimpleNamespace(
        **vars(setup), angles=angles, rates=rates, accelerations=accelerations, needs=needs,
        force=setup.plan.force_desired,
    )  # fmt: skip


def test_the_impulse_of_the_planned_forces_is_the_change_of_momentum(planned):
    period, weight = planned.config.sampling_period, planned.mechanism.weight
    impulse = np.cumsum(planned.needs[:, :3] - [0.0, 0.0, weight], axis=0) * period
    centre = find_centres(planned.config.machine, planned.angles).T
    momentum = read().mass * (np.roll(centre, -1, axis=0) - np.roll(centre, 1, axis=0)) / (2.0 * period)
    off = np.abs(impulse - momentum - np.median(impulse - momentum, axis=0))
    assert_allclose(planned.needs[:, :3].mean(axis=0), [0.0, 0.0, weight], atol=1e-4 * weight)
    assert (np.quantile(off, 0.9, axis=0) < 0.1 * np.ptp(momentum, axis=0)).all()


def test_feet_share_the_vertical_force_that_masses_need(planned):
    assert_allclose(planned.force.sum(axis=1), planned.needs[:, 2], rtol=1e-8)
    assert planned.force.min() >= 0.0
    assert not planned.force[~planned.plan.support].any()


def test_the_centre_of_pressure_is_where_masses_need_it_unless_a_foot_would_have_to_pull(planned):
    feet = planned.mechanism.hips + planned.plan.desired[..., [X, Z]]
    centre = (planned.force[..., None] * feet).sum(axis=1) / planned.force.sum(axis=1)[:, None]
    met = (
        np.abs(centre - compute_load(planned.config, planned.plan.joints, planned.plan.sway).centre).max(axis=1)
        < 1e-6
    )
    would_pull = (planned.plan.support & (planned.force == 0.0)).any(axis=1)
    assert (met | would_pull).all()
    assert met.mean() > 0.9


def test_feet_take_their_load_from_zero_and_give_it_up_again(planned):
    support, force = planned.plan.support, planned.force
    touching, lifting = support & ~np.roll(support, 1, axis=0), support & ~np.roll(support, -1, axis=0)
    assert not force[touching].any()
    assert force[lifting].max() < 2e-3 * planned.mechanism.weight


def test_planned_torques_and_forces_leave_nothing_for_mujoco_to_add(planned):
    """But about the vertical, where nothing is controlled; a foot that cannot pull leaves a moment, too."""
    mujoco, robot, force = load_mujoco(), read(), planned.force
    model, legs = make_model(robot.model), robot.legs
    data = mujoco.MjData(model)
    torque = planned_torques(planned.config, planned.mechanism, planned.plan.joints, planned.plan.sway, force, force)
    left = []
    for k in range(0, len(force), 9):
        data.qpos[legs.base_qpos : legs.base_qpos + 7] = [0, 0, 0, 1, 0, 0, 0]
        data.qpos[legs.qpos], data.qvel[legs.dof] = planned.angles[k], planned.rates[k]
        data.qvel[legs.base_dof], data.qacc[legs.dof] = planned.config.body_speed, planned.accelerations[k]
        mujoco.mj_inverse(model, data)
        given = np.zeros(model.nv)
        given[legs.dof] = torque[k]
        for body, geom, share in zip(legs.foot_body, legs.foot_geom, force[k] / force[k].sum(), strict=True):
            place, push = data.geom_xpos[geom].copy(), share * planned.needs[k, :3]
            mujoco.mj_applyFT(model, data, push, np.zeros(3), place, int(body), given)
        left.append(np.abs(data.qfrc_inverse - given))
    left, joints = np.array(left), legs.dof.ravel()
    trunk = left[:, legs.base_dof : legs.base_dof + 6]
    assert left[:, joints].max() < 1e-9
    assert trunk[:, :3].max() < 1e-6
    assert np.quantile(trunk[:, 3:5], 0.9) < 0.02 < np.abs(planned.needs[:, 3:5]).max() / 10.0


def test_torques_grow_with_the_masses_of_the_model_above_what_joints_lose(planned):
    pressed = np.zeros_like(planned.force)
    once, twice, thrice = (
        planned_torques(
            planned.config, planned.mechanism, planned.plan.joints, planned.plan.sway, planned.force, pressed, factor
        )
        for factor in (1.0, 2.0, 3.0)
    )
    rates, accelerations, robot = planned.rates, planned.accelerations, read()
    losses = robot.damping * rates + robot.friction * np.sign(rates) + robot.armature * accelerations
    # MuJoCo's dry friction is full where speed, rather than acceleration, decides its direction.
    sliding = (np.abs(rates) > 0.05) & (np.abs(accelerations) < 50.0 * np.abs(rates))
    assert sliding.mean() > 0.4
    assert_allclose((2.0 * once - twice)[sliding], losses[sliding], atol=1e-9)
    assert_allclose((thrice - twice)[sliding], (twice - once)[sliding], atol=1e-9)
