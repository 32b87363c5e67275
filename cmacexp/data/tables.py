"""File names of a run, reading and writing of its tables, and access to their columns as arrays."""

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
RECORDING_FILE = "recording.rrd"
WEIGHTS = "weights.npz"
TABLES = (TRACE_FILE, BODY_FILE, MEMORY_FILE, METRICS_FILE, BODY_METRICS_FILE)
"""Files from which all views of a run are computed."""


class Scores(NamedTuple):
    """Metrics of all cycles of a run."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def write_scores(folder: Path, scores: Scores, as_csv: bool = True) -> list[str]:
    """Write the metrics of a run to ``folder``; returns the names of the Parquet files.

    With ``as_csv`` the metrics of the legs are also written to :data:`METRICS_CSV`.
    """
    write_table(scores.legs, folder / METRICS_FILE)
    names = [METRICS_FILE]
    if as_csv:
        pa_csv.write_csv(scores.legs, folder / METRICS_CSV)
    if scores.body is not None:
        write_table(scores.body, folder / BODY_METRICS_FILE)
        names.append(BODY_METRICS_FILE)
    return names


def arrow(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    """Make an Arrow array of ``values``, (n,), of type ``kind``.

    Unlike ``pa.array`` this does not import pandas, which takes longer than a run.
    """
    data = np.ascontiguousarray(values, dtype=kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(data), [None, pa.py_buffer(data)])


def arrow_strings(values: list[str]) -> pa.Array:
    """Make an Arrow array of strings, without importing pandas as :func:`arrow`."""
    encoded = [value.encode() for value in values]
    offsets = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(values), pa.py_buffer(offsets), pa.py_buffer(b"".join(encoded)))


def table_writer(path: Path, schema: pa.Schema, compression: str = "zstd") -> pq.ParquetWriter:
    """Open a Parquet file to which a table is written in parts, each a row group; equal parts give equal bytes."""
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

    Compressing short columns takes longer than writing and reading them.
    """
    return "zstd" if rows > 1000 else "none"


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet; equal tables give equal bytes."""
    with table_writer(path, table.schema, choose_compression(table.num_rows)) as writer:
        writer.write_table(table)


VALUE_BYTES = 8
"""Size of a value in memory, B."""
MOST_UNCHECKED = 32 << 20
"""Memory that any table may need, B."""
MOST_EXPANSION = 100
"""Memory that a table may need in addition, over the size of its file."""
IN_THIS_THREAD: Any = {"use_threads": False}
"""Arguments with which files of :func:`open_parquet` must be read."""


def open_parquet(file: BinaryIO) -> pq.ParquetFile:
    """Open a Parquet file whose columns are read on demand.

    No thread of Arrow may read it, see :data:`IN_THIS_THREAD`: if such a thread releases a file of Python while
    Python exits, the process ends with SIGABRT. On a busy machine this happened to a fifth of the commands that ended
    with an error right after they had read a trace.
    """
    return pq.ParquetFile(file, pre_buffer=False)


@contextmanager
def _open_parquet(path: Path, texts: bool = False) -> Iterator[pq.ParquetFile]:
    """Open a table of a run, checked as by :func:`check_schema` and unchanged since it was written.

    Raises BadRun, also for errors of the block that reads it.
    """
    try:
        with open_file(require_intact(path)) as file, open_parquet(file) as table:
            check_schema(path, table.schema_arrow, texts)
            _check_size(path, table.metadata, os.fstat(file.fileno()).st_size)
            yield table
    except (OSError, ValueError, pa.ArrowException) as error:
        raise BadRun(f"{path}: cannot be read ({(str(error) or type(error).__name__).splitlines()[0]})") from None


def check_schema(path: Path, schema: pa.Schema, texts: bool) -> None:
    """Check the columns of the table in the file ``path``.

    Column names must be unique, and columns contain numbers or coded words; with ``texts`` any type is allowed.
    Raises BadRun.
    """
    for field in schema:
        kind = field.type
        holds_numbers = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)
        BadRun.unless(
            len(schema.get_all_field_indices(field.name)) == 1,
            f"{path}: two of its columns are called {field.name}: not a table of a run",
        )
        BadRun.unless(
            texts or holds_numbers or pa.types.is_dictionary(kind),
            f"{path}: its column {field.name} holds {kind}, not numbers: not a table of a run",
        )


def _check_size(path: Path, metadata: pq.FileMetaData, size: int) -> None:
    """Check, before a table is read, that it does not expand to an excessive size in memory; raises BadRun.

    ``size`` is that of its file, B.
    """
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
    """Yield the parts of a table that :func:`table_writer` wrote; raises BadRun.

    With ``columns`` only these columns are read, with ``cycles`` only parts that contain a row of these cycles.
    """
    with _open_parquet(path) as table:
        for group in range(table.num_row_groups):
            if cycles is None or _is_in(table.read_row_group(group, ["cycle"], **IN_THIS_THREAD), cycles).any():
                yield _validated(table.read_row_group(group, columns, **IN_THIS_THREAD))


def _is_in(table: pa.Table, cycles: Collection[int]) -> Mask:
    """Check for each row whether it belongs to one of ``cycles``."""
    return np.isin(as_array(table, "cycle"), list(cycles))


def select_rows(table: pa.Table, rows: NDArray[Any]) -> pa.Table:
    """Select rows of a table, by their indices or by a mask over all rows."""
    numbers = np.flatnonzero(rows) if rows.dtype == bool else rows
    return table if len(numbers) == table.num_rows else table.take(arrow(numbers, pa.int64()))


def _validated(table: pa.Table) -> pa.Table:
    """Return ``table`` if its texts and word codes are valid; raises ArrowInvalid."""
    table.validate(full=True)
    return table


def read_table(path: Path, texts: bool = False, columns: list[str] | None = None) -> pa.Table:
    """Read a table, with ``columns`` only these columns; ``texts`` as in :func:`check_schema`. Raises BadRun."""
    with _open_parquet(path, texts) as table:
        return _validated(table.read(columns, **IN_THIS_THREAD))


def list_units(schema: pa.Schema) -> dict[str, str]:
    """List the unit of each column, from the metadata of its field; empty for a column without a unit."""
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in schema}


def to_frame(table: pa.Table) -> DataFrame:
    """Convert a table to a DataFrame with the unit of each column in ``attrs["units"]``."""
    frame: DataFrame = table.replace_schema_metadata().to_pandas()  # so that metadata in the file cannot set an index
    frame.attrs["units"] = list_units(table.schema)
    return frame


def read_schema(path: Path) -> pa.Schema:
    """Read the schema of a table, with unit and meaning of each column; raises BadRun."""
    with _open_parquet(path, texts=True) as table:
        return table.schema_arrow


def _contiguous(table: pa.Table, name: str) -> pa.Array:
    if (index := table.schema.get_field_index(name)) < 0:  # faster than a search in the list of names
        raise BadRun(f"{name}: the table lacks this column, as those of other versions do; run it again")
    column = table.column(index)
    return column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()


def as_array(table: pa.Table, name: str) -> Array:
    """Return a column as a read-only NumPy array (rows,); raises BadRun if the column or a value is missing."""
    column = _contiguous(table, name)
    BadRun.unless(not column.null_count, f"{name}: the table lacks some of its values: not a table of a run")
    return np.asarray(np.from_dlpack(column))


def is_support(table: pa.Table) -> Mask:
    """Check for each row of a trace whether its planned phase is support; (rows,)."""
    phase = _contiguous(table, "phase")
    codes = np.from_dlpack(phase.indices)
    names = phase.dictionary.to_pylist()
    return np.asarray(codes == names.index("support")) if "support" in names else np.zeros(len(codes), dtype=bool)
