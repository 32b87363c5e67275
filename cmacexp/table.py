"""Tables on disk, and their columns as arrays."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.arrays import Array, Mask
from cmacexp.files import write_atomically


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet, whole or not at all; the same table gives the same bytes."""
    floats = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    with write_atomically(path) as temporary:
        pq.write_table(
            table,
            temporary,
            compression="zstd",
            use_dictionary=[name for name in table.column_names if name not in floats],
            column_encoding=dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
        )


def read_table(path: Path) -> pa.Table:
    """The table that :func:`write_table` wrote."""
    return pq.read_table(path)


def as_array(table: pa.Table, name: str) -> Array:
    """One column as a NumPy array."""
    values: Array = table.column(name).to_numpy()
    return values


def is_support(table: pa.Table) -> Mask:
    """Whether each row of a trace is planned support."""
    phase = table.column("phase").combine_chunks()
    codes, names = phase.indices.to_numpy(), phase.dictionary.to_pylist()
    return np.asarray(codes == names.index("support")) if "support" in names else np.zeros(len(codes), dtype=bool)
