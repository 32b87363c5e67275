"""A robot with its base held: the rigid-body equations of the joints of a log, from any MJCF or URDF model.

Joints that the log does not have are locked, the base is at rest. Joints without inertial coupling are separated:
each leg, arm or finger is a block with its own equations.
"""

import copy
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.gap.matching import list_absent, match_names
from cmacexp.addons.gap.replay import Expansion
from cmacexp.config import config_folder
from cmacexp.errors import require, suggest
from cmacexp.models.joint import OWN
from cmacexp.models.robot import UPRIGHT, compile_spec, load_mujoco, load_spec
from cmacexp.models.robot_file import find_model, package_models
from cmacexp.typing import Array, Counts, Mask

ROBOT_KEY = "--robot"
STEP = 1e-5
"""Step of finite differences of the bias over joint angles, rad."""
COUPLED = 1e-9
"""Coupling inertia of two joints of one block, over the largest inertia, above which they count as coupled."""


@dataclass(frozen=True)
class Machine:
    """The model of a robot whose base is held; joints are in the order of the log."""

    name: str
    path: Path
    joints: tuple[str, ...]
    """Names of the joints in the model."""
    model: Any
    """MjModel without constraints, and without rotor inertia, damping and friction of these joints."""
    losses: Array
    """(J, 5) parameters of these joints in the model, see :class:`cmacexp.addons.gap.replay.JointParams`."""
    ranges: Array
    """(J, 2) least and largest angle, rad; infinite without a limit."""
    qpos: Counts
    """(J,) indices of the joint angles in ``MjData.qpos``."""
    dof: Counts
    """(J,) indices of the joint velocities in ``MjData.qvel``."""
    blocks: tuple[Counts, ...]
    """Numbers of the joints of each block, in the order of the log."""
    is_prismatic: Mask
    """(J,) true for joints that slide: their units are m, N, N s/m and kg."""
    absent: tuple[str, ...] = ()
    """Joints of the log that the model lacks, and that are left out."""

    @property
    def has_limbs(self) -> bool:
        """True if the joints are those of several limbs, such as legs."""
        return len(self.blocks) > 1

    def expand(self, block: Counts, angle: Array, velocity: Array, base: Array | None = None) -> Expansion:
        """Expand the equations of a ``block`` along ``angle``, rad, and ``velocity``, rad/s, (N, J) of all joints.

        ``base`` (N, 4) is the orientation of the base, a quaternion w, x, y, z; None: as in the model.
        """
        mujoco = load_mujoco()
        dof = self.dof[block]
        angles = np.ascontiguousarray(angle[:, block])
        matrices = (*angles.shape, len(block))
        expansion = Expansion(angles, np.empty(matrices), np.empty_like(angles), np.empty(matrices))
        whole = np.zeros((self.model.nv, self.model.nv))
        for k, data in enumerate(self._visit(angle, velocity, base)):
            for j, index in enumerate(self.qpos[block]):
                data.qpos[index] += STEP
                mujoco.mj_step1(self.model, data)
                expansion.gradient[k, :, j] = data.qfrc_bias[dof] - data.qfrc_passive[dof]
                data.qpos[index] -= STEP
            mujoco.mj_step1(self.model, data)
            mujoco.mj_fullM(self.model, data, whole)
            expansion.mass[k] = whole[np.ix_(dof, dof)]
            expansion.bias[k] = data.qfrc_bias[dof] - data.qfrc_passive[dof]
        expansion.gradient[:] = (expansion.gradient - expansion.bias[:, :, None]) / STEP
        return expansion

    def compute_torque(self, angle: Array, velocity: Array, acceleration: Array, base: Array | None = None) -> Array:
        """Compute the torque (N, J) of the rigid bodies by inverse dynamics, N m.

        Angles, rad, velocities, rad/s, and accelerations, rad/s^2, are (N, J); ``base`` is as in :meth:`expand`.
        """
        mujoco = load_mujoco()
        torque = np.empty(angle.shape)
        for k, data in enumerate(self._visit(angle, velocity, base)):
            data.qacc[self.dof] = acceleration[k]
            mujoco.mj_step1(self.model, data)
            mujoco.mj_rne(self.model, data, 1, data.qfrc_inverse)
            torque[k] = data.qfrc_inverse[self.dof] - data.qfrc_passive[self.dof]
        return torque

    def _visit(self, angle: Array, velocity: Array, base: Array | None) -> Iterator[Any]:
        """Yield MuJoCo's data with the angles and velocities of each row in turn, the base at rest at the origin.

        A base that does not float is turned by the opposite turn of gravity.
        """
        mujoco = load_mujoco()
        model = self.model
        gravity = model.opt.gravity.copy()
        data = mujoco.MjData(model)
        if model.nkey:
            data.qpos[:] = model.key_qpos[0]
        turns = model.jnt_qposadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE), None] + np.arange(7)
        data.qpos[turns] = UPRIGHT
        for k in range(len(angle)):
            data.qpos[self.qpos], data.qvel[self.dof] = angle[k], velocity[k]
            if base is not None and turns.size:
                data.qpos[turns[:, 3:]] = base[k]
            elif base is not None:
                mujoco.mju_rotVecQuat(model.opt.gravity, gravity, base[k] * [1.0, -1.0, -1.0, -1.0])
            yield data
        model.opt.gravity[:] = gravity

    def find_link(self, joint: int) -> tuple[str, Counts]:
        """Return the name of the link that a joint moves, and the indices in the model of all bodies welded to it."""
        body = self.model.jnt_bodyid[np.flatnonzero(self.model.jnt_dofadr == self.dof[joint])[0]]
        welded = np.flatnonzero(self.model.body_weldid == self.model.body_weldid[body])
        return str(self.model.body(body).name), welded.astype(np.int64)

    def scale_masses(self, factors: Mapping[int, float]) -> "Machine":
        """Return the machine with mass and inertia of links scaled by ``factors``, by number of the joint."""
        model = copy.copy(self.model)
        for joint, factor in factors.items():
            _, bodies = self.find_link(joint)
            model.body_mass[bodies] *= factor
            model.body_inertia[bodies] *= factor
        load_mujoco().mj_setConst(model, load_mujoco().MjData(model))
        return replace(self, model=model)

    def set_gravity(self, gravity: Array) -> "Machine":
        """Return the machine with another ``gravity`` (3,) in the frame of the world, m/s^2."""
        model = copy.copy(self.model)
        model.opt.gravity[:] = gravity
        return replace(self, model=model)

    def turn_base(self, roll: float, pitch: float) -> "Machine":
        """Return the machine with its base tilted by small angles, rad, which rotates gravity in its frame."""
        model = copy.copy(self.model)
        x, y, z = model.opt.gravity
        model.opt.gravity[:] = (x - pitch * z, y + roll * z, z + pitch * x - roll * y)
        return replace(self, model=model)


def read_machine(
    robot: str,
    names: Sequence[str],
    pairs: Mapping[str, str] | None = None,
    left_out: Sequence[str] = (),
    still: Collection[str] = (),
) -> Machine:
    """Read the model of a ``robot`` for the joints of a log, whose ``names`` are given, and of those ``left_out``.

    Constraints between joints that are ``still`` in the log do not matter.
    ``robot`` is an option of ``conf/machine``, a model of the package, or a file. ``pairs``, names in the model by
    names in the log, are for joints that are called differently. Raises BadInput if there is no such robot, or if a
    joint of the log is not found in it.
    """
    path = _find_path(robot)
    model = compile_spec(path, load_spec(path))
    mujoco = load_mujoco()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    kinds = [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)]
    joints = {model.joint(i).name: i for i in np.flatnonzero(np.isin(model.jnt_type, kinds)).tolist()}
    absent = list_absent(names, list(joints), pairs or {})
    names = [name for name in names if name not in absent]
    matched = match_names(names, list(joints), pairs or {}, [*left_out, *absent])
    index = np.array([joints[name] for name in matched])
    for number in np.flatnonzero(model.eq_active0).tolist():
        joined = _list_constrained(model, number, index)
        moved = [(name, joint) for name, joint in zip(names, index.tolist(), strict=True) if name not in still]
        said = [name for name, joint in moved if joint in joined]
        require(
            not said,
            ROBOT_KEY,
            robot,
            f"the constraint {model.eq(number).name or number} closes a loop over {', '.join(said)}, which the log "
            f"moves; equations of joints are those of chains: --leave-out {','.join(said)}, or remove the constraint",
        )
    dof = model.jnt_dofadr[index].astype(np.int64)
    losses = np.zeros((len(dof), OWN + 1))
    for k, values in {0: model.dof_armature, 1: model.dof_damping, OWN: model.dof_frictionloss}.items():
        losses[:, k] = values[dof]
        values[dof] = 0.0
    machine = Machine(
        name=robot,
        path=path,
        joints=matched,
        model=model,
        losses=losses,
        ranges=np.where(model.jnt_limited[index, None].astype(bool), model.jnt_range[index], [-np.inf, np.inf]),
        qpos=model.jnt_qposadr[index].astype(np.int64),
        dof=dof,
        blocks=(np.arange(len(dof)),),
        is_prismatic=model.jnt_type[index] == int(mujoco.mjtJoint.mjJNT_SLIDE),
        absent=tuple(absent),
    )
    return replace(machine, blocks=_find_blocks(machine))


def _list_constrained(model: Any, constraint: int, joints: Array) -> list[int]:
    """Return those of the ``joints`` between which, or between which and held ones, a constraint acts.

    A constraint of joints acts on these, one of bodies on the joints between each body and the base.
    """
    mujoco = load_mujoco()
    pair: tuple[Any, ...] = (model.eq_obj1id[constraint], model.eq_obj2id[constraint])
    if model.eq_type[constraint] == int(mujoco.mjtEq.mjEQ_JOINT):
        return [int(joint) for joint in joints if joint in pair]
    if model.eq_type[constraint] not in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
        return [int(joint) for joint in joints]  # of tendons or flexible bodies
    if model.eq_objtype[constraint] == int(mujoco.mjtObj.mjOBJ_SITE):
        pair = tuple(model.site_bodyid[site] for site in pair)
    chains = []
    for end in pair:
        chain = set[int]()
        body = int(end)
        while body > 0:
            chain |= {int(joint) for joint in joints if model.jnt_bodyid[joint] == body}
            body = int(model.body_parentid[body])
        chains.append(chain)
    return sorted(chains[0] ^ chains[1])


def _find_path(robot: str) -> Path:
    """Return the model file of a robot, or the file itself if ``robot`` is a path; raise BadInput."""
    import yaml

    if Path(robot).is_file():
        return find_model(None, robot)
    option = config_folder() / "machine" / f"{robot}.yaml"
    names = [path.stem for path in option.parent.glob("*.yaml")] + [*package_models()]
    absent = "there is no such file; it " if Path(robot).suffix else ""
    reason = f"{absent}must be an option of conf/machine, or an MJCF or URDF file{suggest(robot, names)}"
    require(robot in names, ROBOT_KEY, robot, reason)
    return find_model(yaml.safe_load(option.read_text()).get("model", robot) if option.is_file() else robot, None)


def _find_blocks(machine: Machine) -> tuple[Counts, ...]:
    """Return the blocks of joints that are coupled by the joint-space inertia, directly or through others."""
    from scipy.sparse.csgraph import connected_components

    angle = np.full((1, len(machine.joints)), 0.3)  # rad: a generic pose, in which no coupling happens to vanish
    mass = np.abs(machine.expand(machine.blocks[0], angle, np.zeros_like(angle)).mass[0])
    count, block = connected_components(mass > COUPLED * mass.max())
    return tuple(np.flatnonzero(block == number) for number in range(count))
