"""Fields with their unit and range, and the one function that makes a dataclass of plain values and checks them.

:func:`read_fields` serves every dataclass whose fields are declared with :func:`number` and :func:`choice`, or
plainly: the config of a run as YAML holds it, the ``Config`` of a component, and what else is read from a file.
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
"""What can be typed for a flag."""
BOUNDS = {"above": operator.gt, "at least": operator.ge, "below": operator.lt, "at most": operator.le}
"""What a number must be to each of its bounds."""
T = TypeVar("T")
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
    given: dict[str, Any] = {name: bound for name, bound in bounds.items() if bound is not None}
    given["tests"] = [(BOUNDS[name], bound) for name, bound in given.items()]
    return field(default=default, metadata={"unit": unit, "words": words, "needs": needs, "tuned": tuned, **given})


def choice(*names: str, needs: tuple[str, ...] = (), tuned: Tuned = None) -> Any:
    """A dataclass field for one of ``names``, or a list of at least one of them, each once; ``tuned`` as above."""
    return field(metadata={"choices": names, "needs": needs, "tuned": tuned})


def listed(names: Sequence[str]) -> str:
    """Names in the order and form of an error message."""
    return ", ".join(sorted(names))


def describe_range(metadata: Mapping[str, Any]) -> str:
    """The allowed range in words, e.g. ``must be above 0 and at most 1``."""
    parts = [f"{name} {metadata[name]:.15g}" for name in BOUNDS if name in metadata]
    words_too = "".join(f", or {name}" for name in metadata.get("words", ()))
    return "must be " + (" and ".join(parts) if parts else "a finite number") + words_too


def read_fields(schema: type[T], node: Mapping[str, Any], key: str = "", texts: bool = True) -> T:
    """A dataclass of plain values, as YAML or JSON holds them: each is converted to its type, and checked.

    Numbers and flags may be ``texts``, as they are typed. A field may be a number, a flag, a text, null, another
    dataclass, a list of these, or a dictionary of them by name. An object that already has the type of its field
    stays as it is.

    Raises:
        BadInput: names the key, below ``key``, of the first name that is of no field, of a field that is missing and
            has no default, or of a value that is of another type than its field or outside its range.
    """
    before, declared = f"{key}." if key else "", _list_declared(schema)  # type: ignore[arg-type]
    for name in node:
        if name not in declared:
            raise BadInput(
                f"{before}{name}", node[name], f"no such key; {key or 'the config'} has {listed(list(declared))}"
            )
    for name, (each, _) in declared.items():
        if name not in node and each.default is MISSING and each.default_factory is MISSING:
            raise BadInput(before + name, "(not set)", "must have a value")
    # Defaults are checked too: those of a component of a user may be wrong.
    defaults = {name: each.default for name, (each, _) in declared.items() if each.default is not MISSING}
    given = {**defaults, **node}
    return schema(**{name: read_field(schema, name, value, before + name, texts) for name, value in given.items()})


class _OtherType(Exception):
    """A value, or one in a list, that cannot be converted to the type of its field."""


def read_field(schema: Any, name: str, given: Any, key: str, texts: bool = True) -> Any:
    """A plain value as the field ``name`` of a dataclass holds it, see :func:`read_fields`."""
    each, declared = _list_declared(schema)[name]
    try:
        value = _convert(given, declared, key, texts)
    except _OtherType:
        if isinstance(given, list) and all(get_origin(kind) is not list for kind in _choices_of_type(declared)):
            allowed = f"must be one value, not a list; for a sweep write -m {key}={','.join(map(str, given))}"
        else:
            allowed = _describe_type(declared)
        raise BadInput(key, given, allowed) from None
    if "choices" in each.metadata:
        _check_choice(key, value, each.metadata["choices"])
    elif "unit" in each.metadata:
        _check_range(key, value, each.metadata)
    return value


@cache
def _list_declared(schema: Any) -> dict[str, tuple[Field[Any], Any]]:
    """The fields of a dataclass with their types, by name."""
    types = get_type_hints(schema)
    return {each.name: (each, types[each.name]) for each in fields(schema)}


def _choices_of_type(declared: Any) -> tuple[Any, ...]:
    return get_args(declared) if get_origin(declared) in (Union, UnionType) else (declared,)


def _convert(value: Any, declared: Any, key: str, texts: bool) -> Any:
    """A plain value as a field of type ``declared`` holds it; raises _OtherType if it cannot."""
    kinds = _choices_of_type(declared)
    if Any in kinds or type(value) in kinds:
        return value
    for kind in kinds:
        origin, inner = get_origin(kind), get_args(kind)
        if is_dataclass(kind) and isinstance(value, Mapping):
            return read_fields(kind, value, key, texts)  # type: ignore[arg-type]
        if origin is list and isinstance(value, list):
            return [_convert(item, inner[0], key, texts) for item in value]
        if origin is dict and isinstance(value, Mapping):
            return {name: _convert(item, inner[1], f"{key}.{name}", texts) for name, item in value.items()}
        if kind is bool and texts and str(value).lower() in FLAGS:
            return FLAGS[str(value).lower()]
        if kind in (int, float) and type(value) in ((int, str) if texts else (int,)):
            with suppress(ValueError, OverflowError):
                return kind(value)
    raise _OtherType


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


def _check_choice(key: str, value: Any, allowed: Sequence[str]) -> None:
    names = value if isinstance(value, list) else [value]
    for name in names:
        require(name in allowed, key, name, "choose from " + ", ".join(allowed))
    is_set = names and len(set(names)) == len(names)
    require(is_set, key, value, f"must name at least one of {', '.join(allowed)}, each once")


def _check_range(key: str, value: Any, metadata: Mapping[str, Any]) -> None:
    """Check a number or word, or those in a list, or in lists inside it; numbers of samples are whole."""
    if isinstance(value, list):
        for item in value:
            _check_range(key, item, metadata)
        return
    unit, words = metadata["unit"], metadata["words"]
    if isinstance(value, int | float) and not isinstance(value, bool):
        whole = unit != "samples" or isinstance(value, int)
        is_allowed = (
            abs(value) < math.inf and whole and all(holds(value, bound) for holds, bound in metadata["tests"])
        )
    else:
        is_allowed = not isinstance(value, str) or not words or value in words
    if not is_allowed:
        hint = f" ({unit}, whole)" if words and unit == "samples" else f" ({unit})" if unit else ""
        raise BadInput(key, value, describe_range(metadata) + hint)
