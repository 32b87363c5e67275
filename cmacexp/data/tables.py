"""The files of a run, and its tables: on disk, and their columns as arrays."""

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from cmacexp.data.files import open_file
from cmacexp.data.manifest import require_intact
from cmacexp.errors import BadRun
from cmacexp.typing import Array, DataFrame, Mask

TRACE_FILE, BODY_FILE, MEMORY_FILE = "trace.parquet", "body.parquet", "memory.parquet"
METRICS_FILE, METRICS_CSV, BODY_METRICS_FILE = "metrics.parquet", "metrics.csv", "body_metrics.parquet"
RECORDING_FILE, WEIGHTS = "recording.rrd", "weights.npz"
TABLES = (TRACE_FILE, BODY_FILE, MEMORY_FILE, METRICS_FILE, BODY_METRICS_FILE)
"""Files of a run that views of it are computed from."""


class Scores(NamedTuple):
    """Metrics of every cycle."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def write_scores(folder: Path, scores: Scores, as_csv: bool = True) -> list[str]:
    """Write the metrics of a run, as CSV too unless that is not wanted; the names of the files but for the CSV."""
    write_table(scores.legs, folder / METRICS_FILE)
    names = [METRICS_FILE]
    if as_csv:
        pa_csv.write_csv(scores.legs, folder / METRICS_CSV)
    if scores.body is not None:
        write_table(scores.body, folder / BODY_METRICS_FILE)
        names.append(BODY_METRICS_FILE)
    return names


def arrow(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    """An Arrow array of ``values``; unlike ``pa.array`` without importing pandas, which takes longer than a run."""
    data = np.ascontiguousarray(values, dtype=kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(data), [None, pa.py_buffer(data)])


def arrow_strings(values: list[str]) -> pa.Array:
    """An Arrow array of strings, likewise without pandas."""
    encoded = [value.encode() for value in values]
    offsets = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(values), pa.py_buffer(offsets), pa.py_buffer(b"".join(encoded)))


def table_writer(path: Path, schema: pa.Schema, compression: str = "zstd") -> pq.ParquetWriter:
    """What writes a table as Parquet part by part, a row group each; same parts, same bytes."""
    floats = [field.name for field in schema if pa.types.is_floating(field.type)]
    return pq.ParquetWriter(
        path,
        schema,
        compression=compression,
        use_dictionary=[name for name in schema.names if name not in floats],
        column_encoding=dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    )


def choose_compression(rows: int) -> str:
    """Choose the compression of a table with this number of rows.

    Compressing columns of few values takes longer than all else that writes and reads them.
    """
    return "zstd" if rows > 1000 else "none"


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet; the same table gives the same bytes."""
    with table_writer(path, table.schema, choose_compression(table.num_rows)) as writer:
        writer.write_table(table)


VALUE_BYTES = 8
MOST_UNCHECKED, MOST_EXPANSION = 32 << 20, 100
"""A table may need so many bytes in memory, besides so many times its file."""
IN_THIS_THREAD: Any = {"use_threads": False}
"""How what :func:`open_parquet` gives is read."""


def open_parquet(file: BinaryIO) -> pq.ParquetFile:
    """A Parquet file, of which nothing is read before it is asked for.

    No thread of Arrow's may read it: one that lets go of a file of Python's while Python ends ends the process with
    SIGABRT. So did a fifth of the commands that were refused right after they had read a trace, on a busy machine.
    """
    return pq.ParquetFile(file, pre_buffer=False)


@contextmanager
def _open_parquet(path: Path, texts: bool = False) -> Iterator[pq.ParquetFile]:
    """A table that is as its run wrote it; else all that reads tables raises BadRun.

    Its columns have names of their own, and hold numbers or a few words, else ``texts``.
    """
    try:
        with open_file(require_intact(path)) as file, open_parquet(file) as table:
            check_schema(path, table.schema_arrow, texts)
            _check_size(path, table.metadata, os.fstat(file.fileno()).st_size)
            yield table
    except (OSError, ValueError, pa.ArrowException) as error:
        raise BadRun(f"{path}: cannot be read ({(str(error) or type(error).__name__).splitlines()[0]})") from None


def check_schema(path: Path, schema: pa.Schema, texts: bool) -> None:
    """Check that columns have names of their own, and hold numbers or a few words, else ``texts``; raises BadRun."""
    for field in schema:
        kind, types = field.type, pa.types
        holds_numbers = types.is_integer(kind) or types.is_floating(kind) or types.is_null(kind)
        BadRun.unless(
            len(schema.get_all_field_indices(field.name)) == 1,
            f"{path}: two of its columns are called {field.name}: not a table of a run",
        )
        BadRun.unless(
            texts or holds_numbers or types.is_dictionary(kind),
            f"{path}: its column {field.name} holds {kind}, not numbers: not a table of a run",
        )


def _check_size(path: Path, metadata: pq.FileMetaData, size: int) -> None:
    """Check, before anything is read, that a table of this size in bytes is no bomb; raises BadRun."""
    groups = [metadata.row_group(number) for number in range(metadata.num_row_groups)]
    cells = metadata.num_rows * metadata.num_columns
    needed = max(VALUE_BYTES * cells, sum(group.total_byte_size for group in groups))
    BadRun.unless(
        needed <= MOST_UNCHECKED + MOST_EXPANSION * size,
        f"{path}: {size} bytes that would become {needed} in memory: not a table of a run",
    )


def read_parts(
    path: Path, columns: list[str] | None = None, cycles: Collection[int] | None = None
) -> Iterator[pa.Table]:
    """The table that :func:`table_writer` wrote, or some columns of it, part by part.

    Parts without a row of the ``cycles`` are left out, if these are given.
    """
    with _open_parquet(path) as table:
        for group in range(table.num_row_groups):
            if cycles is None or _is_in(table.read_row_group(group, ["cycle"], **IN_THIS_THREAD), cycles).any():
                yield _validated(table.read_row_group(group, columns, **IN_THIS_THREAD))


def _is_in(table: pa.Table, cycles: Collection[int]) -> Mask:
    """Whether each row is one of these cycles."""
    return np.isin(as_array(table, "cycle"), list(cycles))


def select_rows(table: pa.Table, rows: NDArray[Any]) -> pa.Table:
    """Some rows of a table, by their numbers or by a mask."""
    numbers = np.flatnonzero(rows) if rows.dtype == bool else rows
    return table if len(numbers) == table.num_rows else table.take(arrow(numbers, pa.int64()))


def _validated(table: pa.Table) -> pa.Table:
    """Return a table whose texts and codes of words are valid; raises ArrowInvalid."""
    table.validate(full=True)
    return table


def read_table(path: Path, texts: bool = False, columns: list[str] | None = None) -> pa.Table:
    """Read the table that :func:`write_table` wrote, of numbers, or also of ``texts``; all columns or some."""
    with _open_parquet(path, texts) as table:
        return _validated(table.read(columns, **IN_THIS_THREAD))


def list_units(schema: pa.Schema) -> dict[str, str]:
    """The unit of each column, as its field says; empty where it has none."""
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in schema}


def to_frame(table: pa.Table) -> DataFrame:
    """A table as a DataFrame, whose ``attrs["units"]`` has the unit of each column."""
    frame: DataFrame = table.replace_schema_metadata().to_pandas()  # no file says what its index is
    frame.attrs["units"] = list_units(table.schema)
    return frame


def read_schema(path: Path) -> pa.Schema:
    """The columns of a table, with their units and meanings."""
    with _open_parquet(path, texts=True) as table:
        return table.schema_arrow


def _contiguous(table: pa.Table, name: str) -> pa.Array:
    if (index := table.schema.get_field_index(name)) < 0:  # finds it faster than a list of all names
        raise BadRun(f"{name}: the table lacks this column, as those of other versions do; run it again")
    column = table.column(index)
    return column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()


def as_array(table: pa.Table, name: str) -> Array:
    """One column as a read-only NumPy array; raises BadRun if the table lacks it, or some of its values."""
    column = _contiguous(table, name)
    BadRun.unless(not column.null_count, f"{name}: the table lacks some of its values: not a table of a run")
    return np.asarray(np.from_dlpack(column))


def is_support(table: pa.Table) -> Mask:
    """Whether each row of a trace is planned support."""
    phase = _contiguous(table, "phase")
    codes, names = np.from_dlpack(phase.indices), phase.dictionary.to_pylist()
    return np.asarray(codes == names.index("support")) if "support" in names else np.zeros(len(codes), dtype=bool)
