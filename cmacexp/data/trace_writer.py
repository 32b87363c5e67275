"""Writing the traces of a run while it goes on, and keeping what has been written when the disk is full."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa

from cmacexp.config.schema import RecordConfig
from cmacexp.data.files import allocate
from cmacexp.data.parquet import as_array, select_rows, table_writer
from cmacexp.data.signals import Signal, make_schema
from cmacexp.data.tables import BODY, METRICS, TRACE, Traces

SPARE = ".spare"
"""A file that only takes the space which the files that follow will need."""


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
) -> Iterator[Callable[[Traces, int], None]]:
    """A function that writes the traces of the next cycles; the files appear when the block ends without an error.

    It takes the traces, and the bytes to keep free until the block ends for the files that follow. If there is no
    room for all that, it writes nothing and raises ``DiskFull``; what has been written before stays whole.

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
        spare = folder / SPARE
        stack.callback(spare.unlink, missing_ok=True)

        def write(traces: Traces, needed: int) -> None:
            parts = [(w, _select_rows(table, record)) for w, table in zip(writers, traces, strict=False)]
            parts = [(writer, rows) for writer, rows in parts if rows.num_rows]
            for writer, rows in parts:
                writer.reserve(rows)
            allocate(spare, needed, folder / METRICS)
            for writer, rows in parts:
                writer.write_table(rows)

        yield write
