"""What a robot plans: forces of feet and torques of joints that agree with its masses."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import compose_config, make_scenario
from support.robots import OWN, read

from cmacexp.planning import Motion
from cmacexp.planning.machine import compute_needs, find_centres, make_model, planned_torques

pytestmark = pytest.mark.ci
ROBOT = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}", "feedforward=inverse_dynamics")


@pytest.fixture(scope="module")
def planned():
    """Setup of the usual gait; joint angles, their rates and accelerations (N, 4, 3), forces, what masses need."""
    setup = make_scenario(compose_config([*ROBOT])).setup
    angles, rates, accelerations = setup.plan.joints
    needs, _ = compute_needs(setup.config, setup.plan.joints, setup.plan.sway)
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


def test_feet_share_the_force_that_masses_need_from_nothing_to_nothing_without_a_pull(planned):
    support, force = planned.plan.support, planned.force
    assert_allclose(force.sum(axis=1), planned.needs[:, 2], rtol=1e-8)
    assert force.min() >= 0.0
    assert not force[~support].any()
    assert not force[support & ~np.roll(support, 1, axis=0)].any()
    assert force[support & ~np.roll(support, -1, axis=0)].max() < 2e-3 * planned.mechanism.weight


def test_planned_torques_and_forces_leave_nothing_for_mujoco_to_add(planned):
    """But about the vertical, where nothing is controlled; a foot that cannot pull leaves a moment, too."""
    import mujoco

    robot, force = read(), planned.force
    model, legs = make_model(robot.model), robot.legs
    feet = model.geom_bodyid[legs.foot_geom]
    data, left, plan = mujoco.MjData(model), [], planned.plan
    torque = planned_torques(planned.config, planned.mechanism, plan.joints, plan.sway, force, force)
    for k in range(0, len(force), 9):
        data.qpos[legs.base_qpos : legs.base_qpos + 7] = [0, 0, 0, 1, 0, 0, 0]
        data.qpos[legs.qpos], data.qvel[legs.dof] = planned.angles[k], planned.rates[k]
        data.qvel[legs.base_dof], data.qacc[legs.dof] = planned.config.body_speed, planned.accelerations[k]
        mujoco.mj_inverse(model, data)
        given = np.zeros(model.nv)
        given[legs.dof] = torque[k]
        for body, geom, share in zip(feet, legs.foot_geom, force[k] / force[k].sum(), strict=True):
            place, push = data.geom_xpos[geom].copy(), share * planned.needs[k, :3]
            mujoco.mj_applyFT(model, data, push, np.zeros(3), place, int(body), given)
        left.append(np.abs(data.qfrc_inverse - given))
    left, trunk = np.array(left), np.arange(legs.base_dof, legs.base_dof + 6)
    assert left[:, legs.dof.ravel()].max() < 1e-9
    assert left[:, trunk[:3]].max() < 1e-6
    assert np.quantile(left[:, trunk[3:5]], 0.9) < 0.02 < np.abs(planned.needs[:, 3:5]).max() / 10.0


def test_masses_that_are_wrong_by_a_factor_need_as_much_more_force_and_moment(planned):
    every_tenth = (
        Motion(*(values[::10] for values in motion)) for motion in (planned.plan.joints, planned.plan.sway)
    )
    needs, _ = compute_needs(planned.config, *every_tenth, 1.2)
    assert_allclose(needs, 1.2 * planned.needs[::10], atol=1e-9)
