"""The tables of a run on disk: names, reading, writing, of traces while the run goes on."""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from cmacexp.config.schema import RecordConfig
from cmacexp.data.hashes import was_written
from cmacexp.data.parquet import as_array, read_parts, select_rows, table_writer, write_table
from cmacexp.data.signals import BODY_SIGNALS, LEG_SIGNALS, Signal, make_schema, select_signals
from cmacexp.errors import BadRun

TRACE_FILE, BODY_FILE, MEMORY_FILE = "trace.parquet", "body.parquet", "memory.parquet"
METRICS_FILE, METRICS_CSV, BODY_METRICS_FILE = "metrics.parquet", "metrics.csv", "body_metrics.parquet"
RECORDING_FILE = "recording.rrd"
ALL_CYCLES = (1, 2**31 - 1)
LAST_STEPS = 100
"""Steps before the end of a run that did not complete, which a thinned trace keeps too: they show what went wrong."""


class Traces(NamedTuple):
    """Tables of the steps of a run, or of some cycles."""

    legs: pa.Table
    """One row per step and leg."""
    body: pa.Table | None
    """One row per step; None without a body."""
    memory: pa.Table | None = None
    """One row per cycle and leg; None without weights."""


class Scores(NamedTuple):
    """Metrics of every cycle."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def steps_by_cycle(folder: Path) -> dict[int, int]:
    """Number of steps of each cycle in the trace of a run; raises BadRun if that is not as it was written."""
    steps: dict[int, int] = {}
    for part in read_parts(folder / TRACE_FILE, ["cycle", "leg"]):
        cycles, counts = np.unique(as_array(part, "cycle")[as_array(part, "leg") == 1], return_counts=True)
        for cycle, count in zip(cycles.tolist(), counts.tolist(), strict=True):
            steps[cycle] = steps.get(cycle, 0) + count
    return steps


def _read(path: Path, columns: Sequence[Signal], cycles: tuple[int, int], every: int) -> pa.Table:
    """A window of a trace, one step in ``every``; read part by part, so that only the window is in memory."""
    kept: list[pa.Table] = []
    steps = 0
    for part in read_parts(path):
        missing = {column.name for column in columns} - set(part.column_names)
        if missing:
            raise BadRun(f"{path}: not a trace: it has no {', '.join(sorted(missing))}")
        cycle = as_array(part, "cycle")
        part = select_rows(part, (cycle >= cycles[0]) & (cycle <= cycles[1]))
        legs = int(as_array(part, "leg").max(initial=1)) if "leg" in part.column_names else 1
        kept.append(select_rows(part, (np.arange(part.num_rows) // legs + steps) % every == 0))
        steps += part.num_rows // legs
    return pa.concat_tables(kept).combine_chunks() if kept else make_schema(columns).empty_table()


def read_traces(folder: Path, cycles: tuple[int, int] = ALL_CYCLES, every: int = 1) -> Traces:
    """The traces of a run, of cycles from the first to the last, one step in ``every``; raises BadRun."""
    legs = _read(folder / TRACE_FILE, select_signals(LEG_SIGNALS), cycles, every)
    walks = was_written(folder / BODY_FILE)
    return Traces(legs, _read(folder / BODY_FILE, select_signals(BODY_SIGNALS), cycles, every) if walks else None)


def write_scores(folder: Path, scores: Scores, as_csv: bool = True) -> list[str]:
    """Write the metrics of a run, as CSV too unless that is not wanted; the names of the files."""
    write_table(scores.legs, folder / METRICS_FILE)
    names = [METRICS_FILE]
    if as_csv:
        pa_csv.write_csv(scores.legs, folder / METRICS_CSV)
        names.append(METRICS_CSV)
    if scores.body is not None:
        write_table(scores.body, folder / BODY_METRICS_FILE)
        names.append(BODY_METRICS_FILE)
    return names


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
    """Writes the traces of a run, of legs and body, some cycles at a time."""

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
    """A writer of the traces of legs and of a body, if there is one; the files can be read when the block has ended.

    Without ``record.trace`` nothing is written.
    """
    columns = {TRACE_FILE: legs, BODY_FILE: body} if record.trace else {}
    with ExitStack() as stack:
        files = [table_writer(folder / name, make_schema(own)) for name, own in columns.items() if own is not None]
        yield TraceWriter([stack.enter_context(file) for file in files], record)
