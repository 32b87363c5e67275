"""Columns of a file, one for each joint: splits arrays (n, J) and lists in cells, and finds names of joints."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.names import JOINT, PATTERNS
from cmacexp.addons.gap.readers import DECLARED, SAID, Columns, is_number

AXES = ("w", "x", "y", "z")
"""Components of a quaternion, which take the place of ``{joint}`` in the names of an orientation."""
NAMING = re.compile(r"(?:.*[^a-z])?(?:joint_?)?names?[^a-z]*", re.IGNORECASE)
"""Names of columns whose text names the joints: ``name``, ``field.name0``, ``joint_names``."""


def split_arrays(columns: Columns) -> dict[str, NDArray[Any]]:
    """Split arrays (n, J) into columns (n,) with a suffix: the joint that the file names, or its number.

    An array (J, n) is turned. Columns that the file counts get the names of joints too. Raises ValueError for an
    orientation that is no quaternion.
    """
    arrays = {name: _read_cells(np.asarray(values)) for name, values in columns.items()}
    numeric = sorted((it for it in arrays.values() if it.ndim in (1, 2) and it.dtype.kind in "fiub"), key=np.ndim)
    rows = max((max(it.shape) for it in numeric if it.ndim == numeric[0].ndim), default=0)
    joints = _find_joints(arrays, rows)
    flat: dict[str, NDArray[Any]] = {}
    for name, values in arrays.items():
        if values.ndim != 2 or values.dtype.kind not in "fiub":
            flat |= {} if name in ("joints", "names") else {name: values}
            continue
        table = values.T if values.shape[1] == rows > values.shape[0] else values
        is_orientation = name in ("quat", "orientation")
        if is_orientation and table.shape[1] > len(AXES):
            raise ValueError(f"{name} has {table.shape[1]} columns, a quaternion {len(AXES)}: {', '.join(AXES)}")
        listed = joints if len(joints) == table.shape[1] else range(table.shape[1])
        prefix, suffixes = ("quat", AXES) if is_orientation else (name, listed)
        flat |= {f"{prefix}_{suffix}": column for suffix, column in zip(suffixes, table.T, strict=False)}
    return _name_counted(flat, joints) | ({"joints": np.array(joints)} if joints else {})


def join_files(tables: Mapping[Path, Columns]) -> dict[str, NDArray[Any]]:
    """Join the columns of several files, each with its ``split_arrays``.

    Of names that occur in several files, or are numbers, the signal in the name of the file comes first, such as
    ``q`` of ``robot_q.csv``, or all of it; columns that are the same in all files are one.
    """
    names = [name for columns in tables.values() for name in columns]
    joined = dict[str, NDArray[Any]]()
    for path, columns in tables.items():
        for name, values in columns.items():
            if name == "notes":
                joined[name] = np.concatenate([joined.get(name, values[:0]), values])
            elif name in (*DECLARED, *SAID) or (names.count(name) == 1 and not name.isdigit()):
                joined[name] = values
            elif not (name in joined and np.array_equal(joined[name], values)):
                is_first = name not in joined and not name.isdigit() and _is_same(tables.values(), name)
                joined[name if is_first else f"{_find_signal(path.stem)}_{name}"] = values
    return joined


def _is_same(tables: Iterable[Columns], name: str) -> bool:
    """Return True if a column is the same in all tables that have it."""
    first, *others = (columns[name] for columns in tables if name in columns)
    return all(np.array_equal(first, values) for values in others)


def _find_signal(stem: str) -> str:
    """Return the name of a file, or the word of it, before which or after which a joint makes a name of PATTERNS."""
    known = {name for patterns in PATTERNS.values() for name in patterns}
    words = [stem, *re.split(r"[^A-Za-z]+", stem)]
    return next((word for word in words if f"{word.lower()}_{JOINT}" in known), stem)


def _read_cells(values: NDArray[Any]) -> NDArray[Any]:
    """Return lists in cells, such as ``[0.1, 0.2]``, as an array (n, J) of numbers or texts; others as they are."""
    if values.dtype.kind not in "OU" or values.ndim != 1 or not values.size or str(values[0])[:1] not in ("[", "("):
        return values
    lists = [re.split(r"[,\s]+", str(cell).strip("[]() \n")) for cell in values]
    if len({len(words) for words in lists}) > 1:
        return values
    texts = np.array([[word.strip("'\"") for word in words] for words in lists])
    return texts.astype(float) if all(map(is_number, texts[0])) else texts


def _find_joints(arrays: Columns, rows: int) -> list[str]:
    """Return the names of joints that a file says: a list, or texts that are the same in all ``rows``."""
    constant = list[str]()
    for name, values in arrays.items():
        if values.dtype.kind not in "OU" or not (name in SAID[:2] or name.isdigit() or NAMING.fullmatch(name)):
            continue
        if values.ndim == 2 and (values == values[0]).all():
            return [str(joint) for joint in values[0]]
        if values.ndim == 1 and (name in SAID[:2] or len(values) < rows):
            return [str(joint).strip() for joint in values]
        if values.ndim == 1 and len(values) == rows and (values == values[0]).all() and not is_number(values[0]):
            constant.append(str(values[0]))
    return constant if len(constant) > 1 else []


def _name_counted(columns: Mapping[str, NDArray[Any]], joints: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return columns in which the names of ``joints`` replace numbers of which there are as many, from 0 or 1 on."""
    groups = dict[str, dict[int, str]]()
    for name in columns:
        if match := re.fullmatch(r"(.*?\D)(\d+)\]?", name):
            groups.setdefault(match[1], {})[int(match[2])] = name
    named = dict[str, str]()
    for prefix, numbered in groups.items():
        if joints and _counts(numbered, len(joints)):
            stem = prefix if prefix[-1] in "_." else f"{prefix.rstrip('[')}_"
            named |= {numbered[k]: f"{stem}{joint}" for k, joint in zip(sorted(numbered), joints, strict=True)}
    return {named.get(name, name): values for name, values in columns.items()}


def _counts(numbers: Iterable[int], count: int) -> bool:
    """Return True if ``numbers`` are all from 0 or 1 on, ``count`` of them."""
    return sorted(numbers) in ([*range(count)], [*range(1, count + 1)])
