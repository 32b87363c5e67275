"""The steps of a stored run for other programs: as one table of plain columns, and as MCAP.

The table has a row for each step, for PlotJuggler, MATLAB, Julia and spreadsheets. MCAP has a topic for each leg and
one for the body, with a message of JSON for each step.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.data.files import write_atomically
from cmacexp.data.run import Run
from cmacexp.data.tables import arrow
from cmacexp.data.trace import Trace, stream_trace
from cmacexp.errors import BadRun, require_extra
from cmacexp.typing import Array

WIDE, MCAP = "wide.parquet", "run.mcap"
IN_MESSAGES = ("step", "cycle")
"""Shared columns that each message has; the time is that of the message."""
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
    legs = {
        **{name: _describe(trace.table, name) for name in trace.names if name not in LEFT_OUT},
        SUPPORT: Field("", "planned phase: 1 support, 0 transfer", pa.int32()),
    }
    groups = {f"leg{number}": legs for number in range(1, trace.legs + 1)}
    if trace.body is not None:
        groups["body"] = {n: _describe(trace.body.table, n) for n in trace.body.names if n not in LEFT_OUT}
    return shared, groups


def _is_plain(trace: Trace) -> bool:
    """Whether a trace has the shared columns, and numbers alone but for the phase."""
    types = {name: kind for name, kind in zip(trace.names, trace.table.schema.types, strict=True) if name != "phase"}
    plain = all(pa.types.is_floating(kind) or pa.types.is_integer(kind) for kind in types.values())
    return plain and {*SHARED} <= types.keys()


def read_steps(run: Run) -> Iterator[tuple[dict[str, Array], dict[str, dict[str, Array]]]]:
    """All steps that the trace kept, in order and only a part of them in memory at a time; raises BadRun.

    Of each part the columns (steps,) of :data:`SHARED`, and those of ``leg1`` to ``leg4`` and ``body``.
    """
    for trace in stream_trace(run.folder):
        signals: dict[str, Array] = {
            **{name: trace[name] for name in trace.names if name not in LEFT_OUT},
            SUPPORT: trace.support.astype(np.int32),
        }
        groups = {
            f"leg{leg + 1}": {name: values[:, leg] for name, values in signals.items()} for leg in range(trace.legs)
        }
        if trace.body is not None:
            groups["body"] = {name: trace.body[name] for name in trace.body.names if name not in LEFT_OUT}
        yield {name: trace.shared(name) for name in SHARED}, groups


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
        for steps, columns_of in read_steps(run):
            columns = steps | {
                f"{group}.{name}": each for group, own in columns_of.items() for name, each in own.items()
            }
            arrays = [arrow(np.asarray(columns[field.name]), field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
    return path


def _make_schema(fields: dict[str, Field]) -> bytes:
    """JSON Schema of the messages of a topic; a number that is not finite is null, since JSON has no other."""
    properties = {
        name: {
            "type": ["number", "null"] if np.issubdtype(field.type.to_pandas_dtype(), np.floating) else "integer",
            "description": f"{field.meaning}, {field.unit}".rstrip(", "),
            "unit": field.unit,
        }
        for name, field in fields.items()
    }
    return json.dumps({"type": "object", "properties": properties}).encode()


def _write_values(values: Array) -> list[Any]:
    """Values whose text is their JSON."""
    found: list[Any] = values.tolist()
    return found if np.isfinite(values).all() else ["null" if value - value != 0 else value for value in found]


def _write_messages(columns: dict[str, Array]) -> Iterator[bytes]:
    """The message of each step. A template is filled for each of them, several times as fast as ``json.dumps``."""
    keys = (json.dumps(name).replace("%", "%%") for name in columns)
    template = f"{{{','.join(f'{key}:%s' for key in keys)}}}"
    return ((template % row).encode() for row in zip(*map(_write_values, columns.values()), strict=True))


def write_mcap(run: Run, folder: Path) -> Path:
    """Write ``run.mcap``, with the extra ``mcap``: topics ``/leg1`` and so on, ``/body``; raises BadRun.

    Log times are in ns, from the start of the run; the manifest of the run is a record of metadata.
    """
    require_extra("mcap")
    from mcap.writer import Writer

    shared, groups = describe_fields(run)
    path = folder / MCAP
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(library="cmacexp")
        writer.add_metadata("cmacexp", {"manifest": json.dumps(run.manifest)})
        channels = {}
        for name, fields in groups.items():
            schema = _make_schema({key: shared[key] for key in IN_MESSAGES} | fields)
            channels[name] = writer.register_channel(
                f"/{name}", "json", writer.register_schema(f"cmacexp.{name}", "jsonschema", schema)
            )
        for steps, columns_of in read_steps(run):
            common = {key: steps[key] for key in IN_MESSAGES}
            times = np.rint(steps["time"] * 1e9).astype(np.int64).tolist()
            topics = [_write_messages(common | columns_of[name]) for name in groups]
            for time, *messages in zip(times, *topics, strict=True):
                for channel, message in zip(channels.values(), messages, strict=True):
                    writer.add_message(channel, time, message, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
