"""Traces: the signals of a run at each step, as arrays by name, from the loop or from Parquet files."""

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.config.machine import LEG_NAMES
from cmacexp.config.schema import RecordConfig
from cmacexp.data.manifest import was_written
from cmacexp.data.signals import Signal, make_schema
from cmacexp.data.tables import (
    BODY_FILE,
    MEMORY_FILE,
    TRACE_FILE,
    as_array,
    is_support,
    list_units,
    read_parts,
    read_table,
    select_rows,
    table_writer,
)
from cmacexp.errors import BadRun
from cmacexp.typing import Array, Mask

LAST_STEPS = 100
"""Number of last steps that a thinned trace keeps of a run that did not complete, to show why."""
THIRD_AXIS = "z"
"""Signal that only traces of legs that move in space have, those of a robot."""


@dataclass(frozen=True)
class Trace:
    """Signals of some steps of a run, as arrays by name: ``trace["force"]`` is (steps, legs).

    Signals of the body and of the memory are in separate traces: ``trace.body["height"]`` is (steps,), and
    ``trace.memory["weight_norm"]`` (cycles, legs). Names and units are those of :mod:`cmacexp.data.signals`.
    Arrays are read-only views of the columns of a table, whose rows are in the order of steps, then of legs.
    """

    table: pa.Table
    """Table with one row per step and leg; for a body one per step, for memory one per cycle and leg."""
    body: "Trace | None" = None
    """Signals of the body; None without a body."""
    memory: "Trace | None" = None
    """Signals of the network memory at the end of each cycle; None if nothing learns."""

    @cached_property
    def legs(self) -> int:
        """Number of legs; 0 for a body; raises BadRun if the legs have different numbers of rows."""
        if "leg" not in self.table.column_names:
            return 0
        legs = int(as_array(self.table, "leg").max(initial=1))
        if not 1 <= legs <= len(LEG_NAMES) or self.table.num_rows % legs:
            raise BadRun(f"a table of {self.table.num_rows} rows, one of leg {legs}: not a table of a run")
        return legs

    @property
    def steps(self) -> int:
        """Number of steps; for memory, number of cycles."""
        return int(self.table.num_rows) // max(self.legs, 1)

    @property
    def names(self) -> list[str]:
        """Names of the signals, in column order."""
        return list(self.table.column_names)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each signal, those of the body included; empty for a signal without a unit."""
        return list_units(self.table.schema) | ({} if self.body is None else self.body.units)

    @property
    def axes(self) -> str:
        """Axes along which a foot moves: ``xyz`` for a robot, else ``xy``; a leg has as many joints."""
        return "xyz" if THIRD_AXIS in self.names else "xy"

    def __getitem__(self, name: str) -> Array:
        """Return a signal, (steps, legs), or (steps,) of a body; raises BadRun if the trace lacks it."""
        values = as_array(self.table, name)
        return values.reshape(-1, self.legs) if self.legs else values

    @cached_property
    def support(self) -> Mask:
        """True where the planned phase of a leg is support, (steps, legs)."""
        return is_support(self.table).reshape(-1, self.legs)

    def stack_joints(self, name: str) -> Array:
        """Stack the signals of all joints: (steps, legs, joints).

        ``name`` contains {} for the number of the joint, e.g. ``tau_feedback_{}``.
        """
        return np.stack([self[name.format(joint + 1)] for joint in range(len(self.axes))], axis=2)

    def shared(self, name: str) -> Array:
        """Return a signal that is equal for all legs and the body, such as ``time``: (steps,)."""
        values = self[name]
        return values[:, 0] if self.legs else values

    def select(self, steps: Mask | slice) -> "Trace":
        """Select ``steps`` of the legs and of the body; the new trace has no memory."""
        rows = np.arange(self.table.num_rows).reshape(self.steps, -1)[steps].ravel()
        return Trace(select_rows(self.table, rows), None if self.body is None else self.body.select(steps))


def concat_traces(traces: Sequence[Trace]) -> Trace:
    """Concatenate the traces of consecutive parts of a run, at least one; the new trace has no memory."""
    bodies = [trace.body.table for trace in traces if trace.body is not None]
    table = pa.concat_tables([trace.table for trace in traces]).combine_chunks()
    return Trace(table, Trace(pa.concat_tables(bodies).combine_chunks()) if bodies else None)


def count_steps_by_cycle(folder: Path) -> dict[int, int]:
    """Count the steps of each cycle in the stored trace of a run; raises BadRun if the trace has changed."""
    steps: dict[int, int] = {}
    for table in read_parts(folder / TRACE_FILE, ["cycle", "leg"]):
        cycles, counts = np.unique(Trace(table).shared("cycle"), return_counts=True)
        for cycle, count in zip(cycles.tolist(), counts.tolist(), strict=True):
            steps[cycle] = steps.get(cycle, 0) + count
    return steps


def _check(path: Path, trace: Trace) -> Trace:
    """Return ``trace``; raises BadRun unless it has a row for each step and leg, ordered by step, then leg."""
    in_order = trace.legs and (trace["leg"] == np.arange(1, trace.legs + 1)).all()
    if in_order and np.isfinite(trace["time"]).all():
        return trace
    raise BadRun(f"{path}: not a trace: it must have a row for each step and leg, in their order, with its time")


def stream_trace(folder: Path, cycles: Collection[int] | None = None) -> Iterator[Trace]:
    """Yield the trace of a run in parts, each of some cycles, so that a long run needs little memory.

    With ``cycles`` only the steps of these cycles. The traces have no signals of the memory. Raises BadRun.
    """
    names = [TRACE_FILE, BODY_FILE] if was_written(folder / BODY_FILE) else [TRACE_FILE]
    for tables in zip_longest(*(read_parts(folder / name, cycles=cycles) for name in names)):
        if any(table is None for table in tables):
            raise BadRun(f"{folder}: {' and '.join(names)} have not the same steps")
        trace, *body = map(Trace, tables)
        trace = Trace(_check(folder / TRACE_FILE, trace).table, *body)
        if body and not np.array_equal(body[0]["step"], trace.shared("step")):
            raise BadRun(f"{folder}: {' and '.join(names)} have not the same steps")
        if cycles is not None:
            trace = trace.select(np.isin(trace.shared("cycle"), list(cycles)))
        yield trace


def read_trace(folder: Path, cycles: Collection[int] | None = None, every: int = 1) -> Trace:
    """Read the trace of a run: only the steps of ``cycles``, if not None, and of these one in ``every``.

    It is read in parts, so that only the selected steps are in memory. Raises BadRun.
    """
    selected: list[Trace] = []
    steps = 0
    for trace in stream_trace(folder, cycles):
        selected.append(trace.select((np.arange(trace.steps) + steps) % every == 0))
        steps += trace.steps
    if not selected:
        raise BadRun(f"{folder / TRACE_FILE}: holds no step")
    return concat_traces(selected)


def read_memory(folder: Path) -> Trace | None:
    """Read the signals of the network memory at the end of each cycle; None without them. Raises BadRun."""
    return Trace(read_table(folder / MEMORY_FILE)) if was_written(folder / MEMORY_FILE) else None


class TraceWriter:
    """Writer of the traces of legs and body of a run, some cycles at a time."""

    def __init__(self, writers: Sequence[pq.ParquetWriter], record: RecordConfig):
        self._writers = writers
        self._record = record
        self._held: deque[Trace] = deque()

    def write(self, trace: Trace) -> None:
        """Write the trace of the next cycles; if traces are thinned, the last steps are held back."""
        if not self._record.thins:
            self._put(trace)
        elif trace.steps:
            self._held.append(trace)
            end = self._end
            while len(self._held) > 1 and end - self._held[1].shared("step")[0] >= LAST_STEPS:
                self._put_selected(self._held.popleft())

    def finish(self, completed: bool) -> None:
        """Write the steps held back; if the run did not complete, all of its last :data:`LAST_STEPS`."""
        last = None if completed or not self._held else self._end - LAST_STEPS
        while self._held:
            self._put_selected(self._held.popleft(), last)

    @property
    def _end(self) -> int:
        """Number of steps up to the end of the traces held back."""
        return int(self._held[-1].shared("step")[-1]) + 1

    def _put_selected(self, trace: Trace, last: int | None = None) -> None:
        """Write the steps of a thinned trace, and all steps from ``last`` on if it is not None."""
        step = trace.shared("step")
        selected = step % self._record.every_nth_step == 0
        if self._record.cycles is not None:
            selected &= np.isin(trace.shared("cycle"), self._record.cycles)
        if last is not None:
            selected |= step >= last
        if selected.any():
            self._put(trace.select(selected))

    def _put(self, trace: Trace) -> None:
        for writer, written in zip(self._writers, (trace, trace.body), strict=False):
            if written is not None and written.steps:
                writer.write_table(written.table)


@contextmanager
def trace_writer(
    folder: Path, record: RecordConfig, legs: Sequence[Signal], body: Sequence[Signal] | None
) -> Iterator[TraceWriter]:
    """Yield a writer of the traces of legs and body; the files can be read after the block.

    Args:
        folder: Folder of the files.
        record: Which steps are written; without ``record.trace`` none.
        legs: Signals of the legs.
        body: Signals of the body; None without a body.
    """
    tables = {TRACE_FILE: legs, BODY_FILE: body} if record.trace else {}
    with ExitStack() as stack:
        files = [
            table_writer(folder / name, make_schema(signals))
            for name, signals in tables.items()
            if signals is not None
        ]
        yield TraceWriter([stack.enter_context(file) for file in files], record)
