"""Writing the traces of a run while it goes on."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa

from cmacexp.config.schema import RecordConfig
from cmacexp.data.parquet import as_array, select_rows, table_writer
from cmacexp.data.signals import Signal, make_schema
from cmacexp.data.tables import BODY, TRACE, Traces


def _select_rows(table: pa.Table, record: RecordConfig) -> pa.Table:
    """The rows that go into the trace."""
    if not record.thins:
        return table
    selected = as_array(table, "step") % record.every_nth_step == 0
    if record.cycles is not None:
        selected &= np.isin(as_array(table, "cycle"), record.cycles)
    return select_rows(table, selected)


@contextmanager
def trace_writer(
    folder: Path, record: RecordConfig, legs: Sequence[Signal], body: Sequence[Signal] | None
) -> Iterator[Callable[[Traces], None]]:
    """A function that writes the traces of the next cycles; the files appear when the block ends without an error.

    Args:
        folder: of the run.
        record: which rows the traces keep.
        legs: columns of their trace.
        body: likewise; None for a machine without a body.
    """
    columns = {TRACE: legs} if body is None else {TRACE: legs, BODY: body}
    with ExitStack() as stack:
        files = [table_writer(folder / name, make_schema(signals)) for name, signals in columns.items()]
        writers = [stack.enter_context(file) for file in files]

        def write(traces: Traces) -> None:
            for writer, table in zip(writers, traces, strict=False):
                rows = _select_rows(table, record)
                if rows.num_rows:
                    writer.write_table(rows)

        yield write
