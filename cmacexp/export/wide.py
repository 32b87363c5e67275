"""A run as one table of plain columns, a row for each step: for PlotJuggler, MATLAB, Julia and spreadsheets."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.data.files import write_atomically
from cmacexp.data.parquet import arrow
from cmacexp.data.run import Run
from cmacexp.export.steps import describe_fields, read_steps

WIDE = "wide.parquet"


def write_wide(run: Run, folder: Path) -> Path:
    """Write ``wide.parquet``: ``time``, ``step``, ``cycle``, ``leg1.force``, ``body.height``, ...; raises BadRun.

    Numbers are float64 or int32; ``support`` is 1 in planned support and 0 in transfer. Compressed by Snappy, which
    every reader of Parquet knows.
    """
    shared, groups = describe_fields(run)
    fields = shared | {f"{group}.{name}": field for group, own in groups.items() for name, field in own.items()}
    schema = pa.schema(  # plain types alone, without dictionaries and nested types
        pa.field(name, field.type, nullable=False, metadata={"unit": field.unit, "meaning": field.meaning})
        for name, field in fields.items()
    )
    path = folder / WIDE
    folder.mkdir(parents=True, exist_ok=True)
    with (
        write_atomically(path) as temporary,
        pq.ParquetWriter(temporary, schema, compression="snappy", use_dictionary=False) as writer,
    ):
        for part in read_steps(run):
            columns = part.shared | {
                f"{group}.{name}": values for group, own in part.groups.items() for name, values in own.items()
            }
            arrays = [arrow(np.asarray(columns[field.name]), field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
    return path
