"""Changes to the specification of a robot before it is compiled, each with a note for the user.

Joints are held, a trunk that is fixed to the world floats, the frame of a trunk is turned, and files that only draw
are left out if they are missing.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import require, suggest
from cmacexp.models.robot_legs import list_names

WELD = "machine.weld"
WORLD = "world"
"""Name of MuJoCo's body that stays where it is."""
POINTER = b"version https://git-lfs"
"""First bytes of a file that Git LFS did not fetch."""


def hold_joints(path: Path, mujoco: Any, spec: Any, names: Sequence[str]) -> None:
    """Hold joints at zero angle: remove them, and the actuators and constraints that act on them only.

    Sensors and keyframes of the model, which a run does not use, go with them. Raises BadInput if a name is no joint,
    or if a tendon acts on a joint.
    """
    if not names:
        return
    joints = {joint.name: joint for joint in spec.joints if joint.name}
    for name in names:
        reason = f"is no joint of the model, which has {list_names(joints)}{suggest(name, joints)}"
        require(name in joints, WELD, name, reason)
    tied = sorted(
        {str(wrap.target.name) for tendon in spec.tendons for wrap in tendon.path if wrap.target} & {*names}
    )
    reason = f"is moved by a tendon: remove the tendon from {path.name}, or weld the joint there"
    require(not tied, WELD, list_names(tied), reason)
    acted = [item for item in spec.actuators if item.target in names and item.trntype == mujoco.mjtTrn.mjTRN_JOINT]
    constraints = [
        item
        for item in spec.equalities
        if item.type == mujoco.mjtEq.mjEQ_JOINT and {item.name1, item.name2} & {*names}
    ]
    for item in (*acted, *constraints, *spec.sensors, *spec.keys, *(joints[name] for name in names)):
        spec.delete(item)


def _has_mass(body: Any) -> bool:
    """Return True if a body, or one that is fixed to it, has a mass, its own or that of a shape."""
    fixed = (child for child in body.bodies if not child.joints)
    return bool(body.mass > 0.0 or any(geom.mass != 0.0 for geom in body.geoms) or any(map(_has_mass, fixed)))


def float_trunk(spec: Any) -> list[str]:
    """Give the body of the world that carries most joints a free joint if it has none; return a note about it.

    A body without mass, as arms stand on, stays fixed.
    """
    trunk = max(spec.worldbody.bodies, key=lambda body: len(body.find_all("joint")), default=None)
    if trunk is None or trunk.joints or not _has_mass(trunk):
        return []
    trunk.add_freejoint()
    return [f"{trunk.name or 'its trunk'} is fixed to the world in the model, and floats here"]


def give_rotors(spec: Any, joints: Sequence[Sequence[str]], inertia: float) -> tuple[str, ...]:
    """Give joints without rotor inertia one of ``inertia``, kg m^2; return a note about it, or none."""
    without = [joint for leg in joints for name in leg if not (joint := spec.joint(name)).armature]
    if not inertia or not without:
        return ()
    for joint in without:
        joint.armature = inertia
    return (f"{len(without)} joints without rotor inertia have {inertia:.4g} kg m^2 here (machine.rotor_inertia)",)


def turn_trunk(mujoco: Any, spec: Any, model: Any, base: int, yaw: float) -> None:
    """Turn the frame of the trunk, body ``base``, so that its x axis is at the angle ``yaw``, rad, from where it was.

    ``model`` is the compiled ``spec``; it gives the inertia of the trunk, however the file states it.
    """
    quaternion = np.array([math.cos(0.5 * yaw), 0.0, 0.0, -math.sin(0.5 * yaw)])
    trunk = next(body for body in spec.bodies if body.id == base)
    elements = (trunk.frames, trunk.bodies, trunk.geoms, trunk.sites, trunk.cameras, trunk.lights)
    inside = [element for kind in elements for element in kind if element.frame is None]
    frame = trunk.add_frame(quat=quaternion)
    for element in inside:
        element.set_frame(frame)
    mujoco.mju_rotVecQuat(trunk.ipos, model.body_ipos[base], quaternion)
    mujoco.mju_mulQuat(trunk.iquat, quaternion, model.body_iquat[base])
    trunk.inertia = model.body_inertia[base].copy()
    trunk.fullinertia = np.full(6, np.nan)
    trunk.mass = float(model.body_mass[base])
    trunk.explicitinertial = True


def leave_out_missing(path: Path, spec: Any) -> list[str]:
    """Remove meshes and textures whose files are missing, if they only draw; return a note about them.

    Raises BadInput for a missing mesh that gives a body its mass.
    """
    folder = Path(spec.modelfiledir or path.parent)
    meshes = _find_missing(spec, folder / spec.meshdir, spec.meshes)
    textures = _find_missing(spec, folder / spec.texturedir, spec.textures)
    weighing = []
    for geom in [geom for geom in spec.geoms if geom.meshname in meshes]:
        weighs = geom.mass > 0.0 or (np.isnan(geom.mass) and geom.density > 0.0 and not geom.parent.explicitinertial)
        if weighs and spec.compiler.inertiagrouprange[0] <= geom.group <= spec.compiler.inertiagrouprange[1]:
            weighing.append((geom.parent, meshes[geom.meshname][1]))
        spec.delete(geom)
    for body, file in weighing:
        reason = f"gives {body.name or 'a body without a name'} its mass: add the file, or an <inertial> to the body"
        require(not _needs_mass(body), "machine.path", path, f"there is no {file}, which {reason}")
    for material in spec.materials:
        material.textures = ["" if name in textures else name for name in material.textures]
    missing = [*meshes.values(), *textures.values()]
    for element, _ in missing:
        spec.delete(element)
    absent = list_names(file for _, file in missing)
    return [f"without the missing {absent}, which a run does not need"] if absent else []


def _needs_mass(body: Any) -> bool:
    """Return True unless a body is the world, or fixed to it with bodies that all have no mass."""
    while body.name != WORLD:
        if body.joints or (body.parent.name == WORLD and _has_mass(body)):
            return True
        body = body.parent
    return False


def name_absent(file: Path, name: str) -> str:
    """Return ``name`` for a message if there is no such file, or a pointer of Git LFS in its place; else ``""``."""
    if not file.is_file():
        return name
    with file.open("rb") as opened:
        is_pointer = opened.read(len(POINTER)) == POINTER
    return f"{name} (a Git LFS pointer: run git lfs pull)" if is_pointer else ""


def _find_missing(spec: Any, folder: Path, elements: Iterable[Any]) -> dict[str, tuple[Any, str]]:
    """Find the meshes or textures whose files do not exist in their ``folder``, by name, each with what is absent."""
    missing = {}
    for element in elements:
        file = Path(element.file)
        place = folder / (file.name if spec.strippath else file)
        if element.file and (absent := name_absent(place, element.file)):
            missing[element.name or file.stem] = element, absent
    return missing
