"""Columns of a file, one for each joint: splits arrays (n, J) and lists in cells, and finds names of joints."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.readers import SAID, Columns, is_number

AXES = ("w", "x", "y", "z")
"""Components of a quaternion, which take the place of ``{joint}`` in the names of an orientation."""
ROW_OF = re.compile(r"(?:joint|motor)(?:[ _]?(?:idx|index|id|name|number|no))?", re.IGNORECASE)
"""Names of a column that says of which joint each row is."""
TIME = re.compile(r".*(?:time|stamp).*|t", re.IGNORECASE)
"""Names of columns that rows of one time share."""
NAMING = re.compile(r"(?:.*[^a-z])?(?:joint_?)?names?[^a-z]*", re.IGNORECASE)
"""Names of columns whose text names the joints: ``name``, ``field.name0``, ``joint_names``."""


def split_arrays(columns: Columns) -> dict[str, NDArray[Any]]:
    """Split arrays (n, J) into columns (n,) with a suffix: the joint that the file names, or its number.

    An array (J, n) is turned. Columns that the file counts get the names of joints too. Raises ValueError for an
    orientation that is no quaternion.
    """
    arrays = _spread_rows({name: _read_cells(np.asarray(values)) for name, values in columns.items()})
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


def _spread_rows(columns: Columns) -> Columns:
    """Return columns with a row for each time, if each row is one joint, which a column *joint* names or numbers."""
    name = next((name for name in columns if ROW_OF.fullmatch(name)), None)
    if name is None or columns[name].ndim != 1:
        return columns
    joints = list(dict.fromkeys(columns[name].tolist()))
    count, rows = len(joints), len(columns[name])
    if not 1 < count < rows or (columns[name] != np.resize(columns[name][:count], rows)).any():
        return columns
    whole = rows // count * count
    spread = dict[str, NDArray[Any]]()
    for key, values in columns.items():
        if values.shape[:1] != (rows,) or key == name:
            spread |= {} if key == name else {key: values}
        elif TIME.fullmatch(key):
            spread[key] = values[:whole:count]
        else:
            spread |= {f"{key}_{joint}": values[k:whole:count] for k, joint in enumerate(joints)}
    return spread


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
