"""Legs of a model from the names of their joints and feet, and the checks that the model is a supported quadruped.

A foot touches the ground with a sphere, found by the name of a geom, a site or a body. A sphere is its own foot. Any
other foot gets a massless sphere at its point of contact at home: for a capsule in its lower end, with its radius;
at a site; for any other shape a point in the middle of its lowest points.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, require, suggest
from cmacexp.typing import Array, Counts

POINT = 0.001
"""Radius of a foot that has none, m."""
FLAT = 0.02
"""Fraction of the height of a shape up to which its points count as the lowest ones."""
Sphere = tuple[int, Array, float]
"""Body, centre (3,) in the world, m, and radius, m."""


def place_feet(mujoco: Any, spec: Any, data: Any, feet: Sequence[str], spheres: Sequence[Sphere | None]) -> list[str]:
    """Add the ``spheres`` of the ``feet`` to the ``spec`` of a model; return the geom names of the four feet."""
    bodies = {body.id: body for body in spec.bodies}
    for name, sphere in zip(feet, spheres, strict=True):
        if sphere:
            body, centre, radius = sphere
            geom = bodies[body].add_geom(name=f"{name} (foot)", type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0, group=3)
            geom.pos = (centre - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
            geom.size = [radius, 0.0, 0.0]
            geom.contype = geom.conaffinity = 0
    return [f"{name} (foot)" if sphere else name for name, sphere in zip(feet, spheres, strict=True)]


def find_foot(mujoco: Any, model: Any, data: Any, name: str) -> Sphere | None:
    """Find the contact sphere of the geom, site or body ``name``; return None for a geom that is a sphere.

    ``data`` has the trunk level and the legs at home. Raises BadInput if the model has no such name.
    """
    kinds = mujoco.mjtObj
    geom, site, body = (
        int(mujoco.mj_name2id(model, kind, name)) for kind in (kinds.mjOBJ_GEOM, kinds.mjOBJ_SITE, kinds.mjOBJ_BODY)
    )
    is_sphere = model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    if geom >= 0:
        return None if is_sphere[geom] else _touch(mujoco, model, data, geom)
    if site >= 0:
        return int(model.site_bodyid[site]), data.site_xpos[site].copy(), POINT
    if body > 0:
        geoms = np.flatnonzero(model.geom_bodyid == body)
        spheres = geoms[is_sphere[geoms]]
        touching = [_touch(mujoco, model, data, int(k)) for k in (spheres if len(spheres) else geoms)]
        origin = body, data.xpos[body].copy(), POINT
        return min(touching, key=lambda sphere: float(sphere[1][2]) - sphere[2], default=origin)
    kinds_of_names = (model.geom, model.ngeom), (model.site, model.nsite), (model.body, model.nbody)
    present = dict.fromkeys(get(k).name for get, count in kinds_of_names for k in range(count))
    names = [text for text in present if text not in ("", "world")]
    near = suggest(name, names) or f"; {HINT}"
    reason = f"is no geom, site or body of the model, which has {list_names(names)}{near}"
    raise BadInput("machine.feet", name, reason)


def _touch(mujoco: Any, model: Any, data: Any, geom: int) -> Sphere:
    """Find the sphere with which a geom touches level ground."""
    kind = model.geom_type[geom]
    kinds = mujoco.mjtGeom
    size = model.geom_size[geom]
    body = int(model.geom_bodyid[geom])
    centre = data.geom_xpos[geom]
    turn = data.geom_xmat[geom].reshape(3, 3)
    if kind == kinds.mjGEOM_SPHERE:
        return body, centre.copy(), float(size[0])
    if kind == kinds.mjGEOM_CAPSULE:
        return body, centre - np.sign(turn[2, 2]) * size[1] * turn[:, 2], float(size[0])
    angle, level = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False), np.linspace(-1.0, 1.0, 17))
    width = 1.0 if kind == kinds.mjGEOM_CYLINDER else np.sqrt(1.0 - level**2)
    if kind == kinds.mjGEOM_MESH:
        first, count = (int(values[model.geom_dataid[geom]]) for values in (model.mesh_vertadr, model.mesh_vertnum))
        points = model.mesh_vert[first : first + count]
    elif kind == kinds.mjGEOM_BOX:
        points = size * np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    else:
        size = size[[0, 0, 1]] if kind == kinds.mjGEOM_CYLINDER else size
        points = size * np.stack([width * np.cos(angle), width * np.sin(angle), level], axis=-1).reshape(-1, 3)
    world = centre + points @ turn.T
    low = world[:, 2] - world[:, 2].min() <= FLAT * np.ptp(world[:, 2])
    return body, world[low].mean(axis=0), POINT


LEGS = 4
"""Legs of a quadruped."""
JOINTS = 3
"""Joints per leg."""
MOST_NAMES = 16
"""Names that a message lists."""
LEAST_COSINE = 0.96
"""Least cosine of the angle between an axis of the trunk frame and that of the robot, about 15 degrees."""
HINT = "python -m cmacexp.robots FILE finds its legs"


@dataclass(frozen=True, eq=False)
class Legs:
    """Indices into MuJoCo's arrays; legs in the order front left, front right, rear left, rear right."""

    base: int
    """Number of the body with the free joint."""
    base_qpos: int
    """Address of the first of the seven positions of the free joint."""
    base_dof: int
    """Address of the first of the six velocities of the free joint."""
    joint: Counts
    """(4, 3) numbers of the joints."""
    qpos: Counts
    """(4, 3) addresses of the joint angles."""
    dof: Counts
    """(4, 3) addresses of the joint velocities."""
    foot_geom: Counts
    """(4,) numbers of the geoms of the feet."""
    foot_radius: Array
    """(4,) radii of the feet, m."""


def require_joints(joints: Sequence[Sequence[str]]) -> None:
    """Require names of joints (4, 3); raises BadInput."""
    has_names = len(joints) == LEGS and all(len(leg) == JOINTS for leg in joints)
    require(has_names, "machine.joints", joints, "must be four lists of three names: hip, thigh, calf")


def require_feet(feet: Sequence[str]) -> None:
    """Require four different names of feet; raises BadInput."""
    require(
        len(feet) == len(set(feet)) == LEGS,
        "machine.feet",
        ", ".join(feet),
        "must be four names of geoms, sites or bodies, a different one for each leg",
    )


def find_free(mujoco: Any, model: Any, path: Path, joint: Counts) -> int:
    """Find the number of the free joint that carries the joints (4, 3).

    Raises BadInput if there is none, or if the model has further joints.
    """
    trunk = int(model.body_rootid[model.jnt_bodyid[joint[0, 0]]])
    free = int(model.body_jntadr[trunk])
    floats = free >= 0 and model.jnt_type[free] == mujoco.mjtJoint.mjJNT_FREE
    reason = "has no trunk that floats: put trunk and legs in a <body> with <freejoint/>"
    require(floats, "machine.path", path, reason)
    extra_joints = list_names(_name(model.joint(k)) for k in sorted(set(range(model.njnt)) - {free, *joint.ravel()}))
    reason = f"moves, too: a leg has three joints; hold the others by machine.weld=[{extra_joints}]"
    require(not extra_joints, "machine.joints", extra_joints, reason)
    return free


def find_legs(model: Any, free: int, joint: Counts, foot: Counts, feet: Sequence[str]) -> Legs:
    """Find the indices of the legs in an MjModel.

    ``free`` is the number of the free joint, ``joint`` (4, 3) those of the joints, ``foot`` (4,) those of the feet's
    geoms, which are spheres. Raises BadInput if one of ``feet`` does not hang on the trunk by the joints of its leg.
    """
    for leg, geom, name in zip(joint, foot, feet, strict=True):
        require_hanging(model, leg.tolist(), int(model.geom_bodyid[geom]), name)
    return Legs(
        base=int(model.jnt_bodyid[free]),
        base_qpos=int(model.jnt_qposadr[free]),
        base_dof=int(model.jnt_dofadr[free]),
        joint=joint,
        qpos=model.jnt_qposadr[joint].astype(np.int64),
        dof=model.jnt_dofadr[joint].astype(np.int64),
        foot_geom=foot,
        foot_radius=model.geom_size[foot, 0].copy(),
    )


def require_hanging(model: Any, leg: Sequence[int], body: int, foot: str) -> None:
    """Require that the ``body`` of a foot hangs on the trunk by the joints of its ``leg``; raises BadInput."""
    chain = find_chain(model, body)[1:]
    expected, actual = (list_names(_name(model.joint(k)) for k in joints) for joints in (leg, chain))
    reason = f"must hang on {expected}, but hangs on {actual or 'the trunk alone'}"
    require(chain == leg, "machine.feet", foot, reason)


def require_frame(hips: Array, feet: Sequence[str], yaw: float) -> None:
    """Require legs in order in the frame of the trunk, x forward, y left, z up; raise BadInput otherwise.

    ``hips`` (4, 3) are the thigh joints in that frame, m; ``feet``, names of the feet, and ``yaw``, rad, by which it
    is turned, are for the message.
    """
    forward, left = hips[:2] - hips[2:], hips[::2] - hips[1::2]
    cosines = [v[axis] / np.linalg.norm(v) for axis, vectors in enumerate((forward, left)) for v in vectors]
    order = "front left, front right, rear left, rear right in the frame of the trunk, x forward, y left, z up"
    allowed = f"must be {order}: change the order, or machine.yaw={yaw:.4g}, or turn the frame"
    require(min(cosines) >= LEAST_COSINE, "machine.feet", ", ".join(feet), allowed)


def torque_limits(mujoco: Any, model: Any, joints: Counts) -> Array:
    """Return torque limits (3,) of hip, thigh and calf, the least of all legs, N m; infinite without a limit.

    Raises BadInput for a joint without actuator and limit in a model that has actuators, and for one whose actuator
    gives no torque.
    """
    limits = [_torque_limit(mujoco, model, int(joint)) for joint in joints.ravel()]
    return np.reshape(limits, joints.shape).min(axis=0)


def _torque_limit(mujoco: Any, model: Any, joint: int) -> float:
    """Return the least torque limit of a joint and of its actuators, N m."""
    name = model.joint(joint).name
    at_joint = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    actuators = np.flatnonzero(at_joint)
    limits = [_to_both_sides(model.jnt_actfrcrange[joint])] if model.jnt_actfrclimited[joint] else []
    is_driven = len(actuators) or limits or not model.nu  # a URDF has no actuators
    require(is_driven, "machine.joints", name, "has no actuator in the model; give it a motor: <motor joint=.../>")
    for k in actuators:
        gear = abs(model.actuator_gear[k, 0])
        if model.actuator_forcelimited[k]:
            limits.append(_to_both_sides(model.actuator_forcerange[k]) * gear)
        # The control of a servo is a position or a velocity, so its range is no limit of torque.
        is_motor = model.actuator_biastype[k] == mujoco.mjtBias.mjBIAS_NONE
        if is_motor and model.actuator_ctrllimited[k]:
            limits.append(_to_both_sides(model.actuator_ctrlrange[k]) * abs(model.actuator_gainprm[k, 0]) * gear)
    limit = float(min(limits, default=np.inf))
    reason = "has a motor without torque in the model: a range, gain or gear is 0"
    require(limit > 0.0, "machine.joints", name, reason)
    return limit


def _to_both_sides(limits: Array) -> float:
    """Return the largest torque available in both directions; for a one-sided range, the limit of that side."""
    least, largest = float(limits[0]), float(limits[1])
    return min(-least, largest) if least < 0.0 < largest else max(abs(least), abs(largest))


def find_joint(mujoco: Any, model: Any, name: str) -> int:
    """Find the number of a joint in a model by its name; raise BadInput if it is missing or no hinge."""
    names = [_name(model.joint(k)) for k in range(model.njnt)]
    reason = f"is no joint of the model, which has {list_names(names)}; {HINT}"
    require(name in names, "machine.joints", name, reason)
    index = names.index(name)
    is_hinge = model.jnt_type[index] == mujoco.mjtJoint.mjJNT_HINGE
    require(is_hinge, "machine.joints", name, "must be a hinge: legs have neither wheels nor slides")
    return index


def find_chain(model: Any, body: int) -> list[int]:
    """List the numbers of the joints that carry a body, from the root outwards."""
    chain: list[int] = []
    while body:
        first = int(model.body_jntadr[body])
        chain = [*range(first, first + int(model.body_jntnum[body])), *chain]
        body = int(model.body_parentid[body])
    return chain


def _name(joint: Any) -> str:
    return joint.name or f"joint {joint.id} (without a name)"


def list_names(names: Iterable[str]) -> str:
    """Join names for a message, the first MOST_NAMES only."""
    names = list(names)
    return ", ".join(names[:MOST_NAMES]) + (f" and {len(names) - MOST_NAMES} more" if names[MOST_NAMES:] else "")
