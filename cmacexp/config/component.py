"""Plant, sensors, controller and feedforward in a config: their classes, the fields that they accept, and their code.

A ``_target_`` names the class of a shipped component, or of a custom one in a file of the user.
"""

import hashlib
import importlib
import inspect
import os
import sys
import sysconfig
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from modulefinder import ModuleFinder
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import yaml

from cmacexp.config.cmac import NEEDS_ACTING
from cmacexp.config.fields import listed
from cmacexp.config.schema import Config, read_component
from cmacexp.errors import BadComponent, BadInput, format_install_command, require, suggest

PACKAGE = __name__.partition(".")[0]
COMPONENTS = ("plant", "sensors", "controller", "feedforward")
"""Groups of the config that name a class as ``_target_``."""
NEW_NAMES = {
    **{
        f"cmacexp.control.{name}": f"cmacexp.feedforward.{name}"
        for name in ("CmacFeedforward", "InverseDynamics", "IterativeLearning", "NoFeedforward", "RadialBasis")
    },
    "cmacexp.control.hybrid.HybridController": "cmacexp.control.HybridController",
    "cmacexp.control.drives.DriveController": "cmacexp.control.DriveController",
    "cmacexp.feedforward.cmac_on_model.CmacOnModel": "cmacexp.feedforward.CmacOnModel",
    "cmacexp.wire.unitree.UnitreeRobot": "cmacexp.addons.unitree.unitree.UnitreeRobot",
}
"""New names of classes that have moved, by their old names, which keep working as targets."""


_PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
_INSTALLED_CONFIGS = _PACKAGE_FOLDER / "conf"
_CONFIGS = _INSTALLED_CONFIGS if _INSTALLED_CONFIGS.is_dir() else _PACKAGE_FOLDER.parent / "conf"


def config_folder() -> Path:
    """Return the folder of the shipped configs: inside an installed package, else at the top of the checkout."""
    return _CONFIGS


@dataclass
class ComponentConfig:
    """Base class for the fields of a component, converted to their types and checked against their ranges.

    The class of the component has a subclass of this as attribute ``Config``, and takes an object of it as argument:
    ``Class(config=...)``.
    """

    _target_: str = field(default="", kw_only=True)
    draws: ClassVar[bool] = False
    """True if the component uses the seed, as far as its fields determine that."""

    def check(self, config: Config) -> None:
        """Check combinations of the fields with each other and with the rest of ``config``; raises BadInput."""


@dataclass
class FeedforwardConfig(ComponentConfig):
    """Base class for the fields of a feedforward that acts from ``learning.start_cycle`` on."""

    needs: ClassVar[tuple[str, ...]] = NEEDS_ACTING


@cache
def _read_options(folder: str) -> dict[str, dict[str, Any]]:
    """Read the options in a folder of the shipped configs, as plain dictionaries by option name, sorted."""
    files = sorted((config_folder() / folder).glob("*.yaml"))
    return {path.stem: yaml.safe_load(path.read_text(encoding="utf-8")) or {} for path in files}


def find_option(group: str, target: str) -> str:
    """Return the option of a group whose class is ``target``; without one the class name without its module."""
    for name, option in _read_options(group).items():
        inner = option.get(group)
        if target in (option.get("_target_"), inner.get("_target_") if isinstance(inner, dict) else None):
            return name
    return target.rpartition(".")[2]


def list_options_with(group: str, name: str) -> list[str]:
    """List the options of a group of the shipped configs that have a field of this name."""
    options = _read_options(group).items()
    return [option for option, node in options if name in node or name in (node.get(group) or ())]


def config_class(component: Callable[..., object]) -> type[ComponentConfig] | None:
    """Return the attribute ``Config`` of a component class, own or inherited; None if it is no config class."""
    schema = getattr(component, "Config", None)
    return schema if inspect.isclass(schema) and issubclass(schema, ComponentConfig) else None


def _list_accepted_fields(component: Callable[..., object]) -> dict[str, bool] | None:
    """List the fields that a component accepts, by name, True if required; None if it may accept any field."""
    if (schema := config_class(component)) is not None:
        declared = [item for item in fields(schema) if item.name != "_target_"]
        return {item.name: item.default is item.default_factory is MISSING for item in declared}
    try:
        parameters = inspect.signature(component).parameters.values()
    except (TypeError, ValueError):  # a class that is not written in Python
        return None
    if any(parameter.kind == inspect.Parameter.VAR_KEYWORD for parameter in parameters):
        return None
    by_keyword = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {item.name: item.default is item.empty for item in parameters if item.kind in by_keyword}


def _fields_of_options(group: str) -> set[str]:
    """List the fields of ``group`` that any of its options has, or that a scenario, plant or controller sets."""
    names: set[str] = set()
    for folder in (group, "scenario", "for_plant", "for_controller"):
        for option in _read_options(folder).values():
            names.update(map(str, option if folder == group else option.get(group, {})))
    return names - {"_target_", "defaults"}


def select_accepted_fields(group: str, node: Mapping[str, Any], component: Callable[..., object]) -> dict[str, Any]:
    """Select the fields of the config node of a component that its class accepts.

    Fields of a shipped option that the class does not accept are dropped: ``_target_`` has replaced the class of that
    option. Raises BadInput for any other field that it does not accept, and for a required field that is missing.
    """
    accepted = _list_accepted_fields(component)
    if accepted is None:
        return dict(node)
    unknown = [name for name in node if name not in accepted and name != "_target_"]
    takes = f"{node['_target_']} takes {', '.join(accepted) or 'no fields'}"
    for name in unknown:
        is_of_an_option = name in _fields_of_options(group)
        require(is_of_an_option, f"{group}.{name}", node[name], takes + suggest(name, accepted))
    for name, is_required in accepted.items():
        is_complete = name in node or not is_required
        require(is_complete, f"{group}.{name}", "(not set)", f"{takes}: give it one with +{group}.{name}=VALUE")
    return {name: value for name, value in node.items() if name not in unknown}


@cache
def find_new_name(target: str) -> str:
    """Return the present name of a target; if it has moved, a notice is printed to stderr, once."""
    if target in NEW_NAMES:
        print(f"{target} is now {NEW_NAMES[target]}", file=sys.stderr)
    return NEW_NAMES.get(target, target)


def is_shipped(name: str) -> bool:
    """Check whether a module or class, by its full dotted name, belongs to this package."""
    return name.partition(".")[0] == PACKAGE


@contextmanager
def current_folder_importable() -> Iterator[None]:
    """Make modules in the current folder importable, as ``python -m`` does but console scripts and workers do not."""
    here = os.getcwd()
    if any(entry in ("", here) for entry in sys.path):
        yield
        return
    sys.path.insert(0, here)
    try:
        yield
    finally:
        sys.path.remove(here)


def find_class(key: str, target: object) -> type[Any]:
    """Import the class that ``target`` names as ``module.Class``; only the import of the module runs code.

    Raises BadInput, naming ``key``, if there is no such class; :class:`BadComponent`, with the traceback, if its
    module raises an error.
    """
    if not isinstance(target, str) or not all(target.split(".")) or "." not in target:
        raise BadInput(key, target, "must name a class as module.Class, e.g. my_file.MyController")
    module_name, _, name = target.rpartition(".")
    module = _import(key, target, module_name)
    component = getattr(module, name, None)
    if component is None:
        members = inspect.getmembers(module, inspect.isclass)
        classes = [member for member, value in members if value.__module__ == module_name]
        has = f"; it has {listed(classes)}" if classes else ""
        where = vars(module).get("__file__", "built in")
        raise BadInput(key, target, f"{module_name} ({where}) has no {name}{has}{suggest(name, classes)}")
    require(inspect.isclass(component), key, target, f"must be a class, but is of type {type(component).__name__}")
    return component  # type: ignore[no-any-return]


def require_shipped(plain: Mapping[str, Any], consent: str) -> None:
    """Require that a stored config names only components of this package; importing others would run their code.

    Raises BadInput for the first other component; the message says that ``consent`` (an argument or an option)
    allows it.
    """
    for group in COMPONENTS:
        node = plain.get(group)
        target = node.get("_target_") if isinstance(node, Mapping) else None
        reason = f"is code outside this project, which a stored config may name; add {consent} if you trust it"
        require(target is None or is_shipped(str(target)), f"{group}._target_", target, reason)


def _import(key: str, target: str, name: str) -> ModuleType:
    """Import a module by its full name; raises BadInput if it is missing, BadComponent if it raises an error."""
    if name not in sys.modules:
        importlib.invalidate_caches()  # Python may not have noticed a file that has just been written
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if name == missing or name.startswith(f"{missing}."):
            near = suggest(name, [path.stem for path in Path.cwd().glob("*.py")])
            raise BadInput(
                key,
                target,
                f"there is no module {missing}, neither in {Path.cwd()} nor where Python finds packages{near}",
            ) from error
        if command := format_install_command(missing):
            raise BadInput(key, target, f"needs {missing}, which is not installed: {command}") from error
        raise BadComponent(key, target, f"importing {name} failed: no module named {missing}", error) from error
    except (Exception, SystemExit) as error:
        raise BadComponent(key, target, f"importing {name} failed: {type(error).__name__}: {error}", error) from error


def custom_code_hash(config: Config, *components: object) -> str | None:
    """Compute the SHA-256 of the code and data of the custom components of a run; None without custom components.

    The code is that of the files of the components, and of the files beside them that they import. The data are the
    files that a field of the component names, and those that its class lists as ``reads``, absolute or relative to
    the current folder. Without ``components``, objects in the order of :data:`COMPONENTS`, the classes are those that
    the config names; raises BadInput if one cannot be imported.
    """
    hashes = list[str]()
    for index, group in enumerate(COMPONENTS):
        node = read_component(vars(config)[group])
        with current_folder_importable():
            kind = type(components[index]) if components else find_class(f"{group}._target_", node["_target_"])
        if not is_shipped(kind.__module__):
            names = [name for name in (*getattr(kind, "reads", ()), *node.values()) if isinstance(name, str | Path)]
            data = [Path(name).read_bytes() for name in names if os.path.isfile(name)]
            hashes += [_hash_code(kind.__module__), *(hashlib.sha256(content).hexdigest() for content in data)]
    return hashlib.sha256("".join(hashes).encode()).hexdigest() if hashes else None


@cache
def _hash_code(module: str) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in find_sources(module))).hexdigest()


def find_sources(name: str) -> list[Path]:
    """List the files of an imported module, and of modules beside its top package that it imports, also indirectly.

    Files of this package are excluded; for a module of an installed package also those of other installed packages.
    """
    file = Path(vars(importlib.import_module(name)).get("__file__") or ".")
    if not file.is_file():  # defined in a console
        return []
    root = file.parents[name.count(".") + (file.name == "__init__.py")]
    excluded = [PACKAGE]
    if str(root) in (sysconfig.get_path("purelib"), sysconfig.get_path("platlib")):
        excluded += [path.name.partition(".")[0] for path in root.iterdir()]
    finder = ModuleFinder(
        [str(root)], excludes=[package for package in excluded if package != name.partition(".")[0]]
    )
    if name == "__main__":
        finder.run_script(str(file))
    else:
        finder.import_hook(name)
    files = [vars(module)["__file__"] for module in finder.modules.values()]
    return sorted(Path(file) for file in files if file)
