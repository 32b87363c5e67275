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
def _read_hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _arrays_below(node: Any, path: str, role: Role | None) -> Iterator[Declared]:
    if isinstance(node, np.ndarray):
        yield Declared(path, node, role)
    elif hasattr(node, "_fields"):
        hints = _read_hints(type(node))  # type: ignore[arg-type]  # any class is hashable
        for name, inner in zip(node._fields, node, strict=True):
            declared = getattr(hints[name], "__metadata__", (None,))[0]
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
