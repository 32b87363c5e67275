"""The arrays of a loop, by the role that their components declare in :mod:`cmacexp.typing`, and copies of them."""

from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from cmacexp.typing import Role


class Declared(NamedTuple):
    """An array of the loop as its component declares it."""

    name: str
    """Fields on the path to it."""
    array: Any
    role: Role | None
    """None: the loop does not change it."""


@cache
def _read_roles(kind: Any) -> dict[str, Role | None]:
    """Declared roles of the fields of a tuple, by name."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: getattr(hints[name], "__metadata__", (None,))[0] for name in kind._fields}


def _arrays_below(node: Any, path: str, role: Role | None) -> Iterator[Declared]:
    if isinstance(node, np.ndarray):
        yield Declared(path, node, role)
    elif hasattr(node, "_fields"):
        roles = _read_roles(type(node))  # type: ignore[arg-type]  # any class is hashable
        for (name, declared), inner in zip(roles.items(), node, strict=True):
            yield from _arrays_below(inner, f"{path}.{name}" if path else name, declared)


def list_arrays(loop: Any) -> list[Declared]:
    """All arrays of a loop, each once: components may share them, and the first one declares the role."""
    arrays: dict[int, Declared] = {}
    for each in _arrays_below(loop, "", None):
        arrays.setdefault(id(each.array), each)
    return list(arrays.values())


class Snapshot:
    """Copies of arrays, to return to."""

    def __init__(self, arrays: Iterable[Any]):
        self.arrays = list(arrays)
        self.copies = [array.copy() for array in self.arrays]

    def restore(self) -> None:
        """Give the arrays the values that they had."""
        for array, held in zip(self.arrays, self.copies, strict=True):
            array[...] = held
