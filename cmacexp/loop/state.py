"""Arrays of a loop with their roles, which components declare by :mod:`cmacexp.typing`; copies and snapshots."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

from cmacexp.typing import Role


class Declared(NamedTuple):
    """An array of the loop with its declaration."""

    name: str
    """Path of field names, joined by dots."""
    array: Any
    role: Role | None
    """Role in the loop; None if the loop does not change the array."""


def _read_roles(kind: Any) -> dict[str, Role | None]:
    """Return the declared roles of the fields of a NamedTuple class, by name."""
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
    """List all arrays of a loop without duplicates.

    Components may share arrays; the first component that has an array declares its role.
    """
    arrays: dict[int, Declared] = {}
    for declared in _arrays_below(loop, "", None):
        arrays.setdefault(id(declared.array), declared)
    return list(arrays.values())


def copy_arrays(source: Any, target: Any) -> None:
    """Copy all arrays of a nested tuple into those of another one with the same types and shapes."""
    for value, into in zip(source, target, strict=True):
        if isinstance(value, np.ndarray):
            into[...] = value
        elif isinstance(value, tuple):
            copy_arrays(value, into)


class Snapshot:
    """Saved values of arrays, which can be restored."""

    def __init__(self, arrays: Iterable[Any]):
        self.arrays = list(arrays)
        self.copies = [array.copy() for array in self.arrays]

    def restore(self) -> None:
        """Restore the saved values of the arrays."""
        for array, held in zip(self.arrays, self.copies, strict=True):
            array[...] = held
