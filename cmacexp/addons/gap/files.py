"""A log in several files, each with other columns: they are joined under the signals in the names of the files."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.arrays import TIME
from cmacexp.addons.gap.names import JOINT, PATTERNS
from cmacexp.addons.gap.readers import DECLARED, SAID, Columns

APART = 0.02
"""Largest distance of first, and of last, times of files of one log, relative to all of its time."""


def join_files(tables: Mapping[Path, Columns]) -> dict[str, NDArray[Any]]:
    """Join the columns of several files, each with its ``split_arrays``.

    Of names that occur in several files, or are numbers, the signal in the name of the file comes first, such as
    ``q`` of ``robot_q.csv``, or all of it; columns that are the same in all files are one. Files with times of their
    own are read at those of the first one.
    """
    tables = _align(_name_clocks(tables))
    names = [name for columns in tables.values() for name in columns]
    signals = {path: _find_signal(path.stem) for path in tables}
    if len(set(signals.values())) < len(signals):
        signals = {path: path.stem for path in tables}
    joined = dict[str, NDArray[Any]]()
    for path, columns in tables.items():
        for name, values in columns.items():
            if name == "notes":
                joined[name] = np.concatenate([joined.get(name, values[:0]), values])
            elif name in (*DECLARED, *SAID) or (names.count(name) == 1 and not name.isdigit()):
                joined[name] = values
            elif not (name in joined and np.array_equal(joined[name], values)):
                is_first = name not in joined and not name.isdigit() and _is_same(tables.values(), name)
                joined[name if is_first else f"{signals[path]}_{name}"] = values
    return joined


def _name_clocks(tables: Mapping[Path, Columns]) -> Mapping[Path, Columns]:
    """Return tables without names of columns with ``time`` for the first columns, if all grow alike in each row.

    The only column of a file that is called so is one, too.
    """
    listed = [[name for name in columns if name not in (*DECLARED, *SAID)] for columns in tables.values()]
    for path, names in zip(tables, listed, strict=True):
        if names == ["1"] and path.stem.lower() in PATTERNS["time"]:
            return {**tables, path: {("time" if name == "1" else name): it for name, it in tables[path].items()}}
    if not all(names and all(map(str.isdigit, names)) for names in listed):
        return tables
    clocks = [columns[names[0]] for columns, names in zip(tables.values(), listed, strict=True)]
    grow = all(clock.dtype.kind in "iuf" and len(clock) > 1 and (np.diff(clock) > 0.0).all() for clock in clocks)
    ends = np.array([[clock[0], clock[-1]] for clock in clocks], dtype=float)
    if not grow or (np.ptp(ends, axis=0) > APART * np.ptp(ends)).any():
        return tables
    return {
        path: {("time" if name == names[0] else name): values for name, values in columns.items()}
        for (path, columns), names in zip(tables.items(), listed, strict=True)
    }


def _align(tables: Mapping[Path, Columns]) -> Mapping[Path, Columns]:
    """Return tables with the rows of the first one while all of them last, if they have other times."""
    first, *others = tables.values()
    clock = next(
        (name for name in first if TIME.fullmatch(name) and all(name in columns for columns in others)), None
    )
    if clock is None or all(np.array_equal(first[clock], columns[clock]) for columns in others):
        return tables
    time = first[clock]
    begin, end = (pick([columns[clock][k] for columns in tables.values()]) for pick, k in ((max, 0), (min, -1)))
    kept = (time >= begin) & (time <= end)
    aligned = dict[Path, dict[str, NDArray[Any]]]()
    for path, columns in tables.items():
        rows = np.searchsorted(columns[clock], time[kept], side="right") - 1
        size = len(columns[clock])
        aligned[path] = {name: values[rows] if len(values) == size else values for name, values in columns.items()}
        aligned[path][clock] = time[kept]
    said = (
        f"The files have times of their own: rows are those of the first one, {kept.sum()} of {len(time)}, and "
        "others are held."
    )
    path = next(iter(tables))
    aligned[path] = {**aligned[path], "notes": np.append(aligned[path].get("notes", np.zeros(0, dtype=str)), said)}
    return aligned


def _is_same(tables: Iterable[Columns], name: str) -> bool:
    """Return True if a column is the same in all tables that have it."""
    first, *others = (columns[name] for columns in tables if name in columns)
    return all(np.array_equal(first, values) for values in others)


def _find_signal(stem: str) -> str:
    """Return the most words of the name of a file that, before a joint, make a name of PATTERNS; else all of it."""
    known = {name for patterns in PATTERNS.values() for name in patterns}
    words = [word for word in re.split(r"[^A-Za-z]+", stem) if word]
    parts = ["_".join(words[i:k]) for i in range(len(words)) for k in range(i + 1, len(words) + 1)]
    parts.sort(key=len, reverse=True)
    return next((part for part in [stem, *parts] if f"{part.lower()}_{JOINT}" in known), stem)
