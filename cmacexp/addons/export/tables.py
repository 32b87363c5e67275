"""The steps of a stored run for other programs: as one wide table, and as MCAP.

The table has one row per step, for PlotJuggler, MATLAB, Julia and spreadsheets. MCAP has one topic per leg and one
for the body, with one JSON message per step.
"""

import json
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.data.files import write_atomically
from cmacexp.data.folder import OUT_KEY
from cmacexp.data.own_files import require_own_file
from cmacexp.data.run import Run
from cmacexp.data.tables import arrow, as_array, select_rows
from cmacexp.data.trace import Trace, stream_trace
from cmacexp.errors import BadRun, require_extra
from cmacexp.typing import Array

WIDE = "wide.parquet"
MCAP = "run.mcap"
SHARED = ["time", "step", "cycle"]
"""Columns common to all legs and the body."""
SUPPORT = pa.field("support", pa.int32(), metadata={"unit": "", "meaning": "planned phase: 1 support, 0 transfer"})
"""Column that replaces the text column ``phase`` by a number, which every program reads."""
Groups = dict[str, pa.Table]
"""Tables with one row per step, by name: ``leg1`` to ``leg4`` and ``body``."""


def _make_plain(table: pa.Table) -> pa.Table:
    """Select :data:`SHARED` and the other numeric columns, as float64 or int32; raises KeyError, ArrowException."""
    numbers = table.select([*SHARED, *(name for name in table.column_names if name not in (*SHARED, "leg", "phase"))])
    fields = [
        pa.field(field.name, pa.float64() if pa.types.is_floating(field.type) else pa.int32(), False, field.metadata)
        for field in numbers.schema
    ]
    return numbers.cast(pa.schema(fields))


def _split(trace: Trace) -> Groups:
    """Split a trace into one table per leg and one for the body; raises as :func:`_make_plain`."""
    support = arrow(trace.support.ravel(), SUPPORT.type)
    legs = _make_plain(trace.table.append_column(SUPPORT, support))
    rows = np.arange(legs.num_rows).reshape(-1, trace.legs).T
    groups = {f"leg{number}": select_rows(legs, leg_rows) for number, leg_rows in enumerate(rows, 1)}
    return groups if trace.body is None else groups | {"body": _make_plain(trace.body.table)}


def read_steps(run: Run) -> Iterator[Groups]:
    """Yield all steps of a trace in chunks, so that few are in memory; raises BadRun if it is empty or malformed."""
    steps = 0
    try:
        for trace in stream_trace(run.folder):
            steps += trace.steps
            yield _split(trace)
    except (pa.ArrowException, KeyError) as error:
        raise BadRun(f"{run.folder}: its trace has other columns than a run writes ({error})") from None
    BadRun.unless(steps, f"{run.folder}: its trace holds no step")


def _join(groups: Groups) -> pa.Table:
    """Join tables side by side: :data:`SHARED` once, then ``leg1.force``, ``body.height``, ..."""
    joined = groups["leg1"].select(SHARED)
    for group, table in groups.items():
        signals = table.drop_columns(SHARED)
        for field, column in zip(signals.schema, signals.columns, strict=True):
            joined = joined.append_column(field.with_name(f"{group}.{field.name}"), column)
    return joined


def write_wide(run: Run, folder: Path) -> Path:
    """Write ``wide.parquet`` into ``folder`` and return its path; raises BadRun.

    Columns: ``time``, ``step``, ``cycle``, ``leg1.force``, ``body.height``, ... as float64 or int32; ``support`` is 1
    in planned support and 0 in transfer. Compressed by Snappy, which every reader of Parquet supports.
    """
    chunks = read_steps(run)
    first = next(chunks)
    path = folder / WIDE
    require_own_file(path, b"leg1.force", OUT_KEY)
    folder.mkdir(parents=True, exist_ok=True)
    with (
        write_atomically(path) as temporary,
        pq.ParquetWriter(temporary, _join(first).schema, compression="snappy", use_dictionary=False) as writer,
    ):
        for groups in chain([first], chunks):
            writer.write_table(_join(groups))
    return path


def _describe(field: pa.Field) -> dict[str, Any]:
    """Return the JSON Schema of a column; floats may be null, since JSON has no number that is not finite."""
    unit, meaning = ((field.metadata or {}).get(key, b"").decode() for key in (b"unit", b"meaning"))
    kind = ["number", "null"] if pa.types.is_floating(field.type) else "integer"
    return {"type": kind, "description": f"{meaning}, {unit}".rstrip(", "), "unit": unit}


def _write_values(values: Array) -> list[Any]:
    """Convert values to a list whose items print as JSON; values that are not finite become ``null``."""
    numbers: list[Any] = values.tolist()
    return numbers if np.isfinite(values).all() else ["null" if value - value != 0 else value for value in numbers]


def _write_messages(table: pa.Table) -> Iterator[bytes]:
    """Format each row of a table as a JSON message, by a template: several times faster than ``json.dumps``."""
    keys = (json.dumps(name).replace("%", "%%") for name in table.column_names)
    columns = [_write_values(as_array(table, name)) for name in table.column_names]
    template = f"{{{','.join(f'{key}:%s' for key in keys)}}}"
    return ((template % row).encode() for row in zip(*columns, strict=True))


def write_mcap(run: Run, folder: Path) -> Path:
    """Write ``run.mcap`` into ``folder`` and return its path; needs the extra ``mcap``, raises BadRun.

    Topics are ``/leg1`` and so on, and ``/body``. Log times are in ns from the start of the run; the manifest of the
    run is a metadata record.
    """
    require_extra("mcap")
    from mcap.writer import Writer

    chunks = read_steps(run)
    first = next(chunks)
    path = folder / MCAP
    require_own_file(path, b"cmacexp", OUT_KEY)
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(library="cmacexp")
        writer.add_metadata("cmacexp", {"manifest": json.dumps(run.manifest)})
        channels = []
        for name, table in first.items():
            properties = {field.name: _describe(field) for field in table.drop_columns("time").schema}
            content = json.dumps({"type": "object", "properties": properties}).encode()
            schema = writer.register_schema(f"cmacexp.{name}", "jsonschema", content)
            channels.append(writer.register_channel(f"/{name}", "json", schema))
        for groups in chain([first], chunks):
            times = np.rint(as_array(groups["leg1"], "time") * 1e9).astype(np.int64).tolist()
            topics = [_write_messages(table.drop_columns("time")) for table in groups.values()]
            for time, *messages in zip(times, *topics, strict=True):
                for channel, message in zip(channels, messages, strict=True):
                    writer.add_message(channel, time, message, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
