"""What a config says: its fields as flat keys, with unit and meaning, and in which keys several configs differ."""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any, NamedTuple, get_type_hints

from cmacexp.config.component import COMPONENTS, config_class, find_class, find_option, is_shipped
from cmacexp.config.load import select_effective
from cmacexp.config.machine import MACHINES
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput


def flatten_config(config: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """A config as dotted keys, which begin with ``before``; a ``_target_`` as its group with its option."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            found |= flatten_config(value, f"{before}{key}.")
        elif key == "_target_" and before[:-1] in COMPONENTS:
            found[before[:-1]] = find_option(before[:-1], value)
        else:
            found[before + key] = value
    return found


def differences(configs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """For each config, the keys in which not all of them agree, with its values; without keys that it lacks."""
    flats = [flatten_config(select_effective(config)) for config in configs]
    keys = list(dict.fromkeys(key for each in flats for key in each))
    differing = [key for key in keys if any(key not in each or each[key] != flats[0].get(key) for each in flats)]
    return [{key: each[key] for key in differing if key in each} for each in flats]


class Described(NamedTuple):
    """What is declared of a field."""

    unit: str
    meaning: str


def describe_fields(config: Mapping[str, Any]) -> dict[str, Described]:
    """Unit and meaning of the fields of a config, by the keys of :func:`cmacexp.config.describe.flatten_config`.

    Fields of a component without a ``Config``, or whose class cannot be imported here, are missing.
    """
    return dict(_describe(Config, config, ""))


def _describe(schema: type, node: Mapping[str, Any], before: str) -> Iterator[tuple[str, Described]]:
    types, meanings = get_type_hints(schema), read_meanings(schema)
    for each in fields(schema):  # type: ignore[arg-type]
        key, value, inner = before + each.name, node.get(each.name), types[each.name]
        if not isinstance(value, Mapping):
            if each.name != "_target_":
                yield key, Described(each.metadata.get("unit", ""), meanings.get(each.name, ""))
            continue
        if key in COMPONENTS and (component := _find_component(key, str(value.get("_target_")))):
            yield key, Described("", (inspect.getdoc(component) or "").partition("\n")[0])
            inner = config_class(component)
        elif key == "machine":
            inner = MACHINES.get(str(value.get("kind")))
        if is_dataclass(inner):
            yield from _describe(inner, value, f"{key}.")  # type: ignore[arg-type]


def _find_component(group: str, target: str) -> type | None:
    """The class of a component; None if it is neither shipped nor used here: the run may be somebody else's."""
    if not is_shipped(target) and target.rpartition(".")[0] not in sys.modules:
        return None
    try:
        return find_class(f"{group}._target_", target)
    except BadInput:
        return None


def read_meanings(schema: type) -> dict[str, str]:
    """The strings that follow the fields of a dataclass and of those that it inherits from."""
    found: dict[str, str] = {}
    for base in reversed([base for base in schema.__mro__ if is_dataclass(base)]):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0].body  # type: ignore[attr-defined]
        except OSError:  # a class that was typed, not read from a file
            continue
        for declared, text in pairwise(body):
            if isinstance(declared, ast.AnnAssign) and isinstance(declared.target, ast.Name):
                is_text = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
                found[declared.target.id] = " ".join(str(text.value.value).split()) if is_text else ""
    return found
