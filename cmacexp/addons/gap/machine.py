"""A robot with its base held: the rigid-body equations of the joints of a log, from any MJCF or URDF model.

Joints that the log does not have are locked, the base is at rest. Joints that do not move each other are apart: each
leg, arm or finger is a block with equations of its own.
"""

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import config_folder
from cmacexp.errors import require, suggest
from cmacexp.models.joint import OWN
from cmacexp.models.robot import UPRIGHT, compile_spec, load_mujoco, load_spec
from cmacexp.models.robot_file import find_model, package_models
from cmacexp.typing import Array, Counts

ROBOT_KEY = "--robot"
STEP = 1e-5
"""Step of finite differences of the bias over joint angles, rad."""
COUPLED = 1e-9
"""Least part of the largest inertia, kg m^2, that one joint feels of another that moves it."""


class Expansion(NamedTuple):
    """The equations of one block of B joints along angles and velocities of N rows, to first order in the angles."""

    angle: Array
    """(N, B) where they are expanded, rad."""
    mass: Array
    """(N, B, B), kg m^2, without rotors."""
    bias: Array
    """(N, B) gravity, Coriolis and centrifugal torque, and springs of the model, N m."""
    gradient: Array
    """(N, B, B) of the bias over the angles, N m/rad."""


@dataclass(frozen=True)
class Machine:
    """A robot whose base is held, with the joints of a log in their order there."""

    name: str
    path: Path
    joints: tuple[str, ...]
    """Names in the model."""
    model: Any
    """MjModel without constraints, with rotors, damping and friction of these joints taken out."""
    losses: Array
    """(J, 5): what the model says of these joints, as :class:`cmacexp.addons.gap.replay.JointParams` has it."""
    ranges: Array
    """(J, 2) least and largest angle, rad; infinite without a limit."""
    qpos: Counts
    dof: Counts
    blocks: tuple[Counts, ...]
    """Joints of each block, by their place in the log."""

    def expand(self, block: Counts, angle: Array, velocity: Array, base: Array | None = None) -> Expansion:
        """The equations of a ``block`` along ``angle`` and ``velocity`` (N, J) of all joints, rad, rad/s.

        ``base`` (N, 4) is the orientation of the base, a quaternion w, x, y, z; None: as in the model.
        """
        mujoco, dof, rows, size = load_mujoco(), self.dof[block], len(angle), len(block)
        found = Expansion(
            np.ascontiguousarray(angle[:, block]),
            np.empty((rows, size, size)),
            np.empty((rows, size)),
            np.empty((rows, size, size)),
        )
        whole = np.zeros((self.model.nv, self.model.nv))
        for k, data in enumerate(self._visit(angle, velocity, base)):
            for j, place in enumerate(self.qpos[block]):
                data.qpos[place] += STEP
                mujoco.mj_step1(self.model, data)
                found.gradient[k, :, j] = data.qfrc_bias[dof] - data.qfrc_passive[dof]
                data.qpos[place] -= STEP
            mujoco.mj_step1(self.model, data)
            mujoco.mj_fullM(self.model, data, whole)
            found.mass[k] = whole[np.ix_(dof, dof)]
            found.bias[k] = data.qfrc_bias[dof] - data.qfrc_passive[dof]
        found.gradient[:] = (found.gradient - found.bias[:, :, None]) / STEP
        return found

    def compute_torque(self, angle: Array, velocity: Array, acceleration: Array, base: Array | None = None) -> Array:
        """Torque (N, J) of the rigid bodies for a motion (N, J) each, rad, rad/s, rad/s^2, N m."""
        mujoco, torque = load_mujoco(), np.empty(angle.shape)
        for k, data in enumerate(self._visit(angle, velocity, base)):
            data.qacc[self.dof] = acceleration[k]
            mujoco.mj_step1(self.model, data)
            mujoco.mj_rne(self.model, data, 1, data.qfrc_inverse)
            torque[k] = data.qfrc_inverse[self.dof] - data.qfrc_passive[self.dof]
        return torque

    def _visit(self, angle: Array, velocity: Array, base: Array | None) -> Iterator[Any]:
        """MuJoCo's data with the angles and velocities of each row in turn; the base is at rest at the origin."""
        mujoco, model = load_mujoco(), self.model
        data, kinds = mujoco.MjData(model), model.jnt_type
        if model.nkey:
            data.qpos[:] = model.key_qpos[0]
        turns = model.jnt_qposadr[kinds == int(mujoco.mjtJoint.mjJNT_FREE), None] + np.arange(7)
        data.qpos[turns] = UPRIGHT
        for k in range(len(angle)):
            data.qpos[self.qpos], data.qvel[self.dof] = angle[k], velocity[k]
            if base is not None:
                data.qpos[turns[:, 3:]] = base[k]
            yield data

    def find_link(self, joint: int) -> tuple[str, Counts]:
        """The body that a joint moves and those welded to it: its name, and their numbers in the model."""
        body = self.model.jnt_bodyid[np.flatnonzero(self.model.jnt_dofadr == self.dof[joint])[0]]
        welded = np.flatnonzero(self.model.body_weldid == self.model.body_weldid[body])
        return str(self.model.body(body).name), welded.astype(np.int64)

    def scale_masses(self, factors: Mapping[int, float]) -> "Machine":
        """The machine with mass and inertia of the links of joints times ``factors``, which follow by joint."""
        model = copy.copy(self.model)
        for joint, factor in factors.items():
            _, bodies = self.find_link(joint)
            model.body_mass[bodies] *= factor
            model.body_inertia[bodies] *= factor
        load_mujoco().mj_setConst(model, load_mujoco().MjData(model))
        return replace(self, model=model)

    def turn_base(self, roll: float, pitch: float) -> "Machine":
        """The machine whose base is turned by small angles, rad: gravity is turned the other way."""
        model = copy.copy(self.model)
        x, y, z = model.opt.gravity
        model.opt.gravity[:] = (x - pitch * z, y + roll * z, z + pitch * x - roll * y)
        return replace(self, model=model)


def read_machine(robot: str, names: Sequence[str], pairs: Mapping[str, str] | None = None) -> Machine:
    """The machine of an option of ``conf/machine``, a model of the package or a file, for the joints of a log.

    ``pairs``, names in the model by names in the log, are for what does not match by itself. Raises BadInput if there
    is no such robot, or a joint of the log cannot be found in it.
    """
    path = _find_path(robot)
    model = compile_spec(path, load_spec(path))
    mujoco = load_mujoco()
    require(
        not np.any(model.eq_active0),
        ROBOT_KEY,
        robot,
        "has equality constraints, with which its joints are no chains: remove them",
    )
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    kinds = [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)]
    joints = {model.joint(i).name: i for i in np.flatnonzero(np.isin(model.jnt_type, kinds)).tolist()}
    matched = match_names(names, list(joints), pairs or {})
    index = np.array([joints[name] for name in matched])
    dof, limited = model.jnt_dofadr[index].astype(np.int64), model.jnt_limited[index].astype(bool)
    losses = np.zeros((len(dof), OWN + 1))
    for k, values in {0: model.dof_armature, 1: model.dof_damping, OWN: model.dof_frictionloss}.items():
        losses[:, k], values[dof] = values[dof], 0.0
    machine = Machine(
        name=robot,
        path=path,
        joints=matched,
        model=model,
        losses=losses,
        ranges=np.where(limited[:, None], model.jnt_range[index], [-np.inf, np.inf]),
        qpos=model.jnt_qposadr[index].astype(np.int64),
        dof=dof,
        blocks=(np.arange(len(dof)),),
    )
    return replace(machine, blocks=_find_blocks(machine))


def _find_path(robot: str) -> Path:
    """The model of a robot that is named, or the file itself; raises BadInput."""
    import yaml

    if Path(robot).is_file():
        return find_model(None, robot)
    option = config_folder() / "machine" / f"{robot}.yaml"
    known = [path.stem for path in option.parent.glob("*.yaml")] + [*package_models()]
    require(
        robot in known,
        ROBOT_KEY,
        robot,
        f"must be an option of conf/machine, or an MJCF or URDF file{suggest(robot, known)}",
    )
    return find_model(yaml.safe_load(option.read_text()).get("model", robot) if option.is_file() else robot, None)


def match_names(names: Sequence[str], joints: Sequence[str], pairs: Mapping[str, str]) -> tuple[str, ...]:
    """The joint of a model for each name of a log: given in ``pairs``, the same, or the only one that contains it.

    Letter case and separators do not matter. Names that are numbers count the joints of the model. Raises BadInput.
    """

    def plain(name: str) -> str:
        return "".join(c for c in name.lower() if c.isalnum())

    for name, joint in pairs.items():
        require(
            name in names,
            "--joints",
            f"{name}={joint}",
            f"the log has no joint {name}{suggest(name, names)}; it has {', '.join(names)}",
        )
    found = []
    for name in names:
        wanted = pairs.get(name, name)
        equal = [joint for joint in joints if plain(joint) == plain(wanted)]
        close = [wanted] if wanted in joints else equal or [j for j in joints if plain(wanted) in plain(j)]
        if not close and wanted.isdigit() and int(wanted) < len(joints) == len(names):
            close = [joints[int(wanted)]]
        what = f"fits {' and '.join(close[:4])}" if close else f"has no joint in the model{suggest(wanted, joints)}"
        require(
            len(close) == 1,
            "joint of the log",
            name,
            f"{what}; say --joints {name}=JOINT, with a joint of {', '.join(joints) or 'which it has none'}",
        )
        found += close
    for joint in found:
        both = [name for name, each in zip(names, found, strict=True) if each == joint]
        require(
            len(both) == 1,
            "joint of the model",
            joint,
            f"fits {' and '.join(both)} of the log; say which one it is by --joints",
        )
    return tuple(found)


def _find_blocks(machine: Machine) -> tuple[Counts, ...]:
    """Joints that move each other, block by block: the inertia of one contains the motion of the other."""
    from scipy.sparse.csgraph import connected_components

    somewhere = np.full((1, len(machine.joints)), 0.3)  # where no inertia vanishes by chance
    mass = np.abs(machine.expand(machine.blocks[0], somewhere, np.zeros_like(somewhere)).mass[0])
    count, block = connected_components(mass > COUPLED * mass.max())
    return tuple(np.flatnonzero(block == number) for number in range(count))
