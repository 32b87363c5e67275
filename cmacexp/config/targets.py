"""The class that a ``_target_`` names: a shipped component, or a class in a file of the user's own."""

import importlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from cmacexp.config.fields import listed
from cmacexp.errors import BadComponent, BadInput, format_install_command, suggest

NEW_NAMES = {
    f"cmacexp.control.{name}": f"cmacexp.feedforward.{name}"
    for name in (
        "CmacFeedforward", "InverseDynamics", "IterativeLearning", "NoFeedforward", "RadialBasis"
    )
}  # fmt: skip
"""Targets that have moved, by their old names, which keep working."""


@cache
def find_new_name(target: str) -> str:
    """The present name of a target; one that has moved is named on stderr, once."""
    if target in NEW_NAMES:
        print(f"{target} is now {NEW_NAMES[target]}", file=sys.stderr)
    return NEW_NAMES.get(target, target)


@contextmanager
def current_folder_importable() -> Iterator[None]:
    """Make modules of the current folder importable, as ``python -m`` does but console scripts and workers do not."""
    here = str(Path.cwd())
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
    if not inspect.isclass(found):
        raise BadInput(key, target, f"must be a class, but is of type {type(found).__name__}")
    return found


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
            reason = f"there is no module {missing}, neither in {Path.cwd()} nor where Python finds packages{near}"
            raise BadInput(key, target, reason) from error
        if command := format_install_command(missing):
            raise BadInput(key, target, f"needs {missing}, which is not installed: {command}") from error
        raise BadComponent(key, target, f"importing {name} failed: no module named {missing}", error) from error
    except (Exception, SystemExit) as error:
        raise BadComponent(key, target, f"importing {name} failed: {type(error).__name__}: {error}", error) from error
