"""The steps of a stored run as plain columns: of each leg, and of the body."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.data.run import Run
from cmacexp.data.trace import Trace, stream_trace
from cmacexp.errors import BadRun
from cmacexp.typing import Array

SHARED = ("time", "step", "cycle")
"""Columns that all legs and the body have in common."""
SUPPORT = "support"
"""In place of ``phase``, as a number, which every program reads."""
LEFT_OUT = (*SHARED, "leg", "phase")
"""Signals that are no column of a leg or the body."""


class Field(NamedTuple):
    """What describes a column."""

    unit: str
    meaning: str
    type: pa.DataType


class StepChunk(NamedTuple):
    """Some steps of a run, in order."""

    shared: dict[str, Array]
    """Columns (steps,) of :data:`SHARED`."""
    groups: dict[str, dict[str, Array]]
    """Columns (steps,) of ``leg1`` to ``leg4`` and ``body``."""


def _describe(table: pa.Table, name: str) -> Field:
    field = table.schema.field(name)
    words = {key: (field.metadata or {}).get(key, b"").decode() for key in (b"unit", b"meaning")}
    return Field(words[b"unit"], words[b"meaning"], pa.float64() if pa.types.is_floating(field.type) else pa.int32())


def describe_fields(run: Run) -> tuple[dict[str, Field], dict[str, dict[str, Field]]]:
    """What :func:`read_steps` gives, with units: shared columns, and those of each group; raises BadRun."""
    trace = next((part for part in stream_trace(run.folder) if part.steps), None)
    if trace is None or not all(map(_is_plain, filter(None, (trace, trace.body)))):
        raise BadRun(f"{run.folder}: its trace holds no step of a run, or other columns than a run writes")
    shared = {name: _describe(trace.table, name) for name in SHARED}
    legs = {name: _describe(trace.table, name) for name in trace.names if name not in LEFT_OUT}
    legs[SUPPORT] = Field("", "planned phase: 1 support, 0 transfer", pa.int32())
    groups = {f"leg{number}": legs for number in range(1, trace.legs + 1)}
    if trace.body is not None:
        groups["body"] = {n: _describe(trace.body.table, n) for n in trace.body.names if n not in LEFT_OUT}
    return shared, groups


def _is_plain(trace: Trace) -> bool:
    """Whether a trace has the shared columns, and numbers alone but for the phase."""
    types = {name: kind for name, kind in zip(trace.names, trace.table.schema.types, strict=True) if name != "phase"}
    plain = all(pa.types.is_floating(kind) or pa.types.is_integer(kind) for kind in types.values())
    return plain and {*SHARED} <= types.keys()


def read_steps(run: Run) -> Iterator[StepChunk]:
    """All steps that the trace kept, only a part of them in memory at a time; raises BadRun."""
    for trace in stream_trace(run.folder):
        signals: dict[str, Array] = {name: trace[name] for name in trace.names if name not in LEFT_OUT}
        signals[SUPPORT] = trace.support.astype(np.int32)
        groups = {
            f"leg{leg + 1}": {name: values[:, leg] for name, values in signals.items()} for leg in range(trace.legs)
        }
        if trace.body is not None:
            groups["body"] = {name: trace.body[name] for name in trace.body.names if name not in LEFT_OUT}
        yield StepChunk({name: trace.shared(name) for name in SHARED}, groups)
