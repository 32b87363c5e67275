"""The legs of a model by the names of their joints and feet, or why the model is no quadruped of the project."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.typing import Array, Counts

LEGS, JOINTS = 4, 3
MOST_NAMES = 16
"""Names that a message lists."""


@dataclass(frozen=True, eq=False)
class Legs:
    """Indices into MuJoCo's arrays; legs in the order front left, front right, rear left, rear right."""

    base: int
    """Body with the free joint."""
    base_qpos: int
    """Address of the first of its seven positions."""
    base_dof: int
    """Address of the first of its six velocities."""
    joint: Counts
    """(4, 3) joints."""
    qpos: Counts
    """(4, 3) addresses of the joint angles."""
    dof: Counts
    """(4, 3) addresses of the joint velocities."""
    foot_geom: Counts
    """(4,) geoms of the feet."""
    foot_body: Counts
    """(4,) bodies to which they are fixed."""
    foot_radius: Array
    """(4,) m."""


def require_names(joints: Sequence[Sequence[str]], feet: Sequence[str], home: Sequence[float]) -> None:
    """Require names for four legs of three joints, and an angle for each of the three.

    Raises:
        BadInput: names the config key.
    """
    if len(joints) != LEGS or any(len(leg) != JOINTS for leg in joints):
        raise BadInput("machine.joints", _shape(joints), "must be four lists of three names: hip, thigh, calf")
    if len(home) != JOINTS:
        raise BadInput("machine.home", list(home), "must be three angles: hip, thigh, calf")
    if len(feet) != LEGS or len(set(feet)) != LEGS:
        raise BadInput("machine.feet", ", ".join(feet), "must be four names of geoms, a different one for each leg")


def find_legs(mujoco: Any, model: Any, path: Path, joints: Sequence[Sequence[str]], feet: Sequence[str]) -> Legs:
    """The legs of a model.

    Args:
        mujoco: the module.
        model: its MjModel.
        path: of its file.
        joints: names of hip, thigh and calf joint of each leg.
        feet: names of the geoms of the feet.

    Raises:
        BadInput: the model lacks one of them, or moves otherwise than a trunk on four legs of three hinges.
    """
    joint = np.array([[_find_joint(mujoco, model, name) for name in leg] for leg in joints])
    foot = np.array([_find_foot(mujoco, model, name) for name in feet])
    free = _find_free(mujoco, model, path)
    others = sorted(set(range(model.njnt)) - {free, *joint.ravel()})
    if others:
        more = _listed(_name(model.joint(k)) for k in others)
        raise BadInput("machine.joints", more, "moves, too: a leg has three joints; weld the others in the model")
    for leg, place, name in zip(joint, foot, feet, strict=True):
        _require_chain(model, free, leg, place, name)
    _require_corners(mujoco, model, int(model.jnt_bodyid[free]), foot, feet)
    return Legs(
        base=int(model.jnt_bodyid[free]),
        base_qpos=int(model.jnt_qposadr[free]),
        base_dof=int(model.jnt_dofadr[free]),
        joint=joint,
        qpos=model.jnt_qposadr[joint].astype(np.int64),
        dof=model.jnt_dofadr[joint].astype(np.int64),
        foot_geom=foot,
        foot_body=model.geom_bodyid[foot].astype(np.int64),
        foot_radius=model.geom_size[foot, 0].copy(),
    )


def torque_limits(mujoco: Any, model: Any, joints: Sequence[Sequence[str]], index: Counts) -> Array:
    """Largest torques (3,) of hip, thigh and calf, the least of all legs, N m; infinite without a limit.

    Args:
        mujoco: the module.
        model: its MjModel.
        joints: names of the joints of each leg.
        index: (4, 3) the joints in the model.

    Raises:
        BadInput: a joint has no actuator.
    """
    limits = [
        [_torque_limit(mujoco, model, name, int(joint)) for name, joint in zip(leg, row, strict=True)]
        for leg, row in zip(joints, index, strict=True)
    ]
    return np.min(limits, axis=0)


def _torque_limit(mujoco: Any, model: Any, name: str, joint: int) -> float:
    """The least of what the actuators of a joint, and the joint itself, allow, N m."""
    at_joint = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    actuators = np.flatnonzero(at_joint)
    if not len(actuators):
        raise BadInput("machine.joints", name, "has no actuator in the model; give it a motor: <motor joint=.../>")
    limits = [np.abs(model.jnt_actfrcrange[joint]).min()] if model.jnt_actfrclimited[joint] else []
    for k in actuators:
        gear = abs(model.actuator_gear[k, 0])
        if model.actuator_forcelimited[k]:
            limits.append(np.abs(model.actuator_forcerange[k]).min() * gear)
        # Of a servo the control is no force.
        is_motor = model.actuator_biastype[k] == mujoco.mjtBias.mjBIAS_NONE
        if is_motor and model.actuator_ctrllimited[k]:
            limits.append(np.abs(model.actuator_ctrlrange[k]).min() * abs(model.actuator_gainprm[k, 0]) * gear)
    return float(min(limits, default=np.inf))


def _find_free(mujoco: Any, model: Any, path: Path) -> int:
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if not len(free):
        raise BadInput("machine.path", path, "has no free joint: its trunk must float, <freejoint/>")
    return int(free[0])


def _find_joint(mujoco: Any, model: Any, name: str) -> int:
    names = [_name(model.joint(k)) for k in range(model.njnt)]
    if name not in names:
        raise BadInput("machine.joints", name, f"is no joint of the model, which has {_listed(names)}")
    index = names.index(name)
    if model.jnt_type[index] != mujoco.mjtJoint.mjJNT_HINGE:
        raise BadInput("machine.joints", name, "must be a hinge: legs have neither wheels nor slides")
    return index


def _find_foot(mujoco: Any, model: Any, name: str) -> int:
    names = [model.geom(k).name for k in range(model.ngeom)]
    if name not in names:
        known = _listed(filter(None, names)) or "none with a name"
        raise BadInput("machine.feet", name, f"is no geom of the model, which has {known}")
    index = names.index(name)
    if model.geom_type[index] != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise BadInput("machine.feet", name, "must be a sphere")
    return index


def _require_chain(model: Any, free: int, leg: Counts, foot: int, name: str) -> None:
    """Require that a foot hangs on the trunk by the three joints of its leg, in their order."""
    chain: list[int] = []
    body = int(model.geom_bodyid[foot])
    while body:
        first = int(model.body_jntadr[body])
        chain = [*range(first, first + int(model.body_jntnum[body])), *chain]
        body = int(model.body_parentid[body])
    if chain != [free, *leg]:
        expected, actual = (_listed(_name(model.joint(int(k))) for k in joints) for joints in (leg, chain[1:]))
        raise BadInput("machine.feet", name, f"must hang on {expected}, but hangs on {actual or 'the trunk alone'}")


def _require_corners(mujoco: Any, model: Any, trunk: int, foot: Counts, feet: Sequence[str]) -> None:
    """Require the order of the feet in the pose that the model stands in."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    at = (data.geom_xpos[foot] - data.xpos[trunk]) @ data.xmat[trunk].reshape(3, 3)
    forward, left = at[[0, 1], 0] - at[[2, 3], 0], at[[0, 2], 1] - at[[1, 3], 1]
    if min(*forward, *left) <= 0.0:
        order = "front left, front right, rear left, rear right (trunk: x forward, y left)"
        raise BadInput("machine.feet", ", ".join(feet), f"must be in the order {order}")


def _shape(joints: Sequence[Sequence[str]]) -> str:
    return f"{len(joints)} lists of {', '.join(str(len(leg)) for leg in joints)} names"


def _name(joint: Any) -> str:
    return joint.name or f"joint {joint.id} (without a name)"


def _listed(names: Iterable[str]) -> str:
    first, more = (names := list(names))[:MOST_NAMES], len(names) - MOST_NAMES
    return ", ".join(first) + (f" and {more} more" if more > 0 else "")
