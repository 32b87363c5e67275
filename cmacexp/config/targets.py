"""The class that a ``_target_`` names: a shipped component, or a class in a file of the user's own."""

import importlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from cmacexp.config.fields import listed
from cmacexp.errors import BadComponent, BadInput, format_install_command, suggest


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
    """Import the class that ``target`` names; nothing but the import of its module runs code.

    Args:
        key: the config key of the target, ``controller._target_``.
        target: ``module.Class``.

    Raises:
        BadInput: there is no such class; as :class:`BadComponent` with the traceback of what its module raised.
    """
    if not isinstance(target, str) or not all(target.split(".")) or "." not in target:
        raise BadInput(key, target, "must name a class as module.Class, e.g. my_file.MyController")
    names = target.split(".")
    found: Any = _import(key, target, names[0])
    if found is None:
        raise _no_module(key, target, names[0])
    for depth, name in enumerate(names[1:], 1):
        inside = getattr(found, name, None)
        if inside is None and isinstance(found, ModuleType) and hasattr(found, "__path__"):
            inside = _import(key, target, ".".join(names[: depth + 1]))
        if inside is None:
            raise BadInput(key, target, _no_attribute(found, name))
        found = inside
    if not inspect.isclass(found):
        raise BadInput(key, target, f"must be a class, but is of type {type(found).__name__}")
    return found


def _import(key: str, target: str, name: str) -> ModuleType | None:
    """Import a module by its full name; None if there is none of that name.

    Raises:
        BadComponent: it exists, and raises when it is imported.
    """
    importlib.invalidate_caches()  # a file may have been written a moment ago
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if name == missing or name.startswith(f"{missing}."):
            return None
        if command := format_install_command(missing):
            raise BadInput(key, target, f"needs {missing}, which is not installed: {command}") from error
        raise BadComponent(key, target, f"importing {name} failed: no module named {missing}", error) from error
    except (Exception, SystemExit) as error:
        raise BadComponent(key, target, f"importing {name} failed: {type(error).__name__}: {error}", error) from error


def _no_module(key: str, target: str, name: str) -> BadInput:
    meant = suggest(name, [path.stem for path in Path.cwd().glob("*.py")])
    return BadInput(
        key, target, f"there is no module {name}, neither in {Path.cwd()} nor where Python finds packages{meant}"
    )


def _no_attribute(holder: Any, name: str) -> str:
    if not isinstance(holder, ModuleType | type):
        return f"has no {name}"
    where = getattr(holder, "__file__", None)
    own = [
        attribute
        for attribute, value in vars(holder).items()
        if inspect.isclass(value) and value.__module__ == holder.__name__
    ]
    has = f"; it has {listed(own)}" if own else ""
    meant = suggest(name, own)
    return f"{holder.__name__} ({where}) has no {name}{has}{meant}" if where else f"has no {name}{has}{meant}"
