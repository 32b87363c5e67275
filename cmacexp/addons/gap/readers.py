"""Readers of logs: Parquet, CSV, NPZ, MAT, HDF5, JSON, and functions of users for other formats.

A reader is a function from a path to columns by name, arrays (n,) or (n, J). Declarations that hold for all rows of a
file, see DECLARED, are columns too, as are SAID.
"""

import json
import re
import runpy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.bags import read_bag, read_mcap
from cmacexp.errors import BadInput, require, require_extra

Columns = Mapping[str, NDArray[Any]]
"""Columns of a log by name."""
Reader = Callable[[Path], Columns]

COMPRESSED = (".gz", ".bz2", ".xz", ".zst")
"""Last suffixes of compressed CSV files."""
DECLARED = ("units", "kp", "kd")
"""Declarations of a file: units in any order, and gains, one for all joints or one for each, separated by commas."""
RUN = re.compile(r"(?:demo|episode|run|traj|trajectory|trial|rollout)_?\d+", re.IGNORECASE)
"""Names of groups that are runs."""
WIDE = 4
"""Columns for each row, of a file without names, above which each of its rows is a signal."""
SAID = ("joints", "names", "notes")
"""What a reader says of a file: the names of joints that its columns count, and notes."""


def split_declarations(texts: Mapping[str, str]) -> Columns:
    """Return the declarations of DECLARED among the ``texts`` of a file by name, split at commas into arrays (n,)."""
    return {name: np.array(texts[name].split(",")) for name in DECLARED if name in texts}


def read_parquet(path: Path) -> Columns:
    """Read the columns of a Parquet file, lists as arrays (n, J), and the declarations in its metadata."""
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    lists = {
        name: np.stack(values)
        for name, values in columns.items()
        if values.dtype == object and isinstance(values[0], np.ndarray | list)
    }
    named = {
        name: {f"{name}_{joint}": values for joint, values in zip(joints, lists[name].T, strict=True)}
        for name, joints in _read_features(path).items()
        if name in lists and lists[name].shape[1:] == (len(joints),)
    }
    columns = {name: values for name, values in (columns | lists).items() if name not in named}
    texts = {key.decode(): text.decode() for key, text in (table.schema.metadata or {}).items()}
    return {
        **columns,
        **{key: it for each in named.values() for key, it in each.items()},
        **split_declarations(texts),
    }


def _read_features(path: Path) -> dict[str, list[str]]:
    """Return the names of joints by column that a LeRobot data set around a file declares in ``meta/info.json``."""
    for file in (folder / "meta" / "info.json" for folder in path.resolve().parents):
        if file.is_file():
            features = json.loads(file.read_text()).get("features", {})
            listed = {name: np.ravel(_unfold(feature.get("names"))) for name, feature in features.items()}
            return {name: [str(joint).removesuffix(".pos") for joint in joints] for name, joints in listed.items()}
    return {}


def _unfold(names: Any) -> Any:
    """Return the list in a dictionary of lists with one key, such as ``motors``, or the names themselves."""
    return next(iter(names.values())) if isinstance(names, dict) and len(names) == 1 else names or []


def read_csv(path: Path) -> Columns:
    """Read the columns of a text file, perhaps compressed; lines ``# NAME: VALUE`` declare units or gains.

    Columns are separated by semicolons, tabs, commas or spaces; beside separators other than commas, numbers may have
    decimal commas. A column without a name, and one whose name has come before, has its number, from 1 on, as name; a
    line of names may begin with ``#``.
    """
    import io

    import pandas

    # pandas opens compressed files; each line is one value
    table = pandas.read_csv(
        path, sep="\0", header=None, engine="python", dtype=str, quoting=3, encoding_errors="replace"
    )
    lines = [line for line in table[0].str.strip() if line]
    comments = [line[1:].partition(":") for line in lines if line.startswith("#")]
    declared = split_declarations({key.strip(): value for key, _, value in comments})
    rows = [line for line in lines if not line.startswith("#")]
    plain = re.sub('"[^"]*"', '""', rows[-1])  # a list in quotes may contain any separator
    separator = next((mark for mark in ";\t," if mark in plain), r"\s+")  # as may a name
    decimal = "," if separator != "," and "," in plain else "."
    names = _split(rows[0], separator)
    if has_numbers := _is_row(names, _split(rows[min(1, len(rows) - 1)], separator), decimal):
        heads = [_split(line[1:].strip(), separator) for line in lines if line.startswith("#")]
        names = next((head for head in heads if len(head) == len(names)), [str(k + 1) for k in range(len(names))])
    repeated = [f"{k + 1} ({name})" for k, name in enumerate(names) if name and names.index(name) < k]
    notes = [f"Columns {', '.join(repeated)} repeat names: they are known by their numbers."] * bool(repeated)
    names = [name if name and names.index(name) == k else str(k + 1) for k, name in enumerate(names)]
    text = io.StringIO("\n".join(rows if has_numbers else rows[1:]))
    frame = pandas.read_csv(text, sep=separator, names=names, decimal=decimal, skipinitialspace=True, index_col=False)
    if has_numbers and len(names) > WIDE * len(frame):
        notes.append(f"The file has {len(names)} columns and {len(frame)} rows: they were exchanged.")
        frame = frame.T.set_axis([str(k + 1) for k in range(len(frame))], axis=1)
        names = list(frame.columns)
    return {**{name: frame[name].to_numpy() for name in names}, **declared, "notes": np.array(notes, dtype=str)}


def _is_row(words: list[str], following: list[str], decimal: str) -> bool:
    """Return True if the ``words`` of a first line are values: numbers, or beside them words of the next line too."""
    numeric = [is_number(word.replace(decimal, ".")) for word in words]
    pairs = zip(words, following, numeric, strict=False)
    return any(numeric) and all(is_value or word == after for word, after, is_value in pairs)


def _split(line: str, separator: str) -> list[str]:
    """Split a line at a separator outside of double quotes, and remove spaces and quotes around its words."""
    return [word.strip().strip("\"'") for word in re.split(f'{separator}(?=(?:[^"]*"[^"]*")*[^"]*$)', line)]


def is_number(value: Any) -> bool:
    """Return True if a value, such as a text, is a number."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def read_npz(path: Path) -> Columns:
    """Read the arrays of an NPZ file; pickled objects are refused."""
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def read_npy(path: Path) -> Columns:
    """Read an array (n, C) as columns that have their numbers, from 1 on, as names."""
    return {str(k + 1): column for k, column in enumerate(np.atleast_2d(np.load(path, allow_pickle=False).T))}


def read_mat(path: Path) -> Columns:
    """Read the arrays of a MAT file of versions 4 to 7.2, those in structures by the names of their fields.

    A timetable or an object is no array; a file of version 7.3 is one of HDF5.
    """
    from scipy.io import loadmat

    if path.read_bytes()[:128].find(b"MATLAB 7.3") >= 0:
        return read_hdf5(path)
    return _unnest({key: value for key, value in loadmat(path, simplify_cells=True).items() if key[:2] != "__"})


def read_hdf5(path: Path) -> Columns:
    """Read the arrays of an HDF5 file, those in groups under ``GROUP_NAME``; of ``demo_3`` and such the longest."""
    require_extra("h5py")
    import h5py

    def read(group: Any) -> dict[str, Any]:
        return {name: read(item) if isinstance(item, h5py.Group) else item[()] for name, item in group.items()}

    with h5py.File(path) as file:
        return _unnest(read(file))


def read_json(path: Path) -> Columns:
    """Read JSON: columns, records, or one record in each line; of several lists in a file the longest counts."""
    text = path.read_text()
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        content = [json.loads(line) for line in text.splitlines() if line.strip()]
    if isinstance(content, dict):
        lists = [value for value in content.values() if isinstance(value, list) and value]
        records = max((value for value in lists if isinstance(value[0], dict)), key=len, default=None)
        content = content if records is None else records
    if isinstance(content, list):
        nested = [_unnest(record) for record in content]
        if len(set(map(_measure, nested))) > 1:  # each record is a run
            return choose_run(nested)
        content = {key: [record.get(key, np.nan) for record in nested] for key in nested[0]}
    return _unnest(content)


def choose_run(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the columns of the longest of several runs, with a note."""
    lengths = [*map(_measure, runs)]
    longest = int(np.argmax(lengths))
    note = f"The file has {len(runs)} runs: the longest is used, number {longest + 1}, {max(lengths)} rows."
    return {**runs[longest], "notes": np.array([note])}


def _measure(columns: Mapping[str, Any]) -> int:
    """Return the length of the longest of the columns, 0 without one."""
    return max((len(value) for value in columns.values() if value.ndim), default=0)


def _unnest(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arrays in nested dictionaries by the names of all levels, joined by ``_``."""
    columns = dict[str, Any]()
    if len(content) > 1 and all(
        RUN.fullmatch(name) and isinstance(value, Mapping) for name, value in content.items()
    ):
        return choose_run([_unnest(run) for run in content.values()])
    for name, value in content.items():
        if len(runs := [run for run in value if isinstance(run, Mapping)] if isinstance(value, list) else []) > 0:
            value = choose_run([_unnest(run) for run in runs])
        inner = _unnest(value) if isinstance(value, Mapping) else None
        columns |= {name: np.asarray(value)} if inner is None else {f"{name}_{key}": it for key, it in inner.items()}
    return columns


READERS: dict[str, Reader] = {
    ".parquet": read_parquet,
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat"), read_csv),
    ".npz": read_npz,
    ".npy": read_npy,
    ".mat": read_mat,
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), read_json),
    ".mcap": read_mcap,
    **dict.fromkeys((".db3", ".bag"), read_bag),
}
"""Readers by suffix of the file."""


def load_reader(spec: str) -> Reader:
    """Load a reader that a user wrote, ``FILE.py:FUNCTION``; raise BadInput if it cannot be loaded."""
    file, _, name = spec.partition(":")
    require(Path(file).is_file(), "--reader", spec, "there is no such file; it must be FILE.py:FUNCTION")
    try:
        reader: Any = runpy.run_path(file).get(name)
    except Exception as error:
        raise BadInput("--reader", spec, f"{file} cannot be run ({type(error).__name__}: {error})") from error
    require(callable(reader), "--reader", spec, f"{file} has no function {name}; it must be FILE.py:FUNCTION")
    return reader  # type: ignore[no-any-return]
