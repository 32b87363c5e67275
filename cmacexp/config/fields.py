"""Declaration of fields with unit and range, and conversion of plain values to a checked dataclass.

:func:`read_fields` works for every dataclass, with fields declared by :func:`number`, by :func:`choice`, or without
either: the config of a run in YAML, the ``Config`` of a component, and other data read from files.
"""

import math
import operator
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from cmacexp.errors import BadInput, require

TYPES = {int: "a whole number", float: "a number", bool: "true or false", str: "a word"}
FLAGS = dict.fromkeys(("true", "yes", "on", "y", "1"), True) | dict.fromkeys(("false", "no", "off", "n", "0"), False)
"""Texts accepted for a flag, with their values."""
BOUNDS = {"above": operator.gt, "at least": operator.ge, "below": operator.lt, "at most": operator.le}
"""Comparison of a number with each kind of bound."""
T = TypeVar("T")
Tuned = tuple[float, float] | list[Any] | None
"""Search space of a field: ends of a range, or a list of choices; None: the field is not tuned."""


def number(
    unit: str,
    *,
    words: Sequence[str] = (),
    needs: tuple[str, ...] = (),
    default: Any = MISSING,
    tuned: Tuned = None,
    **bounds: float,
) -> Any:
    """Declare a dataclass field for a quantity.

    Args:
        unit: Unit of the quantity; empty if it has none. With ``samples`` it must be an integer.
        words: Words that the field accepts besides numbers, e.g. ``auto``.
        needs: Conditions, all of which must hold for the field to have an effect, written as
            :mod:`cmacexp.engine.without_effect` describes.
        default: Default value, for configs of runs that are older than the field. Values are in ``conf/``.
        tuned: Search space for tuning: the ends of a range, in which the logarithm of the value is drawn uniformly,
            or a list of choices.
        bounds: ``above``, ``at_least``, ``below`` and ``at_most``, in ``unit``.
    """
    named = {name.replace("_", " "): bound for name, bound in bounds.items()}
    tests = [(BOUNDS[name], bound) for name, bound in named.items()]
    metadata = {"unit": unit, "words": words, "needs": needs, "tuned": tuned, **named, "tests": tests}
    return _declare(metadata, default)


def _declare(metadata: dict[str, Any], default: Any) -> Any:
    """Declare a field; one with a ``default`` is given by name only, and a list is copied for each object."""
    if isinstance(default, list):
        return field(default_factory=default.copy, kw_only=True, metadata=metadata)
    return field(default=default, kw_only=default is not MISSING, metadata=metadata)


def choice(*names: str, needs: tuple[str, ...] = (), tuned: Tuned = None, default: Any = MISSING) -> Any:
    """Declare a dataclass field for one of ``names``, or for a list of at least one of them without repeats.

    ``needs``, ``tuned`` and ``default`` are as for :func:`number`.
    """
    return _declare({"choices": names, "needs": needs, "tuned": tuned}, default)


def listed(names: Sequence[str]) -> str:
    """Join names in alphabetical order, for error messages."""
    return ", ".join(sorted(names))


def describe_range(metadata: Mapping[str, Any]) -> str:
    """Describe the range of a field by its ``metadata``, e.g. ``must be above 0 and at most 1``."""
    parts = [f"{name} {metadata[name]:.15g}" for name in BOUNDS if name in metadata]
    words_too = "".join(f", or {name}" for name in metadata.get("words", ()))
    return "must be " + (" and ".join(parts) if parts else "a finite number") + words_too


def read_fields(schema: type[T], node: Mapping[str, Any], key: str = "", texts: bool = True) -> T:
    """Make a dataclass from plain values, as in YAML or JSON: each is converted to the type of its field and checked.

    Args:
        schema: The dataclass. A field may be a number, a flag, a text, null, another dataclass, a list of these, or a
            dictionary of them by name.
        node: Values by field name. An object that already has the type of its field is not converted.
        key: Dotted key of ``node`` for error messages.
        texts: True if numbers and flags may be texts, as on the command line.

    Raises:
        BadInput: A name is that of no field, a field without a default is missing, or a value has another type than
            its field or lies outside the range; names the key of the first such value.
    """
    before = f"{key}." if key else ""
    declared = list_declared_fields(schema)  # type: ignore[arg-type]
    for name in node:
        if name not in declared:
            raise BadInput(
                f"{before}{name}", node[name], f"no such key; {key or 'the config'} has {listed(list(declared))}"
            )
    for name, (item, _) in declared.items():
        if name not in node and item.default is MISSING and item.default_factory is MISSING:
            raise BadInput(before + name, "(not set)", "must have a value")
    # Defaults are checked too: those of a custom component may be wrong.
    defaults = {name: item.default for name, (item, _) in declared.items() if item.default is not MISSING}
    values = {**defaults, **node}
    return schema(**{name: read_field(schema, name, value, before + name, texts) for name, value in values.items()})


class _OtherType(Exception):
    """Raised if a value, or an item of a list, cannot be converted to the type of its field."""


def read_field(schema: Any, name: str, plain: Any, key: str, texts: bool = True) -> Any:
    """Convert a plain value to the type of the field ``name`` of a dataclass, and check it; see :func:`read_fields`.

    Raises BadInput, which names ``key``.
    """
    declared, kind = list_declared_fields(schema)[name]
    try:
        value = _convert(plain, kind, key, texts)
    except _OtherType:
        if isinstance(plain, list) and all(get_origin(option) is not list for option in _choices_of_type(kind)):
            allowed = f"must be one value, not a list; for a sweep write -m {key}={','.join(map(str, plain))}"
        else:
            allowed = _describe_type(kind)
        raise BadInput(key, plain, allowed) from None
    if "choices" in declared.metadata:
        _check_choice(key, value, declared.metadata["choices"])
    elif "unit" in declared.metadata:
        _check_range(key, value, declared.metadata)
    return value


@cache
def list_declared_fields(schema: Any) -> dict[str, tuple[Field[Any], Any]]:
    """List the fields of a dataclass with their types, by name."""
    types = get_type_hints(schema)
    return {item.name: (item, types[item.name]) for item in fields(schema)}


def _choices_of_type(declared: Any) -> tuple[Any, ...]:
    return get_args(declared) if get_origin(declared) in (Union, UnionType) else (declared,)


def _convert(value: Any, declared: Any, key: str, texts: bool) -> Any:
    """Convert a plain value to the type ``declared`` of a field; raises _OtherType if that is impossible."""
    kinds = _choices_of_type(declared)
    if Any in kinds or type(value) in kinds:
        return value
    for kind in kinds:
        origin = get_origin(kind)
        if is_dataclass(kind) and isinstance(value, Mapping):
            return read_fields(kind, value, key, texts)  # type: ignore[arg-type]
        if origin is list and isinstance(value, list):
            return [_convert(item, get_args(kind)[0], key, texts) for item in value]
        if origin is dict and isinstance(value, Mapping):
            return {name: _convert(item, get_args(kind)[1], f"{key}.{name}", texts) for name, item in value.items()}
        if kind is bool and texts and str(value).lower() in FLAGS:
            return FLAGS[str(value).lower()]
        if kind in (int, float) and type(value) in ((int, str) if texts else (int,)):
            with suppress(ValueError, OverflowError):
                return kind(value)
    raise _OtherType


def _describe_type(declared: Any) -> str:
    """Describe a type in words, e.g. ``must be a number, or null``."""
    words = []
    for kind in _choices_of_type(declared):
        if get_origin(kind) is list:
            words.append(f"a list in which each is {TYPES.get(_choices_of_type(get_args(kind)[0])[0], 'a value')}")
        else:
            words.append("null" if kind is NoneType else TYPES.get(kind, "a group of fields"))
    quotes = "; if it looks like a number, put it into quotes" if TYPES[str] in words else ""
    return "must be " + ", or ".join(words) + quotes


def _check_choice(key: str, value: Any, allowed: Sequence[str]) -> None:
    names = value if isinstance(value, list) else [value]
    for name in names:
        require(name in allowed, key, name, "choose from " + ", ".join(allowed))
    require(
        names and len(set(names)) == len(names),
        key,
        value,
        f"must name at least one of {', '.join(allowed)}, each once",
    )


def _check_range(key: str, value: Any, metadata: Mapping[str, Any]) -> None:
    """Check the range of a number or the choice of a word, also inside nested lists; samples must be integers."""
    if isinstance(value, list):
        for item in value:
            _check_range(key, item, metadata)
        return
    unit = metadata["unit"]
    words = metadata["words"]
    if isinstance(value, int | float) and not isinstance(value, bool):
        is_whole = unit != "samples" or isinstance(value, int)
        is_allowed = (
            abs(value) < math.inf and is_whole and all(holds(value, bound) for holds, bound in metadata["tests"])
        )
    else:
        is_allowed = not isinstance(value, str) or not words or value in words
    if not is_allowed:
        hint = f" ({unit}, whole)" if words and unit == "samples" else f" ({unit})" if unit else ""
        raise BadInput(key, value, describe_range(metadata) + hint)
