"""The machine that a config describes: its legs, and for a robot its stance and inverse dynamics.

Frame of the body of a robot: origin above the centre of mass of the standing robot, at the height of the thigh
joints; x forward, y left, z up, parallel to the trunk. Origin of a hip's frame: the thigh joint, shifted with those
of all other legs so that the centre of mass is in the middle of the feet, which are planned about these origins, and
to the side as far as the foot stands there: at the hip angle of home, or at the width of the stance. Legs are chains
in the frames of their hips.

Inverse dynamics along the plan give the forces that ground and joints must supply. The body stays level and moves at
constant speed. MuJoCo computes the generalised forces of all masses, with the dry friction, damping and armature of
the joints; the ground supplies those on the trunk.
"""

import copy
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.check import TOLERANCE
from cmacexp.config.machine import (
    LEG_NAMES,
    LegConfig,
    LegMachine,
    PointMassMachine,
    QuadrupedMachine,
    RobotMachine,
    read_model,
)
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import copy_array, program
from cmacexp.models.chain import batch_kinematics, chain_angles, chain_motion, find_lateral, make_chains
from cmacexp.models.leg import GRAVITY, Leg
from cmacexp.models.mechanism import (
    CHAINS_UNDER_BODY,
    SPACE,
    Mechanism,
    legs_on_stand,
    legs_under_body,
    point_mass,
)
from cmacexp.models.mujoco_library import load_library, mj_comPos, mj_kinematics
from cmacexp.models.robot import Robot, load_mujoco, set_posture
from cmacexp.planning.body import BodyLoad
from cmacexp.planning.motion import require_firm
from cmacexp.planning.reference import Motion, Y
from cmacexp.typing import Array, Counts, Mask

PASSES = 5
"""Passes of the search for a stance. The centre of mass depends on the legs, which depend on it: each pass reduces
the error tenfold."""


class Stance(NamedTuple):
    """Geometry of a robot that stands with its feet below the origins of its hips' frames."""

    origin: Array
    """(3,): origin of the body frame in the frame of the trunk, m."""
    hips: Array
    """(4, 3): origins of the hips' frames in the frame of the body, m."""
    chains: Array
    """(4, 21): m, see :mod:`cmacexp.models.chain`."""


def find_stance(robot: Robot, hip_height: float, width: float | None = None) -> Stance:
    """Find the stance with the hips ``hip_height``, m, above the feet; raise BadInput if a leg is too short.

    Left and right feet stand ``width``, m, apart; None: each where the hip angle of home puts it.
    """
    thighs = robot.hinges[:, 1, :3].copy()
    thighs[:, 2] = thighs[:, 2].mean()
    if width is None:
        chains = make_chains(robot.hinges, robot.feet_at_zero, thighs)
        thighs[:, 1] += [find_lateral(chain, q, hip_height) for chain, q in zip(chains, robot.home, strict=True)]
    else:
        middle = thighs[:, 1].reshape(2, 2).mean(axis=1)  # of the front and of the rear feet
        thighs[:, 1] = np.repeat(middle, 2) + 0.5 * width * np.array([1.0, -1.0, 1.0, -1.0])
    below = np.array([[0.0, hip_height, 0.0]])
    shift = np.zeros(3)
    for _ in range(PASSES):
        chains = make_chains(robot.hinges, robot.feet_at_zero, thighs + shift)
        q = np.concatenate([chain_angles(chain, below, home) for chain, home in zip(chains, robot.home, strict=True)])
        _require_stance(robot, hip_height, width, q)
        data = robot.at(q)
        load_mujoco().mj_comPos(robot.model, data)
        shift[:2] = data.subtree_com[robot.legs.base, :2] - thighs[:, :2].mean(axis=0)
    origin = np.array([*data.subtree_com[robot.legs.base, :2], thighs[0, 2]])
    hips = thighs + shift
    return Stance(origin, hips - origin, make_chains(robot.hinges, robot.feet_at_zero, hips))


def _require_stance(robot: Robot, hip_height: float, width: float | None, q: Array) -> None:
    """Require that joint angles ``q`` (4, 3), rad, exist and are within the joints' ranges; raise BadInput if not."""
    if width is not None and len(where := np.argwhere(~_is_within(robot, q))):
        name = robot.model.joint(int(robot.legs.joint[*where[0]])).name
        reason = (
            f"is beyond what {name} reaches at this height; use one nearer to that of null, the hip angle of home"
        )
        raise BadInput("gait.width", width, reason)
    if len(lost := np.flatnonzero(np.isnan(q).any(axis=1))):
        if hip_height >= (length := sum(robot.links)):
            reason = f"is out of reach of the legs, whose links are {length:.3g} m long together"
            raise BadInput("machine.hip_height", hip_height, reason)
        leg = LEG_NAMES[lost[0]]
        reason = (
            f"from there the {leg} foot finds no way to {hip_height:.3g} m below its hip: bend its knee otherwise"
        )
        raise BadInput("machine.home", robot.home[lost[0]].tolist(), f"{reason}, or change machine.hip_height")
    least, largest = np.moveaxis(robot.ranges, -1, 0)
    for i, n in np.argwhere(~_is_within(robot, q)):
        name = robot.model.joint(int(robot.legs.joint[i, n])).name
        reason = f"would stand with {name} at {q[i, n]:.4g} rad, beyond its {least[i, n]:.4g} to {largest[i, n]:.4g}"
        reason = f"{reason} rad: bend the knee otherwise, or change machine.hip_height"
        raise BadInput("machine.home", robot.home[i].tolist(), reason)


def _is_within(robot: Robot, q: Array) -> Mask:
    """Compare joint angles ``q`` (..., 4, 3), rad, with their ranges: (..., 4, 3), False also for NaN."""
    least, largest = np.moveaxis(robot.ranges, -1, 0)
    within: Mask = (least <= q) & (q <= largest)
    return within


def make_robot_mechanism(machine: RobotMachine) -> Mechanism:
    """Make the mechanism of a robot; raise BadInput if the model is missing, or cannot stand at this height."""
    robot = read_model(machine)
    stance = find_stance(robot, machine.hip_height, machine.width)
    return Mechanism(
        kind=CHAINS_UNDER_BODY,
        legs=stance.chains,
        hip_height=machine.hip_height,
        hips=np.ascontiguousarray(stance.hips[:, :2]),
        weight=robot.mass * GRAVITY,
        axes=SPACE,
        torque_limits=tuple(robot.torque_limits.tolist()),
        chains=stance.chains,
    )


def plan_robot(config: Config, machine: RobotMachine, mechanism: Mechanism, desired: Motion) -> Motion:
    """Plan the joint motion of a robot for the ``desired`` one of its feet; raise BadInput if joints do not reach."""
    assert mechanism.chains is not None
    robot = read_model(machine)
    home = robot.home  # decides to which side knees bend
    angles, rates, changes = np.empty((3, *desired.position.shape))
    for i, chain in enumerate(mechanism.chains):
        foot, velocity, acceleration = (values[:, i] for values in desired)
        angles[:, i] = chain_angles(chain, foot, home[i])
        rates[:, i], changes[:, i] = chain_motion(chain, angles[:, i], velocity, acceleration)
    if len(out := np.argwhere(~_is_within(robot, angles))):
        k, i, n = out[0]
        depression = float(desired.position[..., Y].max()) - machine.hip_height
        require_firm(config, depression, sum(robot.links) - machine.hip_height)
        name = robot.model.joint(int(robot.legs.joint[i, n])).name
        least, largest = robot.ranges[i, n]
        reason = (
            f"{name} would be at {angles[k, i, n]:.4g} rad at sample {k}, beyond its {least:.4g} to {largest:.4g}"
        )
        if np.isnan(angles[k, i, n]):
            reason = f"the {LEG_NAMES[i]} foot is out of reach at sample {k}"
        raise BadInput("gait.stroke", config.gait.stroke, f"{reason}; use a shorter one, or machine.hip_height")
    return Motion(angles, rates, changes)


@program
def _compute_centres(
    model: int, data: int, position: Array, joints: Counts, q: Array, centre: Array, centres: Array
) -> None:
    """Fill ``centres`` (N, 3), m, with MuJoCo's centre of mass at joint angles ``q`` (N, 12), rad.

    ``model`` and ``data`` are addresses; ``joints`` (12,) are the indices of the angles in ``position``, that of the
    data; MuJoCo writes to ``centre`` (3,), m.
    """
    for k in range(q.shape[0]):
        for j in range(q.shape[1]):
            position[joints[j]] = q[k, j]
        mj_kinematics(model, data)
        mj_comPos(model, data)
        copy_array(centre, centres[k])


def find_centres(machine: RobotMachine, q: Array) -> Array:
    """Compute the centres of mass (3, N) of a robot in the body frame, m, at joint angles ``q`` (N, 4, 3), rad."""
    robot = read_model(machine)
    origin = find_stance(robot, machine.hip_height, machine.width).origin
    data = robot.at(robot.home)
    load_library()
    addresses = robot.model._address, data._address  # the bindings have no public name for them
    centres = np.empty((len(q), 3))
    centre = data.subtree_com[robot.legs.base]
    _compute_centres(*addresses, data.qpos, robot.legs.qpos.ravel(), q.reshape(len(q), -1), centre, centres)
    return (centres - origin).T


def make_model(robot_model: Any, mass_factor: float = 1.0) -> Any:
    """Copy a model without contacts and with its masses and inertias times ``mass_factor``.

    ``robot_model`` is shared and stays as it is.
    """
    mujoco = load_mujoco()
    model = copy.copy(robot_model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.body_mass *= mass_factor
    model.body_inertia *= mass_factor
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def compute_needs(config: Config, joints: Motion, sway: Motion, mass_factor: float = 1.0) -> tuple[Array, Array]:
    """Compute the force on the body and the joint torques that the planned motion of ``joints`` and body requires.

    The result is, for the body (N, 6), force (N) in the world and moment about its origin (N m), and for the joints
    (N, 4, 3) torques without contact forces, N m. ``sway`` is the planned motion of the body besides its constant
    speed, ``mass_factor`` the assumed masses over those of the model.
    """
    mujoco = load_mujoco()
    robot = read_model(config.machine)
    origin = find_stance(robot, config.machine.hip_height, config.machine.width).origin
    legs = robot.legs
    model = make_model(robot.model, mass_factor)
    data = set_posture(model, mujoco.MjData(model), legs.joint, robot.home)
    rates = sway.velocity + np.array([config.body_speed, 0.0])
    needs = np.empty((len(rates), model.nv))
    for k, sample in enumerate(zip(*joints, strict=True)):
        data.qpos[legs.qpos], data.qvel[legs.dof], data.qacc[legs.dof] = sample
        data.qvel[legs.base_dof : legs.base_dof + 2] = rates[k]
        data.qacc[legs.base_dof : legs.base_dof + 2] = sway.acceleration[k]
        mujoco.mj_inverse(model, data)
        needs[k] = data.qfrc_inverse
    force, moment = np.split(needs[:, legs.base_dof : legs.base_dof + 6], 2, axis=1)
    return np.concatenate([force, moment - np.cross(origin, force)], axis=1), needs[:, legs.dof]


def compute_load(config: Config, joints: Motion, sway: Motion) -> BodyLoad:
    """Compute the load of the feet along the planned motion of the ``joints`` and of the body, ``sway``.

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
    """Compute the joint torques (N, 4, 3), N m, for the planned motion, with masses that are off by ``mass_factor``.

    ``joints`` and ``sway`` are the planned motion; ``load`` (N, 4) are vertical forces on the feet, N, in proportion
    to which the feet share the horizontal force; ``pressed`` (N, 4) are the vertical forces that these torques
    supply, N.
    """
    assert mechanism.chains is not None
    trunk, torque = compute_needs(config, joints, sway, mass_factor)
    share = load / load.sum(axis=1, keepdims=True)
    ground = np.stack([trunk[:, :1] * share, -pressed, trunk[:, 1:2] * share], axis=-1)
    for i, chain in enumerate(mechanism.chains):
        _, jacobian = batch_kinematics(chain, joints.position[:, i])
        torque[:, i] -= np.einsum("kjn,kj->kn", jacobian, ground[:, i])
    return torque


def compute_weight_of_masses(machine: QuadrupedMachine) -> float:
    """Compute the weight of the body and all its legs, N."""
    legs = 0.0
    for leg in machine.legs.in_order:  # sum() rounds differently from Python 3.12 on
        legs += leg.mass_1 + leg.mass_2
    return GRAVITY * (machine.body_mass + legs)


def make_leg(config: LegConfig) -> Leg:
    """Make the leg that a config describes."""
    knee = -1.0 if config.knee == "back" else 1.0
    return Leg(config.length_1, config.length_2, config.mass_1, config.mass_2, knee)


def make_mechanism(machine: LegMachine | PointMassMachine | QuadrupedMachine | RobotMachine) -> Mechanism:
    """Make the mechanism of the machine that a config describes."""
    if isinstance(machine, RobotMachine):
        return make_robot_mechanism(machine)
    if isinstance(machine, PointMassMachine):
        return point_mass(machine.mass, machine.hip_height)
    if isinstance(machine, QuadrupedMachine):
        legs = [make_leg(leg) for leg in machine.legs.in_order]
        weight = compute_weight_of_masses(machine) if machine.weight is None else machine.weight
        return legs_under_body(legs, machine.hip_height, machine.hips, weight)
    return legs_on_stand([make_leg(machine.leg)], machine.hip_height)


def check_load_sharing(config: Config) -> None:
    """Check that dynamic load sharing has a body whose weight is that of its masses; raise BadInput otherwise."""
    machine = config.machine
    if config.force_control.load_sharing == "static" or isinstance(machine, RobotMachine):
        return
    if not isinstance(machine, QuadrupedMachine):
        allowed = f"must be static with machine.kind={machine.kind}, whose force is force_control.desired_force"
        raise BadInput("force_control.load_sharing", config.force_control.load_sharing, allowed)
    of_masses = compute_weight_of_masses(machine)
    if machine.weight is not None and abs(machine.weight - of_masses) > TOLERANCE * of_masses:
        raise BadInput(
            "machine.weight",
            machine.weight,
            f"must be null or {of_masses:.6g} N, the weight of all masses, with force_control.load_sharing=dynamic",
        )
