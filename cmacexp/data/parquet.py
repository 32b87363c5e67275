"""Tables on disk, and their columns as arrays."""

import os
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from cmacexp.data.files import allocate, write_atomically
from cmacexp.data.hashes import require_intact
from cmacexp.typing import Array, Mask

HEADER_BYTES, COLUMN_BYTES, FOOTER_BYTES = 4096, 1024, 256
"""More than Parquet needs besides the values: once, and for each column of a part, beside it and in the footer."""


def arrow(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    """An Arrow array of ``values``; unlike ``pa.array`` without importing pandas, which takes longer than a run."""
    data = np.ascontiguousarray(values, dtype=kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(data), [None, pa.py_buffer(data)])


def arrow_strings(values: list[str]) -> pa.Array:
    """An Arrow array of strings, likewise without pandas."""
    encoded = [value.encode() for value in values]
    offsets = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(values), pa.py_buffer(offsets), pa.py_buffer(b"".join(encoded)))


class TableWriter:
    """A table that is being written as Parquet, a row group at a time; same parts, same bytes.

    Args:
        path: of the file at the end.
        temporary: its path while it is written.
        schema: of the table.
    """

    def __init__(self, path: Path, temporary: Path, schema: pa.Schema):
        floats = [field.name for field in schema if pa.types.is_floating(field.type)]
        self._path, self._temporary, self._columns = path, temporary, len(schema)
        self._groups = self._reserved = 0
        self._header = HEADER_BYTES + 2 * schema.serialize().size  # the footer repeats the schema as text
        self._sink = pa.OSFile(str(temporary), "wb")
        self._writer = pq.ParquetWriter(
            self._sink,
            schema,
            compression="zstd",
            use_dictionary=[name for name in schema.names if name not in floats],
            column_encoding=dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
        )

    def reserve(self, parts: Sequence[pa.Table]) -> None:
        """Take the space for more parts and for the footer, so that none can fail for want of it.

        Raises:
            DiskFull: there is no room; the message names the file.
        """
        footer = self._header + FOOTER_BYTES * self._columns * (self._groups + len(parts))
        columns = [column for part in parts for column in part.columns]
        values = sum(column.nbytes * (1 if column.type == pa.float64() else 2) for column in columns)
        needed = self._sink.tell() + values + values // 64 + COLUMN_BYTES * len(columns) + footer
        allocate(self._temporary, needed, self._path)
        self._reserved = max(self._reserved, needed)

    def write_table(self, part: pa.Table) -> None:
        """Write a part."""
        self._writer.write_table(part)
        self._groups += 1

    def close(self) -> None:
        """Write the footer, and give back what was reserved beyond it."""
        self._writer.close()
        size = self._sink.tell()
        self._sink.close()
        if self._reserved > size:
            os.truncate(self._temporary, size)


@contextmanager
def table_writer(path: Path, schema: pa.Schema) -> Iterator[TableWriter]:
    """Write a table as Parquet part by part, a row group each, whole or not at all; same parts, same bytes."""
    with write_atomically(path) as temporary, closing(TableWriter(path, temporary, schema)) as writer:
        yield writer


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet, whole or not at all; the same table gives the same bytes."""
    with table_writer(path, table.schema) as writer:
        writer.write_table(table)


def read_groups(path: Path, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The table that :func:`table_writer` wrote, or some columns of it, part by part.

    Raises:
        BadRun: it is not as its run wrote it; so for all that reads tables.
    """
    with pq.ParquetFile(require_intact(path)) as file:
        for group in range(file.num_row_groups):
            yield file.read_row_group(group, columns)


def select_rows(table: pa.Table, rows: NDArray[Any]) -> pa.Table:
    """Some rows of a table, by their numbers or by a mask."""
    numbers = np.flatnonzero(rows) if rows.dtype == bool else rows
    return table if len(numbers) == table.num_rows else table.take(arrow(numbers, pa.int64()))


def read_table(path: Path) -> pa.Table:
    """The table that :func:`write_table` wrote."""
    with pq.ParquetFile(require_intact(path)) as file:
        return file.read()


def read_cycles(path: Path, numbers: Sequence[int]) -> pa.Table:
    """Rows of some cycles of a table; the others are never all in memory."""
    return pq.read_table(require_intact(path), filters=[("cycle", "in", list(numbers))])


def _contiguous(table: pa.Table, name: str) -> pa.Array:
    column = table.column(name)
    return column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()


def as_array(table: pa.Table, name: str) -> Array:
    """One column without nulls as a read-only NumPy array."""
    values: Array = np.asarray(np.from_dlpack(_contiguous(table, name)))
    return values


def is_support(table: pa.Table) -> Mask:
    """Whether each row of a trace is planned support."""
    phase = _contiguous(table, "phase")
    codes, names = np.from_dlpack(phase.indices), phase.dictionary.to_pylist()
    return np.asarray(codes == names.index("support")) if "support" in names else np.zeros(len(codes), dtype=bool)
