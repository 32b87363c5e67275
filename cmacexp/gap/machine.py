"""A robot with its base held: the rigid-body equations of the joints of a log, from any MJCF or URDF model.

Joints that the log does not have are locked, the base is at rest. Joints that do not move each other are apart: each
leg, arm or finger is a block with equations of its own.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import config_folder
from cmacexp.errors import BadInput, suggest
from cmacexp.models.robot import compile_spec, load_mujoco, load_spec
from cmacexp.models.robot_file import find_model, package_models
from cmacexp.typing import Array, Counts

ROBOT_KEY = "--robot"
STEP = 1e-5
"""Of finite differences of the bias over joint angles, rad."""
COUPLED = 1e-9
"""Least part of the largest inertia, kg m^2, that one joint feels of another that moves it."""


class Losses(NamedTuple):
    """What a model says of joints (J,) beyond rigid bodies."""

    inertia: Array
    """Of the rotor, kg m^2."""
    viscous: Array
    """N m s/rad."""
    coulomb: Array
    """N m."""


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
    """MjModel, with rotors, damping and friction of these joints taken out."""
    losses: Losses
    """Those of the model."""
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
        mujoco, model, data = load_mujoco(), self.model, self._start()
        dof, rows, size = self.dof[block], len(angle), len(block)
        found = Expansion(
            np.ascontiguousarray(angle[:, block]),
            np.empty((rows, size, size)),
            np.empty((rows, size)),
            np.empty((rows, size, size)),
        )
        whole, free = np.zeros((model.nv, model.nv)), self._find_free()
        for k in range(rows):
            data.qpos[self.qpos], data.qvel[self.dof] = angle[k], velocity[k]
            if base is not None and free is not None:
                data.qpos[free + 3 : free + 7] = base[k]
            for j, place in enumerate(self.qpos[block]):
                data.qpos[place] += STEP
                _update(mujoco, model, data)
                found.gradient[k, :, j] = data.qfrc_bias[dof] - data.qfrc_spring[dof]
                data.qpos[place] -= STEP
            _update(mujoco, model, data)
            mujoco.mj_fullM(model, data, whole)
            found.mass[k] = whole[np.ix_(dof, dof)]
            found.bias[k] = data.qfrc_bias[dof] - data.qfrc_spring[dof]
        found.gradient[:] = (found.gradient - found.bias[:, :, None]) / STEP
        return found

    def compute_torque(self, angle: Array, velocity: Array, acceleration: Array, base: Array | None = None) -> Array:
        """Torque (N, J) of the rigid bodies for a motion (N, J) each, rad, rad/s, rad/s^2, N m."""
        mujoco, model, data = load_mujoco(), self.model, self._start()
        torque, whole, free = np.empty(angle.shape), np.empty(model.nv), self._find_free()
        for k in range(len(angle)):
            data.qpos[self.qpos], data.qvel[self.dof], data.qacc[self.dof] = angle[k], velocity[k], acceleration[k]
            if base is not None and free is not None:
                data.qpos[free + 3 : free + 7] = base[k]
            _update(mujoco, model, data)
            mujoco.mj_rne(model, data, 1, whole)
            torque[k] = whole[self.dof] - data.qfrc_spring[self.dof]
        return torque

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

    def _find_free(self) -> int | None:
        """Where the position of the base begins in ``qpos``; None if the model holds it."""
        free = np.flatnonzero(self.model.jnt_type == int(load_mujoco().mjtJoint.mjJNT_FREE))
        return int(self.model.jnt_qposadr[free[0]]) if free.size else None

    def _start(self) -> Any:
        data = load_mujoco().MjData(self.model)
        if self.model.nkey:
            data.qpos[:] = self.model.key_qpos[0]
        if (free := self._find_free()) is not None:
            data.qpos[free : free + 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        return data


def _update(mujoco: Any, model: Any, data: Any) -> None:
    """Inertia and bias at the positions and velocities of ``data``."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_crb(model, data)
    mujoco.mj_comVel(model, data)
    mujoco.mj_passive(model, data)
    mujoco.mj_rne(model, data, 0, data.qfrc_bias)


def read_machine(robot: str, names: Sequence[str], pairs: Sequence[str] = ()) -> Machine:
    """The machine of an option of ``conf/machine``, a model of the package or a file, for the joints of a log.

    ``pairs``, ``NAME_IN_LOG=NAME_IN_MODEL``, name what does not match by itself. Raises BadInput if there is no such
    robot, or a joint of the log cannot be found in it.
    """
    path = _find_path(robot)
    model = compile_spec(path, load_spec(path))
    mujoco = load_mujoco()
    if np.any(model.eq_active0):
        raise BadInput(ROBOT_KEY, robot, "has equality constraints, with which its joints are no chains: remove them")
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    joints = {model.joint(i).name: i for i in range(model.njnt) if int(model.jnt_type[i]) in kinds}
    matched = match_names(names, list(joints), dict(pair.partition("=")[::2] for pair in pairs))
    index = np.array([joints[name] for name in matched])
    dof, limited = model.jnt_dofadr[index], model.jnt_limited[index].astype(bool)
    losses = Losses(
        *(values[dof].copy() for values in (model.dof_armature, model.dof_damping, model.dof_frictionloss))
    )
    model.dof_armature[dof] = model.dof_damping[dof] = model.dof_frictionloss[dof] = 0.0
    machine = Machine(
        name=robot,
        path=path,
        joints=matched,
        model=model,
        losses=losses,
        ranges=np.where(limited[:, None], model.jnt_range[index], [-np.inf, np.inf]),
        qpos=model.jnt_qposadr[index].astype(np.int64),
        dof=dof.astype(np.int64),
        blocks=(),
    )
    return _find_blocks(mujoco, machine)


def _find_path(robot: str) -> Path:
    """The model of a robot that is named, or the file itself; raises BadInput."""
    import yaml

    if Path(robot).is_file():
        return find_model(None, robot)
    option = config_folder() / "machine" / f"{robot}.yaml"
    name = yaml.safe_load(option.read_text()).get("model", robot) if option.is_file() else robot
    if name in package_models() or option.is_file():
        return find_model(name, None)
    options = [path.stem for path in option.parent.glob("*.yaml")]
    allowed = "must be an option of conf/machine, or an MJCF or URDF file"
    raise BadInput(ROBOT_KEY, robot, f"{allowed}{suggest(robot, [*options, *package_models()])}")


def match_names(names: Sequence[str], joints: Sequence[str], pairs: dict[str, str]) -> tuple[str, ...]:
    """The joint of a model for each name of a log: given in ``pairs``, the same, or the only one that contains it.

    Letter case and separators do not matter. Names that are numbers count the joints of the model. Raises BadInput.
    """

    def plain(name: str) -> str:
        return "".join(c for c in name.lower() if c.isalnum())

    found = []
    for name in names:
        wanted = pairs.get(name, name)
        same = [joint for joint in joints if joint == wanted] or [j for j in joints if plain(j) == plain(wanted)]
        close = same or [joint for joint in joints if plain(wanted) in plain(joint)]
        if not close and wanted.isdigit() and int(wanted) < len(joints) == len(names):
            close = [joints[int(wanted)]]
        if len(close) != 1:
            what = (
                f"fits {' and '.join(close[:4])}" if close else f"has no joint in the model{suggest(wanted, joints)}"
            )
            reason = f"{what}; say --joints {name}=JOINT, with a joint of {', '.join(joints) or 'which it has none'}"
            raise BadInput("joint of the log", name, reason)
        found.append(close[0])
    if twice := next((each for each in found if found.count(each) > 1), None):
        both = " and ".join(name for name, each in zip(names, found, strict=True) if each == twice)
        raise BadInput("joint of the model", twice, f"fits {both} of the log; say which one it is by --joints")
    return tuple(found)


def _find_blocks(mujoco: Any, machine: Machine) -> Machine:
    """The machine with its blocks: joints are in one if the inertia of one contains the motion of the other."""
    data, model = machine._start(), machine.model
    data.qpos[machine.qpos] += 0.3  # where no inertia vanishes by chance
    _update(mujoco, model, data)
    whole = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, whole)
    mass = np.abs(whole[np.ix_(machine.dof, machine.dof)])
    linked = mass > COUPLED * mass.max()
    groups: list[set[int]] = []
    for joint in range(len(linked)):
        joined = {joint, *np.flatnonzero(linked[joint]).tolist()}
        touching = [group for group in groups if group & joined]
        groups = [group for group in groups if not group & joined] + [joined.union(*touching)]
    return replace(machine, blocks=tuple(np.array(sorted(group)) for group in sorted(groups, key=min)))
