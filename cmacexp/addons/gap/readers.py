"""Readers of logs: Parquet, CSV, NPZ and MCAP, and functions of users for other formats.

A reader is a function from a path to columns by name, arrays (n,) or (n, J). Declarations that hold for all rows of a
file, see DECLARED, are columns too.
"""

import runpy
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput, require, require_extra

Columns = Mapping[str, NDArray[Any]]
"""Columns of a log by name."""
Reader = Callable[[Path], Columns]

DECLARED = ("units", "kp", "kd")
"""Declarations of a file: units in any order, and gains, one for all joints or one for each, separated by commas."""


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
        if values.dtype == object and not isinstance(values[0], str)
    }
    texts = {key.decode(): text.decode() for key, text in (table.schema.metadata or {}).items()}
    return {**columns, **lists, **split_declarations(texts)}


def read_csv(path: Path) -> Columns:
    """Read the columns of a CSV file with a line of names; lines ``# NAME: VALUE`` declare units or gains."""
    import pandas

    with path.open(encoding="utf-8", errors="replace") as file:
        lines = file.readlines()
    head = next((line for line in lines if not line.startswith("#")), "")
    frame = pandas.read_csv(path, comment="#", sep=max(",;\t", key=head.count), skipinitialspace=True)
    comments = [line[1:].partition(":") for line in lines if line.startswith("#")]
    declared = split_declarations({key.strip(): value for key, _, value in comments})
    return {**{str(name).strip(): frame[name].to_numpy() for name in frame}, **declared}


def read_npz(path: Path) -> Columns:
    """Read the arrays of an NPZ file; pickled objects are refused."""
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def read_mcap(path: Path) -> Columns:
    """Read the numbers in the JSON messages of an MCAP file, as columns ``TOPIC_FIELD``.

    Rows are the messages of the most frequent topic; other topics are held from one message to the next.
    """
    import json

    require_extra("mcap")
    from mcap.reader import make_reader

    topics = defaultdict[str, list[tuple[float, dict[str, Any]]]](list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                topics[channel.topic.strip("/")].append((message.log_time * 1e-9, json.loads(message.data)))
    if not topics:
        raise ValueError("it holds no JSON messages; write a reader for its encoding")
    columns: dict[str, NDArray[Any]] = {"time": np.array([at for at, _ in max(topics.values(), key=len)])}
    for topic, messages in topics.items():
        last = np.searchsorted([at for at, _ in messages], columns["time"], side="right") - 1
        numbers = [name for name, value in messages[0][1].items() if isinstance(value, int | float | list)]
        columns |= {f"{topic}_{name}": np.array([messages[max(k, 0)][1][name] for k in last]) for name in numbers}
    return columns


READERS: dict[str, Reader] = {".parquet": read_parquet, ".csv": read_csv, ".npz": read_npz, ".mcap": read_mcap}
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
