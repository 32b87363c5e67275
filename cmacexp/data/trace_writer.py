"""Writing the traces of a run while it goes on."""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.config.schema import RecordConfig
from cmacexp.data.parquet import as_array, select_rows, table_writer
from cmacexp.data.signals import Signal, make_schema
from cmacexp.data.tables import BODY, TRACE, Traces

LAST_STEPS = 100
"""Steps before the end of a run that did not complete, which a thinned trace keeps too: they show what went wrong."""


def _select_rows(table: pa.Table, record: RecordConfig, last: int | None) -> pa.Table:
    """The rows that go into the trace; all from step ``last`` on, if there is one."""
    if not record.thins:
        return table
    step = as_array(table, "step")
    selected = step % record.every_nth_step == 0
    if record.cycles is not None:
        selected &= np.isin(as_array(table, "cycle"), record.cycles)
    if last is not None:
        selected |= step >= last
    return select_rows(table, selected)


class TraceWriter:
    """Writes the traces of a run, of some cycles at a time.

    Args:
        writers: of the legs, and of the body if there is one.
        record: which rows the traces keep.
    """

    def __init__(self, writers: Sequence[pq.ParquetWriter], record: RecordConfig):
        self._writers, self._record = writers, record
        self._held: deque[Traces] = deque()

    def write(self, traces: Traces) -> None:
        """Write the traces of the next cycles; a thinned trace holds back those of the last steps."""
        if not self._record.thins:
            self._put(traces)
        elif traces.legs.num_rows:
            self._held.append(traces)
            end = self._end
            while len(self._held) > 1 and end - as_array(self._held[1].legs, "step")[0] >= LAST_STEPS:
                self._put(self._held.popleft())

    def finish(self, completed: bool) -> None:
        """Write what was held back: of a run that did not complete, every one of its last steps."""
        last = None if completed or not self._held else self._end - LAST_STEPS
        while self._held:
            self._put(self._held.popleft(), last)

    @property
    def _end(self) -> int:
        """The step after the last one held."""
        return int(as_array(self._held[-1].legs, "step")[-1]) + 1

    def _put(self, traces: Traces, last: int | None = None) -> None:
        for writer, table in zip(self._writers, traces, strict=False):
            rows = _select_rows(table, self._record, last)
            if rows.num_rows:
                writer.write_table(rows)


@contextmanager
def trace_writer(
    folder: Path, record: RecordConfig, legs: Sequence[Signal], body: Sequence[Signal] | None
) -> Iterator[TraceWriter]:
    """A writer of the traces; the files can be read when the block has ended.

    Args:
        folder: of the run.
        record: which rows the traces keep; without traces nothing is written.
        legs: columns of their trace.
        body: likewise; None for a machine without a body.
    """
    columns = {TRACE: legs, BODY: body} if record.trace else {}
    with ExitStack() as stack:
        files = [table_writer(folder / name, make_schema(own)) for name, own in columns.items() if own is not None]
        yield TraceWriter([stack.enter_context(file) for file in files], record)
