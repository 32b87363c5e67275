"""The signals of a run, step by step: arrays by name, on a table from the loop or from Parquet."""

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
"""Steps before the end of a run that did not complete, which a thinned trace keeps too: they show what went wrong."""
THIRD_AXIS = "z"
"""A signal that a trace has if its legs move in space: those of a robot."""


@dataclass(frozen=True)
class Trace:
    """Signals of some steps of a run, as arrays by name: ``trace["force"]`` is (steps, legs).

    The body and the memory are traces of their own: ``trace.body["height"]`` is (steps,), and
    ``trace.memory["weight_norm"]`` (cycles, legs). Names and units are those of :mod:`cmacexp.data.signals`.
    Arrays are read-only views of the columns of a table, whose rows are in the order of steps, then of legs.
    """

    table: pa.Table
    """One row per step and leg; of a body one per step, of memory one per cycle and leg."""
    body: "Trace | None" = None
    """None without a body."""
    memory: "Trace | None" = None
    """Signals of the memory at the end of each cycle; None without weights."""

    @cached_property
    def legs(self) -> int:
        """Number of legs; 0 of a body; raises BadRun if not all of them have equally many rows."""
        if "leg" not in self.table.column_names:
            return 0
        legs = int(as_array(self.table, "leg").max(initial=1))
        if not 1 <= legs <= len(LEG_NAMES) or self.table.num_rows % legs:
            raise BadRun(f"a table of {self.table.num_rows} rows, one of leg {legs}: not a table of a run")
        return legs

    @property
    def steps(self) -> int:
        """Number of steps; of memory, of cycles."""
        return int(self.table.num_rows) // max(self.legs, 1)

    @property
    def names(self) -> list[str]:
        """Names of the signals, in the order of their columns."""
        return list(self.table.column_names)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each signal, of the body too; empty where it has none."""
        return list_units(self.table.schema) | ({} if self.body is None else self.body.units)

    @property
    def axes(self) -> str:
        """Those in which a foot moves: x and y and, of a robot, z; a leg has as many joints."""
        return "xyz" if THIRD_AXIS in self.names else "xy"

    def __getitem__(self, name: str) -> Array:
        """A signal, (steps, legs) or of a body (steps,); raises BadRun if the trace lacks it."""
        values = as_array(self.table, name)
        return values.reshape(-1, self.legs) if self.legs else values

    @cached_property
    def support(self) -> Mask:
        """Whether each leg is planned to support, (steps, legs)."""
        return is_support(self.table).reshape(-1, self.legs)

    def stack_joints(self, name: str) -> Array:
        """Signals of all joints side by side, (steps, legs, joints); ``name`` has {} where their numbers are."""
        return np.stack([self[name.format(joint + 1)] for joint in range(len(self.axes))], axis=2)

    def shared(self, name: str) -> Array:
        """A signal that all legs and the body have in common, such as ``time``: (steps,)."""
        values = self[name]
        return values[:, 0] if self.legs else values

    def select(self, steps: Mask | slice) -> "Trace":
        """Some of its steps, with those of the body; the memory is left out."""
        rows = np.arange(self.table.num_rows).reshape(self.steps, -1)[steps].ravel()
        return Trace(select_rows(self.table, rows), None if self.body is None else self.body.select(steps))


def concat_traces(traces: Sequence[Trace]) -> Trace:
    """Parts of a run one after the other, of which there must be one; the memory is left out."""
    bodies = [trace.body.table for trace in traces if trace.body is not None]
    table = pa.concat_tables([trace.table for trace in traces]).combine_chunks()
    return Trace(table, Trace(pa.concat_tables(bodies).combine_chunks()) if bodies else None)


def count_steps_by_cycle(folder: Path) -> dict[int, int]:
    """Number of steps of each cycle in the trace of a run; raises BadRun if that is not as it was written."""
    steps: dict[int, int] = {}
    for part in read_parts(folder / TRACE_FILE, ["cycle", "leg"]):
        cycles, counts = np.unique(Trace(part).shared("cycle"), return_counts=True)
        for cycle, count in zip(cycles.tolist(), counts.tolist(), strict=True):
            steps[cycle] = steps.get(cycle, 0) + count
    return steps


def _check(path: Path, trace: Trace) -> Trace:
    """Raise BadRun unless a table has a row for each step and leg, in their order."""
    in_order = trace.legs and (trace["leg"] == np.arange(1, trace.legs + 1)).all()
    if in_order and np.isfinite(trace["time"]).all():
        return trace
    raise BadRun(f"{path}: not a trace: it must have a row for each step and leg, in their order, with its time")


def stream_trace(folder: Path, cycles: Collection[int] | None = None) -> Iterator[Trace]:
    """The trace of a run part by part, without its memory; of all cycles, or of some. Raises BadRun.

    A long run is never wholly in memory: a part is what was written at once, some cycles.
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
    """The trace of a run, of all cycles or of some, one step in ``every``; raises BadRun.

    It is read part by part, so that only the steps that are kept are in memory.
    """
    kept: list[Trace] = []
    steps = 0
    for part in stream_trace(folder, cycles):
        kept.append(part.select((np.arange(part.steps) + steps) % every == 0))
        steps += part.steps
    if not kept:
        raise BadRun(f"{folder / TRACE_FILE}: holds no step")
    return concat_traces(kept)


def read_memory(folder: Path) -> Trace | None:
    """The memory of the networks at the end of each cycle; None if the run has none. Raises BadRun."""
    return Trace(read_table(folder / MEMORY_FILE)) if was_written(folder / MEMORY_FILE) else None


class TraceWriter:
    """Writes the trace of a run, of legs and body, some cycles at a time."""

    def __init__(self, writers: Sequence[pq.ParquetWriter], record: RecordConfig):
        self._writers, self._record = writers, record
        self._held: deque[Trace] = deque()

    def write(self, trace: Trace) -> None:
        """Write the next cycles; a thinned trace holds back the last steps."""
        if not self._record.thins:
            self._put(trace)
        elif trace.steps:
            self._held.append(trace)
            end = self._end
            while len(self._held) > 1 and end - self._held[1].shared("step")[0] >= LAST_STEPS:
                self._put_selected(self._held.popleft())

    def finish(self, completed: bool) -> None:
        """Write what was held back: of a run that did not complete, every one of its last steps."""
        last = None if completed or not self._held else self._end - LAST_STEPS
        while self._held:
            self._put_selected(self._held.popleft(), last)

    @property
    def _end(self) -> int:
        """The step after the last one held."""
        return int(self._held[-1].shared("step")[-1]) + 1

    def _put_selected(self, trace: Trace, last: int | None = None) -> None:
        """Write the steps that go into a thinned trace; all from step ``last`` on, if there is one."""
        step = trace.shared("step")
        selected = step % self._record.every_nth_step == 0
        if self._record.cycles is not None:
            selected &= np.isin(trace.shared("cycle"), self._record.cycles)
        if last is not None:
            selected |= step >= last
        if selected.any():
            self._put(trace.select(selected))

    def _put(self, trace: Trace) -> None:
        for writer, own in zip(self._writers, (trace, trace.body), strict=False):
            if own is not None and own.steps:
                writer.write_table(own.table)


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
