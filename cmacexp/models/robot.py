"""A quadruped with three hinges per leg from its MJCF or URDF model: geometry, masses, limits, losses."""

import hashlib
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmacexp.errors import BadInput, format_install_command, require
from cmacexp.models.robot_edit import float_trunk, give_rotors, hold_joints, turn_trunk
from cmacexp.models.robot_legs import (
    JOINTS,
    LEGS,
    Legs,
    find_foot,
    find_free,
    find_joint,
    find_legs,
    list_names,
    place_feet,
    require_feet,
    require_frame,
    require_joints,
    torque_limits,
)
from cmacexp.models.robot_spec import read_spec, require_own_forces, set_run_options
from cmacexp.typing import Array, Counts

Names = tuple[tuple[str, ...], ...]
"""Names of joints, leg by leg."""
Angles = tuple[tuple[float, ...], ...]
"""Angles of joints, leg by leg, rad."""
SHORTEST_LEG, LONGEST_LEG = 0.05, 3.0
"""Lengths of stretched legs, m: those of toys and of the largest walking machines, with a margin."""
DENSITIES = (5.0, 5000.0)
"""Least and largest mass over the cube of the length of a stretched leg, kg/m^3; measured robots have 76 to 320."""
WIDEST = 3.0
"""Largest radius of gyration of a body over the length of a stretched leg."""
LEAST_GYRATION = 3e-3
"""Radius of gyration of a leg's link, m, up to which it counts as a point, or as a link without mass."""
LIGHTEST = 1e-3
"""Fraction of the robot's mass above which the inertia of a body is checked."""
RESOLUTION = 2.0**-24
"""Resolution of the quantities in a fingerprint, relative to the largest of their kind. Decimal numbers of a file are
never halfway between two multiples of it, so that rounding errors of another machine or version change nothing."""
FINGERPRINT_DIGITS = 16
UPRIGHT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Position, m, and quaternion of an upright trunk at the origin."""


def load_mujoco() -> Any:
    """Import and return the module ``mujoco``; raise BadInput if it is not installed.

    Its warnings do not go to ``MUJOCO_LOG.TXT`` in the current folder; its data counts them.
    """
    try:
        import mujoco
    except ImportError as error:
        raise BadInput("plant", "mujoco", f"MuJoCo is not installed: {format_install_command('mujoco')}") from error
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(lambda message: None)
    return mujoco


@contextmanager
def refusals_named(key: str, value: object) -> Iterator[Any]:
    """Yield the module ``mujoco``; a model that it refuses within the block raises BadInput for ``key``.

    Warnings about a model are not printed: this project checks itself what acts on a robot. Raises BadInput as well
    if MuJoCo is not installed.
    """
    try:
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            yield load_mujoco()
    except BadInput:
        raise
    except ValueError as error:
        text = " ".join(str(error).split())
        reason = f"MuJoCo refuses the model: {text}"
        if massless := re.search(r"mjMINVAL Element name '(.+?)'", text):
            reason = f"{massless[1]} moves but has no mass or inertia: give it, and others like it, an <inertial>"
        raise BadInput(key, value, reason) from error


def load_spec(path: Path) -> Any:
    """Load an MJCF or URDF file as an MjSpec; raise BadInput on failure.

    See :func:`cmacexp.models.robot_spec.read_spec`.
    """
    with refusals_named("machine.path", path) as mujoco:
        spec, _ = read_spec(mujoco, path)
    return spec


def compile_spec(path: Path, spec: Any) -> Any:
    """Compile the specification of the file at ``path`` into an MjModel with the options of a run.

    Raises BadInput if MuJoCo refuses it.
    """
    with refusals_named("machine.path", path) as mujoco:
        model = spec.compile()
        set_run_options(mujoco, model)
    return model


class Model(NamedTuple):
    """A model file as this project uses it. It is shared: copy spec or model before changing it."""

    spec: Any
    """MuJoCo's MjSpec."""
    model: Any
    """MuJoCo's MjModel, compiled from ``spec``."""
    notes: tuple[str, ...]
    """What differs from the file, in words."""


def load_model(path: Path, weld: Sequence[str] = (), yaw: float = 0.0) -> Model:
    """Load a model file whose joints ``weld`` are held and whose trunk points at ``yaw``, rad, from its x axis.

    The most recent ones are cached. Raises BadInput if MuJoCo refuses it, or has no such joints.
    """
    return _load(path, path.stat().st_mtime_ns, tuple(weld), yaw)


@lru_cache(maxsize=16)
def _load(path: Path, changed: int, weld: tuple[str, ...], yaw: float) -> Model:
    """Load a model file; ``changed``, its time of modification in ns, is part of the key of the cache."""
    with refusals_named("machine.path", path) as mujoco:
        spec, notes = read_spec(mujoco, path)
        hold_joints(path, mujoco, spec, weld)
        notes += float_trunk(spec)
    model = compile_spec(path, spec)
    if yaw:
        free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        base = max(model.jnt_bodyid[free], key=lambda body: model.body_subtreemass[body], default=0)
        turn_trunk(mujoco, spec, model, int(base), yaw)
        model = compile_spec(path, spec)
        notes.append(f"forward is {yaw:.4g} rad from the x axis of the trunk in the model (machine.yaw)")
    return Model(spec, model, tuple(notes))


@dataclass(frozen=True, eq=False)
class Robot:
    """A quadruped with its legs in the order front left, front right, rear left, rear right.

    The frame of the trunk is that of the body with the free joint, x forward, y left, z up.
    """

    path: Path
    """MJCF or URDF file of the robot."""
    spec: Any
    """MuJoCo's MjSpec from which ``model`` was compiled. It is shared: copy it before changing it."""
    model: Any
    """MuJoCo's MjModel. It is shared: copy it before changing it."""
    legs: Legs
    """Indices of joints, bodies and feet of the legs in the model."""
    home: Array
    """(4, 3) joint angles at which the rule for the gains evaluates the legs, rad."""
    mass: float
    """Total mass, kg."""
    hinges: Array
    """(4, 3, 6) at zero joint angles in the frame of the trunk: a point of each axis (m) and its direction."""
    feet_at_zero: Array
    """(4, 3) centres of the feet at zero joint angles in the frame of the trunk, m."""
    links: tuple[float, float]
    """Distances from thigh joint to calf joint, l1, and from calf joint to foot, l2, at home, m."""
    torque_limits: Array
    """(3,) torque limits of hip, thigh and calf, the least of all legs, N m; infinite without a limit."""
    ranges: Array
    """(4, 3, 2) least and largest joint angles, rad; infinite without a limit."""
    friction: Array
    """(3,) dry friction of hip, thigh and calf, the largest of all legs, N m."""
    damping: Array
    """(3,) damping of hip, thigh and calf, the largest of all legs, N m s/rad."""
    armature: Array
    """(3,) rotor inertia of hip, thigh and calf, the largest of all legs, kg m^2."""
    notes: tuple[str, ...]
    """What differs from the file, in words."""

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of the model as this version of MuJoCo compiles it, with all included files."""
        mujoco = load_mujoco()
        compiled = np.empty(mujoco.mj_sizeModel(self.model), dtype=np.uint8)
        mujoco.mj_saveModel(self.model, None, compiled)
        return hashlib.sha256(compiled.tobytes()).hexdigest()

    @cached_property
    def fingerprint(self) -> str:
        """Leading digits of a SHA-256 of the robot's physical parameters, the same with every version of MuJoCo.

        It covers masses, centres of mass and inertias of the bodies, the joints with their ranges, springs, losses
        and torque limits, the feet, and those of the model's options that a run keeps.
        """
        model = self.model
        data = self.at(np.zeros(JOINTS))
        heavy = model.body_mass > 0.0  # others only hold a foot, a sensor, a camera
        rotation = data.ximat.reshape(-1, 3, 3)[heavy]
        inertia = rotation * model.body_inertia[heavy][:, None] @ rotation.transpose(0, 2, 1)
        quantities = (
            *(model.body_mass[heavy], data.xipos[heavy], inertia),
            *(self.hinges, self.ranges, self.torque_limits, self.feet_at_zero, self.legs.foot_radius),
            *(model.jnt_stiffness, model.qpos_spring[self.legs.qpos]),
            *(model.dof_damping, model.dof_frictionloss, model.dof_armature, [model.opt.cone, model.opt.impratio]),
        )
        digest = hashlib.sha256()
        for values in quantities:
            finite = np.nan_to_num(np.asarray(values, dtype=float), posinf=0.0, neginf=0.0)
            largest = float(np.abs(finite).max(initial=0.0)) or 1.0
            digest.update(np.float32(largest).tobytes())
            digest.update(np.rint(finite / (largest * RESOLUTION)).astype(np.int64).tobytes())
        return digest.hexdigest()[:FINGERPRINT_DIGITS]

    def at(self, q: Array) -> Any:
        """Return new MuJoCo data: trunk upright at the origin, every leg at ``q``, (3,) or (4, 3), rad, at rest."""
        return set_posture(self.model, load_mujoco().MjData(self.model), self.legs.joint, q)


def set_posture(model: Any, data: Any, joint: Counts, q: Array) -> Any:
    """Set the joints to ``q`` (4, 3), rad, under a trunk upright at the origin; return ``data`` with its kinematics.

    ``joint`` (4, 3) are the numbers of the joints.
    """
    trunk = model.body_rootid[model.jnt_bodyid[joint[0, 0]]]
    data.qpos[model.jnt_qposadr[model.body_jntadr[trunk]] + np.arange(7)] = UPRIGHT
    data.qpos[model.jnt_qposadr[joint]] = q
    load_mujoco().mj_kinematics(model, data)
    return data


def read_robot(
    path: Path,
    joints: Sequence[Sequence[str | int]],
    feet: Sequence[str | int],
    home: ArrayLike,
    weld: Sequence[str] = (),
    yaw: float = 0.0,
    rotor_inertia: float = 0.0,
) -> Robot:
    """Read the robot of an MJCF or URDF file; the most recent ones are cached.

    Args:
        path: The file.
        joints: Names of the hip, thigh and calf joint of each leg; a name may be a number.
        feet: A geom, site or body for each foot.
        home: Joint angles, (3,) or (4, 3), rad, at which the rule for the gains evaluates the legs.
        weld: Joints that are held at zero angle.
        yaw: Angle from the x axis of the trunk to forward, rad.
        rotor_inertia: Inertia of the rotors of joints for which the model has none, kg m^2.

    Raises:
        BadInput: MuJoCo is missing or cannot read the file, or the model is no quadruped with three hinges per leg.
    """
    try:
        angles = np.array(home, dtype=float)
    except ValueError:
        angles = np.empty(0)  # lists of different lengths are refused below
    leg_joints = tuple(tuple(map(str, leg)) for leg in joints)
    foot_names = tuple(map(str, feet))
    require_joints(leg_joints)
    has_angles = angles.shape in ((JOINTS,), (LEGS, JOINTS))
    require(has_angles, "machine.home", home, "must be three angles, hip, thigh, calf, or four lists of three")
    require_feet(foot_names)
    all_angles = tuple(map(tuple, np.broadcast_to(angles, (LEGS, JOINTS)).tolist()))
    changed = path.stat().st_mtime_ns
    return _read(path, changed, leg_joints, foot_names, all_angles, tuple(weld), yaw, rotor_inertia)


def require_sizes(path: Path, model: Any, legs: Legs, length: float) -> None:
    """Require the size and mass of a quadruped in m and kg, with legs of ``length``, m; raise BadInput otherwise."""
    mass = float(model.body_subtreemass[legs.base])
    lightest, heaviest = (density * length**3 for density in DENSITIES)
    sizes = [
        ("the length of a stretched leg", length, "m", SHORTEST_LEG, LONGEST_LEG),
        ("the mass", mass, "kg", lightest, heaviest),
    ]
    for k in np.flatnonzero(model.body_mass > LIGHTEST * mass):
        quantity = f"the moment of inertia of {model.body(k).name or f'body {k}'}"
        largest = float(model.body_mass[k]) * (WIDEST * length) ** 2
        sizes.append((quantity, float(model.body_inertia[k].max()), "kg m^2", 0.0, largest))
    for quantity, value, unit, least, largest in sizes:
        limits = f"of robots {least:.3g} to {largest:.3g}: use m, kg and rad in the model"
        require(least <= value <= largest, "machine.path", path, f"{quantity} is {value:.3g} {unit}, {limits}")


@lru_cache(maxsize=16)
def _read(
    path: Path,
    changed: int,
    joints: Names,
    feet: tuple[str, ...],
    angles: Angles,
    weld: tuple[str, ...],
    yaw: float,
    rotor_inertia: float,
) -> Robot:
    """Read the robot of a file; ``changed``, its time of modification in ns, is part of the key of the cache."""
    mujoco = load_mujoco()
    home = np.array(angles)
    spec, model, notes = load_model(path, weld, yaw)
    joint = np.array([[find_joint(mujoco, model, name) for name in leg] for leg in joints])
    free = find_free(mujoco, model, path, joint)
    data = set_posture(model, mujoco.MjData(model), joint, home)
    spheres = [find_foot(mujoco, model, data, name) for name in feet]
    names = list(feet)
    if rotor_inertia or any(spheres):
        spec = spec.copy()
        names = place_feet(mujoco, spec, data, feet, spheres)
        notes += give_rotors(spec, joints, rotor_inertia)
        model = compile_spec(path, spec)
    foot = np.array([model.geom(name).id for name in names])
    legs = find_legs(model, free, joint, foot, feet)
    require_own_forces(path, model)
    data = set_posture(model, mujoco.MjData(model), joint, home)
    require_frame(data.xanchor[joint[:, 1]], feet, yaw)
    points = np.concatenate([data.xanchor[joint[0]], data.geom_xpos[foot[:1]]])
    _, length_1, length_2 = np.linalg.norm(np.diff(points, axis=0), axis=1)
    require_sizes(path, model, legs, length_1 + length_2)
    limits = torque_limits(mujoco, model, joint)
    if np.isinf(limits).any():
        notes += ("joints without a torque limit: give them an effort, or an actuator with a range",)
    links = model.jnt_bodyid[joint]
    points = links[model.body_inertia[links].max(axis=2) <= LEAST_GYRATION**2 * model.body_mass[links]]
    if points.size:
        light = list_names(model.body(k).name for k in points)
        notes += (f"links without mass or inertia, {light}: it may fall; give them an <inertia>",)
    if (model.jnt_stiffness[joint] > 0.0).any():
        notes += ("joints with springs, which planner and gains do not count: it may fall",)
    set_posture(model, data, joint, np.zeros(JOINTS))
    limited = model.jnt_limited[joint].astype(bool)[..., None]
    return Robot(
        path=path,
        spec=spec,
        model=model,
        legs=legs,
        home=home,
        mass=float(model.body_subtreemass[legs.base]),
        hinges=np.concatenate([data.xanchor[joint], data.xaxis[joint]], axis=-1),
        feet_at_zero=data.geom_xpos[foot].copy(),
        links=(float(length_1), float(length_2)),
        torque_limits=limits,
        ranges=np.where(limited, model.jnt_range[joint], [-np.inf, np.inf]),
        friction=model.dof_frictionloss[legs.dof].max(axis=0),
        damping=model.dof_damping[legs.dof].max(axis=0),
        armature=model.dof_armature[legs.dof].max(axis=0),
        notes=notes,
    )
