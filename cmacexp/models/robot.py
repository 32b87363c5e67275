"""A quadruped with three hinges a leg, as its MJCF model describes it: geometry, masses, limits, losses."""

import hashlib
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, format_install_command
from cmacexp.models.leg import GRAVITY
from cmacexp.models.robot_legs import Legs, find_legs, require_names, torque_limits
from cmacexp.typing import Array, Counts

Names = tuple[tuple[str, ...], ...]
"""Names of joints, leg by leg."""


def load_mujoco() -> Any:
    """The module ``mujoco``.

    Raises:
        BadInput: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise BadInput("plant", "mujoco", f"MuJoCo is not installed: {format_install_command('mujoco')}") from error
    return mujoco


@contextmanager
def warnings_dropped(mujoco: Any) -> Iterator[None]:
    """Keep MuJoCo from writing its warnings to ``MUJOCO_LOG.TXT`` in the current folder; counters hold them too."""
    handler = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(handler)


def load_model(load: Callable[[str], Any], source: str, key: str, value: object) -> Any:
    """What ``load``, a function of MuJoCo, makes of a ``source``.

    Raises:
        BadInput: MuJoCo refuses it; names the config ``key`` and its ``value``.
    """
    try:
        with warnings_dropped(load_mujoco()):
            return load(source)
    except ValueError as error:
        raise BadInput(key, value, f"MuJoCo refuses the model: {' '.join(str(error).split())}") from error


@dataclass(frozen=True, eq=False)
class Robot:
    """A quadruped, its legs in the order front left, front right, rear left, rear right.

    Frame of the trunk: that of the body with the free joint, x forward, y left, z up.
    """

    path: Path
    """Its MJCF file."""
    model: Any
    """MuJoCo's MjModel. It is shared: whoever changes it takes a copy."""
    legs: Legs
    """Where joints, bodies and feet of the legs stand in the model."""
    home: Array
    """(3,) joint angles at which the rule for the gains looks at a leg, rad."""
    mass: float
    """Total mass, kg."""
    hinges: Array
    """(4, 3, 6) at joint angles of zero in the frame of the trunk: a point of the axis (m), its direction."""
    feet_at_zero: Array
    """(4, 3) centres of the feet likewise, m."""
    links: tuple[float, float]
    """Distances of thigh joint and calf joint, l1, and of calf joint and foot, l2, at home, m."""
    torque_limits: Array
    """(3,) largest torque of hip, thigh and calf, the least of all legs, N m; infinite without a limit."""
    ranges: Array
    """(4, 3, 2) least and largest joint angle, rad; infinite without a limit."""
    friction: Array
    """(3,) dry friction of hip, thigh and calf, the most of all legs, N m."""
    damping: Array
    """(3,) likewise the damping, N m s/rad."""
    armature: Array
    """(3,) likewise the inertia of the rotor, kg m^2."""

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of what this version of MuJoCo makes of the file and of those that it includes."""
        mujoco = load_mujoco()
        compiled = np.empty(mujoco.mj_sizeModel(self.model), dtype=np.uint8)
        mujoco.mj_saveModel(self.model, None, compiled)
        return hashlib.sha256(compiled.tobytes()).hexdigest()

    def at(self, q: Array) -> Any:
        """New data of MuJoCo: the trunk upright at the origin, every leg at ``q`` (3,) or (4, 3), rad, at rest."""
        return place(self.model, load_mujoco().MjData(self.model), self.legs, q)


def place(model: Any, data: Any, legs: Legs, q: Array) -> Any:
    """Set joint angles ``q``, rad, under a trunk that is upright at the origin; ``data`` with its kinematics."""
    data.qpos[legs.base_qpos : legs.base_qpos + 7] = [0, 0, 0, 1, 0, 0, 0]
    data.qpos[legs.qpos] = q
    load_mujoco().mj_kinematics(model, data)
    return data


def read_robot(path: Path, joints: Sequence[Sequence[str]], feet: Sequence[str], home: Sequence[float]) -> Robot:
    """The robot of an MJCF file; the last ones are kept.

    Args:
        path: of the file.
        joints: names of hip, thigh and calf joint of each of the four legs.
        feet: names of the geoms of the four feet.
        home: joint angles at which the rule for the gains looks at a leg, rad.

    Raises:
        BadInput: MuJoCo is missing or cannot read the file, or the model is no quadruped with three hinges a leg.
    """
    require_names(joints, feet, home)
    return _read(path, path.stat().st_mtime_ns, tuple(tuple(leg) for leg in joints), tuple(feet), tuple(home))


@lru_cache(maxsize=16)
def _read(path: Path, changed: int, joints: Names, feet: tuple[str, ...], home: tuple[float, ...]) -> Robot:
    """The robot of a file that was ``changed`` at that time."""
    mujoco = load_mujoco()
    _require_regular_files(path, path.parent, {path})
    model = load_model(mujoco.MjModel.from_xml_path, str(path), "machine.path", path)
    model.opt.gravity[:] = [0.0, 0.0, -GRAVITY]
    legs = find_legs(mujoco, model, path, joints, feet)
    data = place(model, mujoco.MjData(model), legs, np.array(home))
    points = np.concatenate([data.xanchor[legs.joint[0]], data.geom_xpos[legs.foot_geom[:1]]])
    _, length_1, length_2 = np.linalg.norm(np.diff(points, axis=0), axis=1)
    place(model, data, legs, np.zeros(3))
    limited = model.jnt_limited[legs.joint].astype(bool)[..., None]
    return Robot(
        path=path,
        model=model,
        legs=legs,
        home=np.array(home),
        mass=float(model.body_subtreemass[legs.base]),
        hinges=np.concatenate([data.xanchor[legs.joint], data.xaxis[legs.joint]], axis=-1),
        feet_at_zero=data.geom_xpos[legs.foot_geom].copy(),
        links=(float(length_1), float(length_2)),
        torque_limits=torque_limits(mujoco, model, joints, legs.joint),
        ranges=np.where(limited, model.jnt_range[legs.joint], [-np.inf, np.inf]),
        friction=_most(model.dof_frictionloss, legs.dof),
        damping=_most(model.dof_damping, legs.dof),
        armature=_most(model.dof_armature, legs.dof),
    )


def _require_regular_files(path: Path, folder: Path, known: set[Path]) -> None:
    """Check all files that a model names: MuJoCo would wait for a FIFO, or read a device for ever.

    Args:
        path: of a file of the model.
        folder: of the model.
        known: files that have been checked; is extended.

    Raises:
        BadInput: one of them is not a regular file.
    """
    text = unescape(path.read_text(errors="replace"))
    folders = ["", *re.findall(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)""", text)]
    for name in re.findall(r"""\bfile\s*=\s*["']([^"']+)""", text):
        for file in {folder / inner / name for inner in folders} - known:
            known.add(file)
            if file.exists() and not file.is_file():
                raise BadInput("machine.path", path, f"names {name}, which is not a regular file")
            if file.suffix.lower() in ("", ".xml", ".mjcf") and file.is_file():
                _require_regular_files(file, folder, known)


def _most(values: Array, dof: Counts) -> Array:
    """The largest value of all legs at each of the three joints."""
    return values[dof].max(axis=0)
