"""Description of configs: dotted keys, unit and meaning of each field, and the keys in which configs differ."""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from itertools import chain, pairwise
from typing import Any, NamedTuple

from cmacexp.config.component import COMPONENTS, config_class, find_class, find_option, is_shipped
from cmacexp.config.fields import list_declared_fields
from cmacexp.config.load import select_effective
from cmacexp.config.machine import MACHINES
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput


def flatten_config(config: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Flatten a plain config to values by dotted key, e.g. ``terrain.stiffness``; keys begin with ``before``.

    The ``_target_`` of a component becomes its group with the name of its option, e.g. ``feedforward: cmac``.
    """
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            flat |= flatten_config(value, f"{before}{key}.")
        elif key == "_target_" and before[:-1] in COMPONENTS:
            flat[before[:-1]] = find_option(before[:-1], value)
        else:
            flat[before + key] = value
    return flat


def differences(configs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """List, for each config, its values of the keys in which the configs differ, by dotted key.

    Keys that do not affect results are ignored; a config has no entry for a key that it lacks.
    """
    flats = [flatten_config(select_effective(config)) for config in configs]
    keys = list(dict.fromkeys(chain.from_iterable(flats)))
    differing = [key for key in keys if any(key not in flat or flat[key] != flats[0].get(key) for flat in flats)]
    return [{key: flat[key] for key in differing if key in flat} for flat in flats]


class Described(NamedTuple):
    """Unit and meaning of a field."""

    unit: str
    meaning: str


def describe_fields(config: Mapping[str, Any]) -> dict[str, Described]:
    """Describe the fields of a plain config, by the keys of :func:`cmacexp.config.describe.flatten_config`.

    Fields of a component without a ``Config``, or whose class cannot be imported here, are missing.
    """
    return dict(_describe(Config, config, ""))


def _describe(schema: type, node: Mapping[str, Any], before: str) -> Iterator[tuple[str, Described]]:
    """Yield key, unit and meaning of the fields of ``node``, of class ``schema``; keys begin with ``before``."""
    meanings = read_meanings(schema)
    for name, (declared, inner) in list_declared_fields(schema).items():
        key = before + name
        value = node.get(name)
        if not isinstance(value, Mapping):
            if name != "_target_":
                yield key, Described(declared.metadata.get("unit", ""), meanings.get(name, ""))
            continue
        if key in COMPONENTS and (component := _find_component(key, str(value.get("_target_")))):
            yield key, Described("", (inspect.getdoc(component) or "").partition("\n")[0])
            inner = config_class(component)
        elif key == "machine":
            inner = MACHINES.get(str(value.get("kind")))
        if is_dataclass(inner):
            yield from _describe(inner, value, f"{key}.")  # type: ignore[arg-type]


def _find_component(group: str, target: str) -> type | None:
    """Return the class of a component; None for a custom one whose module this process has not imported.

    The config may be that of a run of another user, whose code must not be executed.
    """
    if not is_shipped(target) and target.rpartition(".")[0] not in sys.modules:
        return None
    try:
        return find_class(f"{group}._target_", target)
    except BadInput:
        return None


def read_meanings(schema: type) -> dict[str, str]:
    """Read the docstrings of the fields of a dataclass, inherited ones included, by field name."""
    meanings: dict[str, str] = {}
    for base in reversed([base for base in schema.__mro__ if is_dataclass(base)]):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0].body  # type: ignore[attr-defined]
        except OSError:  # a class without a source file, as in a console
            continue
        for declared, text in pairwise(body):
            if isinstance(declared, ast.AnnAssign) and isinstance(declared.target, ast.Name):
                is_text = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
                meanings[declared.target.id] = " ".join(str(text.value.value).split()) if is_text else ""
    return meanings
