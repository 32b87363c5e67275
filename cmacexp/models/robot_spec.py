"""Robot files, MJCF or URDF, as specifications for MuJoCo, and checks of what acts on the robot in a run.

A run has its own gravity, medium, time step and torques, so a model's options and actuators have no effect. Anything
else that would push or hold the robot is refused.
"""

import re
import xml.etree.ElementTree as ElementTree
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, require
from cmacexp.models.leg import GRAVITY
from cmacexp.models.robot_edit import float_trunk, leave_out_missing, name_absent
from cmacexp.models.robot_legs import list_names

KEPT_OPTIONS = ("cone", "impratio")
"""Options of contacts with the rigid floor that a model keeps; the run sets all others."""
MESHES = (".stl", ".obj", ".msh")
"""Suffixes of mesh files that MuJoCo reads."""
POINT_INERTIA = 1e-6
"""Moment of inertia over mass of a URDF link without size, m^2."""
NO_MASS = 1e-9
"""Mass below which a URDF link counts as massless, kg."""
NO_INERTIA = 1e-12
"""Least principal moment of inertia that is kept, kg m^2."""
LEAST_INERTIA = 2e-14
"""Least moment of inertia of a URDF link without size, kg m^2; MuJoCo needs one above 1e-14."""


def _read_text(path: Path) -> str:
    """Read the text of a model file without its comments."""
    return re.sub(r"<!--.*?-->", "", path.read_text(errors="replace"), flags=re.DOTALL)


def is_urdf(path: Path) -> bool:
    """Return True if a model file is a URDF."""
    return bool(re.search(r"<robot[\s>]", _read_text(path)))


def read_spec(mujoco: Any, path: Path) -> tuple[Any, list[str]]:
    """Read a model file as an MjSpec; return it, and notes about what is left out.

    Raises BadInput, or ValueError where MuJoCo does.
    """
    _check_text(path, path.parent, {path})
    if is_urdf(path):
        spec, notes = _read_urdf(mujoco, path)
    else:
        spec = mujoco.MjSpec.from_file(str(path))
        notes = leave_out_missing(path, spec)
    require(not spec.plugins, "machine.path", path, "uses a plugin of MuJoCo, which a run does not have; remove it")
    spec.compiler.discardvisual = False  # a foot may be drawn only
    spec.memory = -1  # as much as needed: MuJoCo ends the process where a model reserves too little
    return spec, notes


def _read_urdf(mujoco: Any, path: Path) -> tuple[Any, list[str]]:
    """Read a URDF as a floating robot with only its links' masses and the collision shapes that can be read.

    Returns its MjSpec, and notes about shapes that are left out.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise BadInput("machine.path", path, f"is no XML: {error}") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # without a namespace, which MuJoCo does not read
    compilers = root.findall("mujoco/compiler")
    folders = [path.parent, *(path.parent / item.get("meshdir", "") for item in compilers), *path.parents]
    missing: list[str] = []
    names: set[str] = set()
    for link in root.iter("link"):
        missing += _clean_link(link, folders, names)
    if root.find("joint/parent[@link='world']") is not None and root.find("link[@name='world']") is None:
        ElementTree.SubElement(root, "link", name="world")  # as Drake has it
    for extension in root.findall("mujoco"):
        root.remove(extension)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", fusestatic="false", strippath="false", balanceinertia="true")
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    for geom in spec.geoms:
        geom.mass = 0.0  # in a URDF a link without <inertial> has none
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # which any surface has
    for joint in root.iter("joint"):
        if (
            dynamics := joint.find("dynamics")
        ) is not None and "rotor_inertia" in dynamics.attrib:  # as RaiSim has it
            spec.joint(joint.get("name")).armature = float(dynamics.get("rotor_inertia", "0"))
    float_trunk(spec)  # a URDF has no free joint
    return spec, [f"without the collision shapes {list_names(missing)}, which are missing"] if missing else []


def _clean_link(link: ElementTree.Element, folders: list[Path], names: set[str]) -> list[str]:
    """Remove visuals, and collision meshes not found in ``folders``, from a URDF link; make its inertia possible.

    A name of a collision shape that is in ``names`` is removed as well, since MuJoCo would print a warning; others
    are added. Returns the meshes that are not found.
    """
    for visual in link.findall("visual"):
        link.remove(visual)
    missing = []
    for shape in link.findall("collision"):
        if (mesh := shape.find("geometry/mesh")) is not None and (absent := _find_mesh(mesh, folders)):
            link.remove(shape)
            missing.append(absent)
        if (name := shape.get("name")) in names:
            del shape.attrib["name"]
        elif name is not None:
            names.add(name)
    if (inertial := link.find("inertial")) is not None:
        _make_possible(link, inertial)
    return missing


def _find_mesh(mesh: ElementTree.Element, folders: list[Path]) -> str:
    """Set the file of a mesh to its path on this machine; return its name for a message if it is not found.

    ``package://NAME/`` is searched in ``folders``, those of the model.
    """
    absent = Path(mesh.get("filename", "")).name
    name = re.sub(r"^(package|model|file)://", "", mesh.get("filename", ""))
    names = [name, name.partition("/")[2]]
    for file in (folder / candidate for folder in folders for candidate in filter(None, names)):
        if file.suffix.lower() in MESHES and file.is_file() and not (absent := name_absent(file, file.name)):
            mesh.set("filename", str(file.resolve()))
            return ""
    return absent


def _make_possible(link: ElementTree.Element, inertial: ElementTree.Element) -> None:
    """Remove the <inertial> of a massless URDF link; reduce an inertia that no body has to a positive diagonal."""

    def read(name: str, key: str) -> float:
        element = inertial.find(name)
        return float(element.get(key, "0")) if element is not None else 0.0

    mass = read("mass", "value")
    inertia = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (read("inertia", f"i{axes}") for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    if mass < NO_MASS:
        link.remove(inertial)
    elif inertia is not None and np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0] < NO_INERTIA:
        least = max(POINT_INERTIA * mass, LEAST_INERTIA)
        inertia.attrib.update(dict.fromkeys(("ixy", "ixz", "iyz"), "0"))
        inertia.attrib.update(ixx=str(max(xx, least)), iyy=str(max(yy, least)), izz=str(max(zz, least)))


def _check_text(path: Path, folder: Path, checked: set[Path]) -> None:
    """Require that a model has no number NaN and that all files it names are regular; raise BadInput otherwise.

    MuJoCo does not check either: it takes NaN for a number that is not given, and would wait for a FIFO or read a
    device for ever. ``path`` is one of the model's files, ``folder`` that of the model; ``checked`` are the files
    checked so far, to which this adds.
    """
    text = unescape(_read_text(path))
    is_template = re.search(r"<xacro:|\$\{|\$\(", text)
    reason = f"is a template: expand it by 'xacro {path.name} > robot.urdf', of ROS or of the package xacro"
    require(not is_template, "machine.path", path, reason)
    undefined = re.findall(r"""(\w+)\s*=\s*["'](?:[-+.\de\s]*\s)?nan[\s"']""", text, re.IGNORECASE)
    require(not undefined, "machine.path", path, f"has nan in {', '.join(undefined)}, which must be numbers")
    folders = ["", *re.findall(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']*)""", text)]
    for name in re.findall(r"""\bfile\s*=\s*["']([^"']+)""", text):
        for file in {candidate for inner in folders if (candidate := folder / inner / name).exists()} - checked:
            checked.add(file)
            require(file.is_file(), "machine.path", path, f"names {name}, which is not a regular file")
            if file.suffix.lower() in ("", ".xml", ".mjcf"):
                _check_text(file, folder, checked)


def set_run_options(mujoco: Any, model: Any) -> None:
    """Give a compiled model the options of a run, and let its trunk float freely.

    The options are gravity, no medium, no actuators and MuJoCo's default solver. The free joint loses springs and
    losses that defaults for joints may have given it.
    """
    default = mujoco.MjOption()
    for name in (name for name in dir(default) if not name.startswith("_") and name not in KEPT_OPTIONS):
        value = getattr(default, name)
        if isinstance(value, np.ndarray):
            getattr(model.opt, name)[:] = value
        elif not callable(value):
            setattr(model.opt, name, value)
    model.opt.gravity[:] = [0.0, 0.0, -GRAVITY]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for free in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        dof = slice(model.jnt_dofadr[free], model.jnt_dofadr[free] + 6)
        model.jnt_stiffness[free] = model.dof_damping[dof] = model.dof_frictionloss[dof] = 0.0
        model.dof_armature[dof] = 0.0


def require_own_forces(path: Path, model: Any) -> None:
    """Require that only gravity, joints and torques act on the robot; raise BadInput otherwise."""
    tendons = model.tendon_stiffness, model.tendon_damping, model.tendon_frictionloss, model.tendon_armature
    hidden_forces = {
        "an equality constraint": model.eq_active0,
        "a tendon with a spring, losses, inertia or a limit": (model.tendon_limited, *tendons),
        "gravcomp": model.body_gravcomp,
        "a flexible body (flex)": model.nflex,
    }
    for feature, values in hidden_forces.items():
        reason = f"has {feature}, which would push or hold the robot: remove it"
        require(not np.any(values), "machine.path", path, reason)
    losses = {"frictionloss": model.dof_frictionloss, "damping": model.dof_damping, "armature": model.dof_armature}
    for loss, values in losses.items():
        name = model.joint(int(model.dof_jntid[values.argmin()])).name
        reason = f"has {loss}={values.min():g} at joint {name}, which would push the robot: must be 0 or more"
        require(values.min() >= 0.0, "machine.path", path, reason)
