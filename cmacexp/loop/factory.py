"""Parts of a run, made from the ``_target_`` and fields of their config nodes: built in, or a class of one's own."""

import difflib
import importlib
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any

from hydra.errors import InstantiationException
from hydra.utils import instantiate

from cmacexp.config.fields import listed
from cmacexp.config.schema import BUILT_IN_PARTS
from cmacexp.errors import BadComponent, BadInput, format_install_command

METHODS = {
    "plant": ("reset", "step"),
    "sensors": ("reset", "measure"),
    "controller": ("reset", "act"),
    "feedforward": ("reset", "predict", "acts"),
}
"""What each part must have."""

FIELDS_OF_OPTIONS = {field.name for schema in BUILT_IN_PARTS.values() for field in fields(schema)}
"""Fields that a class of one's own may find in its node because the option that it replaces has them."""


@contextmanager
def current_folder_importable() -> Iterator[None]:
    """Have modules of the current folder found, as ``python -m`` does but console scripts and workers do not."""
    here = str(Path.cwd())
    if any(entry in ("", here) for entry in sys.path):
        yield
        return
    sys.path.insert(0, here)
    try:
        yield
    finally:
        sys.path.remove(here)


def _no_module(key: str, target: str, name: str) -> BadInput:
    near = difflib.get_close_matches(name, [path.stem for path in Path.cwd().glob("*.py")], 1)
    meant = f"; did you mean {near[0]}?" if near else ""
    return BadInput(
        key, target, f"there is no module {name}, neither in {Path.cwd()} nor where Python finds packages{meant}"
    )


def _import(key: str, target: str, name: str) -> ModuleType | None:
    """A module by its full name; None if there is none of that name.

    Raises:
        BadComponent: it is there, and raises when it is imported.
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
        raise BadComponent(key, target, f"importing {name} found no module {missing}", error) from error
    except Exception as error:
        raise BadComponent(key, target, f"importing {name} raised {type(error).__name__}: {error}", error) from error


def _find(key: str, target: object) -> Callable[..., object]:
    """What ``target`` names.

    Raises:
        BadInput: there is no such thing.
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
    if not callable(found):
        raise BadInput(key, target, f"is no class but a {type(found).__name__}")
    return found  # type: ignore[no-any-return]


def _no_attribute(holder: Any, name: str) -> str:
    where = getattr(holder, "__file__", None)
    own = [
        attribute
        for attribute, value in vars(holder).items()
        if inspect.isclass(value) and value.__module__ == holder.__name__
    ]
    has = f"; it has {listed(own)}" if own else ""
    near = difflib.get_close_matches(name, own, 1)
    meant = f"; did you mean {near[0]}?" if near else ""
    return f"{holder.__name__} ({where}) has no {name}{has}{meant}" if where else f"has no {name}{has}{meant}"


def _fitting(key: str, make: Callable[..., object], node: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a node that ``make`` takes, without those that only stand in the option that it replaces.

    Raises:
        BadInput: it takes no field of that name, or needs one that is not there.
    """
    given = {name: value for name, value in node.items() if not (name.startswith("_") and name.endswith("_"))}
    if inspect.isbuiltin(make):  # Hydra tells which of them it refuses
        return dict(node)
    try:
        parameters = list(inspect.signature(make).parameters.values())
    except (TypeError, ValueError):  # of a class that is not written in Python
        return dict(node)
    if any(parameter.kind == parameter.VAR_KEYWORD for parameter in parameters):
        return dict(node)
    named = {p.name: p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}
    takes = f"{node['_target_']} takes {', '.join(named) or 'no fields'}"
    for name, value in given.items():
        if name not in named and name not in FIELDS_OF_OPTIONS:
            near = difflib.get_close_matches(name, named, 1)
            raise BadInput(f"{key}.{name}", value, takes + (f"; did you mean {near[0]}?" if near else ""))
    for name, parameter in named.items():
        if name not in given and parameter.default is parameter.empty:
            raise BadInput(f"{key}.{name}", "(not set)", f"{takes}: give it one with +{key}.{name}=VALUE")
    return {name: value for name, value in node.items() if name not in given or name in named}


def build(key: str, node: Mapping[str, Any], made: Any = None) -> tuple[Any, dict[str, Any]]:
    """A part, and the node that it was made from without fields that it does not take.

    Args:
        key: the group, ``controller``.
        node: its ``_target_`` and fields.
        made: the part if it is made already.

    Raises:
        BadInput: it cannot be made; as :class:`BadComponent` with the traceback of what its own code raised.
    """
    target, where = node.get("_target_"), f"{key}._target_"
    part, fitting = (made, dict(node)) if made is not None else _make(where, key, node)
    missing = [name for name in METHODS[key] if not hasattr(part, name)]
    if missing:
        raise BadInput(where, target, f"is no {key}: it has no {' and no '.join(missing)}")
    return part, fitting


def _make(where: str, key: str, node: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    target = node.get("_target_")
    make = _find(where, target)
    fitting = _fitting(key, make, node)
    try:
        return instantiate(fitting), fitting
    except InstantiationException as error:
        cause = error.__cause__
        if isinstance(cause, BadInput):
            raise cause from None
        if isinstance(cause, ModuleNotFoundError) and (command := format_install_command(cause.name or "")):
            raise BadInput(where, target, f"needs {cause.name}, which is not installed: {command}") from error
        reason = " ".join(str(cause or error).split())
        if cause is None:
            raise BadInput(where, target, f"cannot be made: {reason}") from error
        raise BadComponent(where, target, f"cannot be made: {type(cause).__name__}: {reason}", cause) from error
