"""A run as MCAP: a topic for each leg and one for the body, a message of JSON for each step."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.data.files import write_atomically
from cmacexp.data.run import Run
from cmacexp.errors import require_extra
from cmacexp.export.steps import Field, describe_fields, read_steps
from cmacexp.typing import Array

MCAP = "run.mcap"
NANOSECONDS = 1e9
IN_MESSAGES = ("step", "cycle")
"""Shared columns that each message has; the time is that of the message."""


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
        for part in read_steps(run):
            common = {key: part.shared[key] for key in IN_MESSAGES}
            times = np.rint(part.shared["time"] * NANOSECONDS).astype(np.int64).tolist()
            topics = [_write_messages(common | part.groups[name]) for name in groups]
            for time, *messages in zip(times, *topics, strict=True):
                for channel, message in zip(channels.values(), messages, strict=True):
                    writer.add_message(channel, time, message, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
