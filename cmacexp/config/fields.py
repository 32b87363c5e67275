"""Config fields with their unit and range; how a config is made of plain values, and the one check of them all."""

import inspect
import math
import operator
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from cmacexp.errors import BadInput

TYPES = {int: "a whole number", float: "a number", bool: "true or false", str: "a word"}
FLAGS = dict.fromkeys(("true", "yes", "on", "y", "1"), True) | dict.fromkeys(("false", "no", "off", "n", "0"), False)
"""What can be typed for a flag."""
BOUNDS = {"above": operator.gt, "at least": operator.ge, "below": operator.lt, "at most": operator.le}
"""What a number must be to each of its bounds."""
Tuned = tuple[float, float] | list[Any] | None
"""What a field is tuned over: ends of a range, or choices; None: it is not tuned."""


def number(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    words: Sequence[str] = (),
    needs: tuple[str, ...] = (),
    default: Any = MISSING,
    tuned: Tuned = None,
) -> Any:
    """A dataclass field for a quantity in ``unit`` within the given range, or one of ``words``.

    Shipped fields have no default: their values stand in ``conf/``. What a field ``needs`` to have an effect, all of
    it, is written as :mod:`cmacexp.engine.without_effect` describes. Whoever tunes the component draws from
    ``tuned``: the ends of a range, whose logarithm is drawn evenly, or a list of choices.
    """
    bounds = {"above": above, "at least": at_least, "below": below, "at most": at_most}
    given = {name: bound for name, bound in bounds.items() if bound is not None}
    return field(default=default, metadata={"unit": unit, "words": words, "needs": needs, "tuned": tuned, **given})


def choice(*names: str, needs: tuple[str, ...] = (), tuned: Tuned = None) -> Any:
    """A dataclass field for one of ``names``, or a list of at least one of them, each once; ``tuned`` as above."""
    return field(metadata={"choices": names, "needs": needs, "tuned": tuned})


def describe_range(metadata: dict[str, Any]) -> str:
    """The allowed range in words, e.g. ``must be above 0 and at most 1``."""
    parts = [f"{name} {metadata[name]:.15g}" for name in BOUNDS if name in metadata]
    words_too = "".join(f", or {name}" for name in metadata.get("words", ()))
    return "must be " + (" and ".join(parts) if parts else "a finite number") + words_too


def _is_allowed(item: object, metadata: dict[str, Any]) -> bool:
    """Whether a number or word is allowed; numbers of samples are whole."""
    if isinstance(item, str):
        return not metadata["words"] or item in metadata["words"]
    if not isinstance(item, int | float) or isinstance(item, bool):
        return True
    if not abs(item) < math.inf or (isinstance(item, float) and metadata["unit"] == "samples"):
        return False
    return all(holds(item, metadata[name]) for name, holds in BOUNDS.items() if name in metadata)


def _flatten(value: object) -> list[object]:
    """A value, or those in a list, or in lists inside it."""
    return [each for item in value for each in _flatten(item)] if isinstance(value, list) else [value]


def _check_field(key: str, value: object, metadata: dict[str, Any]) -> None:
    if "choices" in metadata:
        allowed = metadata["choices"]
        names = value if isinstance(value, list) else [value]
        for name in names:
            if name not in allowed:
                raise BadInput(key, name, "choose from " + ", ".join(allowed))
        if len(set(names)) != len(names) or not names:
            raise BadInput(key, value, f"must name at least one of {', '.join(allowed)}, each once")
    elif "unit" in metadata:
        unit, words = metadata["unit"], metadata["words"]
        for item in _flatten(value):
            if not _is_allowed(item, metadata):
                hint = f" ({unit}, whole)" if words and unit == "samples" else f" ({unit})" if unit else ""
                raise BadInput(key, item, describe_range(metadata) + hint)


@cache
def _declared_types(schema: Any) -> dict[str, Any]:
    return get_type_hints(schema)


@cache
def _choices_of_type(declared: Any) -> tuple[Any, ...]:
    return get_args(declared) if get_origin(declared) in (Union, UnionType) else (declared,)


def _has_type(value: object, declared: Any) -> bool:
    """Whether a value is of the type of its field, which an interpolation or a list inside a list may not be."""
    for kind in _choices_of_type(declared):
        if get_origin(kind) is list:
            fits = isinstance(value, list) and all(_has_type(item, *get_args(kind)) for item in value)
        else:
            fits = kind is Any or (
                isinstance(value, kind) if inspect.isclass(kind) and is_dataclass(kind) else type(value) is kind
            )
        if fits:
            return True
    return False


def _describe_type(declared: Any) -> str:
    """A type in words, e.g. ``must be a list of whole numbers, or null``."""
    words = []
    for kind in _choices_of_type(declared):
        if get_origin(kind) is list:
            words.append(f"a list in which each is {TYPES.get(_choices_of_type(get_args(kind)[0])[0], 'a value')}")
        else:
            words.append("null" if kind is NoneType else TYPES.get(kind, "a group of fields"))
    quotes = "; if it looks like a number, put it into quotes" if TYPES[str] in words else ""
    return "must be " + ", or ".join(words) + quotes


def _convert(value: Any, declared: Any, key: str) -> Any:
    """A plain value as a field of type ``declared`` holds it; unchanged if it cannot, which a check then reports."""
    if _has_type(value, declared):
        return value
    for kind in _choices_of_type(declared):
        if is_dataclass(kind) and isinstance(value, Mapping):
            return make_config(kind, value, key)
        if get_origin(kind) is list and isinstance(value, list):
            return [_convert(item, get_args(kind)[0], key) for item in value]
        if kind is bool and str(value).lower() in FLAGS:
            return FLAGS[str(value).lower()]
        if kind in (int, float) and type(value) in (int, str):
            with suppress(ValueError, OverflowError):
                return kind(value)
    return value


def make_config(schema: Any, node: Mapping[str, Any], key: str = "") -> Any:
    """A config dataclass of plain values, as YAML holds them; :func:`check_fields` checks their types and ranges.

    Raises BadInput if a key below ``key`` is not that of a field, or a field without default is missing.
    """
    before, types = f"{key}." if key else "", _declared_types(schema)
    declared = {each.name: each for each in fields(schema)}
    for name in node:
        if name not in declared:
            allowed = f"no such key; {key or 'the config'} has {listed(list(declared))}"
            raise BadInput(f"{before}{name}", node[name], allowed)
    for name, each in declared.items():
        if name not in node and each.default is MISSING and each.default_factory is MISSING:
            raise BadInput(before + name, "(not set)", "must have a value")
    return schema(**{name: _convert(value, types[name], before + name) for name, value in node.items()})


def check_fields(node: object, prefix: str = "") -> None:
    """Check every field of a config dataclass, and of those inside it, against its type and range.

    Raises BadInput, which names the key below ``prefix``, for the first field outside it.
    """
    if not is_dataclass(node):
        return
    for each in fields(node):
        value = getattr(node, each.name)
        key = f"{prefix}.{each.name}" if prefix else each.name
        declared = _declared_types(node.__class__)[each.name]
        if not _has_type(value, declared):
            if isinstance(value, list) and all(get_origin(kind) is not list for kind in _choices_of_type(declared)):
                sweep = f"-m {key}={','.join(map(str, value))}"
                raise BadInput(key, value, f"must be one value, not a list; for a sweep write {sweep}")
            raise BadInput(key, value, _describe_type(declared))
        if is_dataclass(value):
            check_fields(value, key)
        elif isinstance(value, dict):
            for name, item in value.items():
                check_fields(item, f"{key}.{name}")
        elif each.metadata:
            _check_field(key, value, dict(each.metadata))


def listed(names: Sequence[str]) -> str:
    """Names in the order and form of an error message."""
    return ", ".join(sorted(names))
