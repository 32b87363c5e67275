"""Plant, sensors, controller and feedforward in a config: their classes, the fields that these take, and their code.

A ``_target_`` names a shipped component, or a class in a file of the user's own.
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
"""Groups that name a class by ``_target_``."""
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
"""Targets that have moved, by their old names, which keep working."""


_PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
_INSIDE, _BESIDE = _PACKAGE_FOLDER / "conf", _PACKAGE_FOLDER.parent / "conf"
_CONFIGS = _INSIDE if _INSIDE.is_dir() else _BESIDE


def config_folder() -> Path:
    """Return the folder of the shipped configs: inside an installed package, else at the top of the checkout."""
    return _CONFIGS


@dataclass
class ComponentConfig:
    """Fields of a component, converted to their types and checked against their ranges.

    Its class carries a subclass of this as ``Config`` and is made with an object of it: ``Class(config=...)``.
    """

    _target_: str = field(default="", kw_only=True)
    draws: ClassVar[bool] = False
    """Whether the component draws random numbers, for all that its own fields say."""

    def check(self, config: Config) -> None:
        """Check what no field shows alone, against each other and the rest of the run; raises BadInput."""


@dataclass
class FeedforwardConfig(ComponentConfig):
    """Fields of a feedforward that acts from ``learning.start_cycle`` on."""

    needs: ClassVar[tuple[str, ...]] = NEEDS_ACTING


@cache
def _read_options(folder: str) -> dict[str, dict[str, Any]]:
    """Read the options in a folder of the shipped configs, as plain values by their names, in order."""
    files = sorted((config_folder() / folder).glob("*.yaml"))
    return {path.stem: yaml.safe_load(path.read_text(encoding="utf-8")) or {} for path in files}


def find_option(group: str, target: str) -> str:
    """Find the option of a group that makes the class ``target``, else the name of the class."""
    for name, option in _read_options(group).items():
        inner = option.get(group)
        if target in (option.get("_target_"), inner.get("_target_") if isinstance(inner, dict) else None):
            return name
    return target.rpartition(".")[2]


def config_class(component: Callable[..., object]) -> type[ComponentConfig] | None:
    """The config class that a component carries, if only because it inherits it; ``Config = None``: none."""
    own = getattr(component, "Config", None)
    return own if inspect.isclass(own) and issubclass(own, ComponentConfig) else None


def _fields_taken(component: Callable[..., object]) -> dict[str, bool] | None:
    """Names of the fields that a component takes, and whether each is required; None: it may take any."""
    if (schema := config_class(component)) is not None:
        declared = [each for each in fields(schema) if each.name != "_target_"]
        return {each.name: each.default is each.default_factory is MISSING for each in declared}
    try:
        parameters = inspect.signature(component).parameters.values()
    except (TypeError, ValueError):  # a class that is not written in Python
        return None
    if any(each.kind == each.VAR_KEYWORD for each in parameters):
        return None
    named = [each for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    return {each.name: each.default is each.empty for each in named}


def _fields_of_options(group: str) -> set[str]:
    """List the fields of ``group`` that some option of it has, or that a scenario, plant or controller sets in it."""
    names: set[str] = set()
    for folder in (group, "scenario", "for_plant", "for_controller"):
        for option in _read_options(folder).values():
            names.update(map(str, option if folder == group else option.get(group, {})))
    return names - {"_target_", "defaults"}


def select_accepted_fields(group: str, node: Mapping[str, Any], component: Callable[..., object]) -> dict[str, Any]:
    """A config node without the fields of options that its class does not take: it may have replaced an option.

    Raises BadInput if a field is of no option and the class does not take it, or if one that it needs is missing.
    """
    taken = _fields_taken(component)
    if taken is None:
        return dict(node)
    unknown = [name for name in node if name not in taken and name != "_target_"]
    takes = f"{node['_target_']} takes {', '.join(taken) or 'no fields'}"
    for name in unknown:
        is_of_an_option = name in _fields_of_options(group)
        require(is_of_an_option, f"{group}.{name}", node[name], takes + suggest(name, taken))
    for name, is_required in taken.items():
        is_given = name in node or not is_required
        require(is_given, f"{group}.{name}", "(not set)", f"{takes}: give it one with +{group}.{name}=VALUE")
    return {name: value for name, value in node.items() if name not in unknown}


@cache
def find_new_name(target: str) -> str:
    """Find the present name of a target; one that has moved is named on stderr, once."""
    if target in NEW_NAMES:
        print(f"{target} is now {NEW_NAMES[target]}", file=sys.stderr)
    return NEW_NAMES.get(target, target)


def is_shipped(name: str) -> bool:
    """Check whether a module, or a class as a config names it, is of this package."""
    return name.partition(".")[0] == PACKAGE


@contextmanager
def current_folder_importable() -> Iterator[None]:
    """Make modules of the current folder importable, as ``python -m`` does but console scripts and workers do not."""
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
    """Import the class that ``target`` names as ``module.Class``; nothing but the import of its module runs code.

    Raises BadInput; as :class:`BadComponent` with the traceback of what its module raised.
    """
    if not isinstance(target, str) or not all(target.split(".")) or "." not in target:
        raise BadInput(key, target, "must name a class as module.Class, e.g. my_file.MyController")
    module_name, _, name = target.rpartition(".")
    module = _import(key, target, module_name)
    if not hasattr(module, name):
        classes = [
            each for each, value in inspect.getmembers(module, inspect.isclass) if value.__module__ == module_name
        ]
        has = f"; it has {listed(classes)}" if classes else ""
        where = getattr(module, "__file__", "built in")
        raise BadInput(key, target, f"{module_name} ({where}) has no {name}{has}{suggest(name, classes)}")
    found = getattr(module, name)
    require(inspect.isclass(found), key, target, f"must be a class, but is of type {type(found).__name__}")
    return found  # type: ignore[no-any-return]


def require_shipped(plain: Mapping[str, Any], consent: str) -> None:
    """Require that a stored config names only components of this package, else importing it would run other code.

    Raises BadInput for the first one, which says how to give ``consent``.
    """
    for group in COMPONENTS:
        node = plain.get(group)
        target = node.get("_target_") if isinstance(node, Mapping) else None
        reason = f"is code outside this project, which a stored config may name; add {consent} if you trust it"
        require(target is None or is_shipped(str(target)), f"{group}._target_", target, reason)


def _import(key: str, target: str, name: str) -> ModuleType:
    """Import a module by its full name; raises BadInput or, with what the module raised, BadComponent."""
    if name not in sys.modules:
        importlib.invalidate_caches()  # a file may have been written a moment ago
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
    """SHA-256 of the code of the custom components of a run, as it was imported; None: all are built in.

    The code is that of their files, and of the files beside them that they import. Files of data count too: those
    that a field of the component names, and those that its class lists as ``reads``, absolute or relative to the
    current folder. Without ``components`` that were made or given, it is that of those that the config names; raises
    BadInput.
    """
    hashes = list[str]()
    for index, group in enumerate(COMPONENTS):
        node = read_component(vars(config)[group])
        with current_folder_importable():
            own = type(components[index]) if components else find_class(f"{group}._target_", node["_target_"])
        if not is_shipped(own.__module__):
            named = [name for name in (*getattr(own, "reads", ()), *node.values()) if isinstance(name, str | Path)]
            data = [Path(name).read_bytes() for name in named if os.path.isfile(name)]
            hashes += [_hash_code(own.__module__), *(hashlib.sha256(content).hexdigest() for content in data)]
    return hashlib.sha256("".join(hashes).encode()).hexdigest() if hashes else None


@cache
def _hash_code(module: str) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in find_sources(module))).hexdigest()


def find_sources(name: str) -> list[Path]:
    """Files of an imported module and of those beside its top package that it imports, directly or not.

    Not those of this package, and of installed packages not those of others.
    """
    file = Path(vars(importlib.import_module(name)).get("__file__") or ".")
    if not file.is_file():  # written in a console
        return []
    root = file.parents[name.count(".") + (file.name == "__init__.py")]
    others = [PACKAGE]
    if str(root) in (sysconfig.get_path("purelib"), sysconfig.get_path("platlib")):
        others += [path.name.partition(".")[0] for path in root.iterdir()]
    finder = ModuleFinder([str(root)], excludes=[each for each in others if each != name.partition(".")[0]])
    if name == "__main__":
        finder.run_script(str(file))
    else:
        finder.import_hook(name)
    files = [vars(module)["__file__"] for module in finder.modules.values()]
    return sorted(Path(file) for file in files if file)
