"""Inverse dynamics of a robot along its plan, from its model: what ground and joints must give.

The body stays level and moves at constant speed. MuJoCo computes the generalised forces of all masses, with the dry
friction, damping and armature of the joints; the ground's share of them is what acts on the trunk.
"""

import copy
from typing import Any

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import read_model
from cmacexp.models.chain import batch_kinematics
from cmacexp.models.mechanism import Mechanism
from cmacexp.models.robot import load_mujoco, place
from cmacexp.planning.body_load import BodyLoad
from cmacexp.planning.robot import find_stance
from cmacexp.planning.trajectory import Motion
from cmacexp.typing import Array


def make_model(robot_model: Any, mass_factor: float = 1.0) -> Any:
    """A copy of a model without contacts, its masses and inertias times ``mass_factor``."""
    mujoco = load_mujoco()
    model = copy.copy(robot_model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.body_mass *= mass_factor
    model.body_inertia *= mass_factor
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def compute_needs(config: Config, joints: Motion, sway: Motion, mass_factor: float = 1.0) -> tuple[Array, Array]:
    """What the planned motion of the ``joints`` and of the body needs, with masses that may be wrong.

    Of the body (N, 6): force (N) in the world, and moment about its origin (N m); of the joints (N, 4, 3): torques
    without contact forces, N m.
    """
    mujoco, robot = load_mujoco(), read_model(config.machine)
    origin, legs = find_stance(robot, config.machine.hip_height).origin, robot.legs
    model = make_model(robot.model, mass_factor)
    data = place(model, mujoco.MjData(model), legs, robot.home)
    rates = sway.velocity + np.array([config.body_speed, 0.0])
    needs = np.empty((len(rates), model.nv))
    for k, sample in enumerate(zip(*joints, strict=True)):
        data.qpos[legs.qpos], data.qvel[legs.dof], data.qacc[legs.dof] = sample
        data.qvel[legs.base_dof : legs.base_dof + 2] = rates[k]
        data.qacc[legs.base_dof : legs.base_dof + 2] = sway.acceleration[k]
        mujoco.mj_inverse(model, data)
        needs[k] = data.qfrc_inverse
    force, moment = needs[:, legs.base_dof : legs.base_dof + 3], needs[:, legs.base_dof + 3 : legs.base_dof + 6]
    return np.concatenate([force, moment - np.cross(origin, force)], axis=1), needs[:, legs.dof]


def compute_load(config: Config, joints: Motion, sway: Motion) -> BodyLoad:
    """The load of the feet along the planned motion of the ``joints`` and of the body.

    The horizontal force acts at the ground, ``hip_height`` below the body: it moves the centre of pressure.
    """
    force, moment = np.split(compute_needs(config, joints, sway)[0], 2, axis=1)
    longitudinal, lateral, up = force.T
    height = config.machine.hip_height
    centre = np.stack([-moment[:, 1] - height * longitudinal, moment[:, 0] - height * lateral], axis=1) / up[:, None]
    return BodyLoad(up, centre)


def planned_torques(
    config: Config,
    mechanism: Mechanism,
    joints: Motion,
    sway: Motion,
    load: Array,
    pressed: Array,
    mass_factor: float = 1.0,
) -> Array:
    """Joint torques (N, 4, 3), N m, that let the robot move as planned, with masses that may be wrong by a factor.

    Planned are ``joints`` and ``sway``; ``load`` (N, 4) are vertical forces on the feet, N, which share the
    horizontal force alike; ``pressed`` (N, 4) are those that these torques have to give.
    """
    assert mechanism.chains is not None
    trunk, torque = compute_needs(config, joints, sway, mass_factor)
    share = load / load.sum(axis=1, keepdims=True)
    ground = np.stack([trunk[:, :1] * share, -pressed, trunk[:, 1:2] * share], axis=-1)
    for i, chain in enumerate(mechanism.chains):
        _, jacobian = batch_kinematics(chain, joints.position[:, i])
        torque[:, i] -= np.einsum("kjn,kj->kn", jacobian, ground[:, i])
    return torque
