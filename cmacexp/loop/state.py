"""The arrays of a loop, by the role that their components declare in :mod:`cmacexp.typing`, and copies of them."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

from cmacexp.typing import Role


class Declared(NamedTuple):
    """An array of the loop as its component declares it."""

    name: str
    """Fields on the path to it."""
    array: Any
    role: Role | None
    """None: the loop does not change it."""


def _read_roles(kind: Any) -> dict[str, Role | None]:
    """Read the declared roles of the fields of a tuple, by name."""
    hints = get_type_hints(kind, include_extras=True)
    declared = {name: get_args(hints[name])[1:] for name in kind._fields}
    return {name: role[0] if role and isinstance(role[0], Role) else None for name, role in declared.items()}


def _arrays_below(node: Any, path: str, role: Role | None) -> Iterator[Declared]:
    if isinstance(node, np.ndarray):
        yield Declared(path, node, role)
    elif isinstance(node, tuple) and type(node) is not tuple:
        roles = _read_roles(type(node))
        for (name, declared), inner in zip(roles.items(), node, strict=True):
            yield from _arrays_below(inner, f"{path}.{name}" if path else name, declared)


def list_arrays(loop: Any) -> list[Declared]:
    """All arrays of a loop, each once: components may share them, and the first one declares the role."""
    arrays: dict[int, Declared] = {}
    for each in _arrays_below(loop, "", None):
        arrays.setdefault(id(each.array), each)
    return list(arrays.values())


def copy_arrays(source: Any, target: Any) -> None:
    """Copy the arrays of a tuple, and of those in it, into those of another one of its type and shapes."""
    for value, into in zip(source, target, strict=True):
        if isinstance(value, np.ndarray):
            into[...] = value
        elif isinstance(value, tuple):
            copy_arrays(value, into)


class Snapshot:
    """Copies of arrays, to return to."""

    def __init__(self, arrays: Iterable[Any]):
        self.arrays = list(arrays)
        self.copies = [array.copy() for array in self.arrays]

    def restore(self) -> None:
        """Give the arrays the values that they had."""
        for array, held in zip(self.arrays, self.copies, strict=True):
            array[...] = held
