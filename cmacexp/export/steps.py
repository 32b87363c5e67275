"""The steps of a stored run as plain columns: of each leg, and of the body."""

from collections.abc import Iterator
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.data.parquet import as_array, is_support, read_parts, select_rows
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY_FILE, TRACE_FILE
from cmacexp.errors import BadRun
from cmacexp.typing import Array

SHARED = ("time", "step", "cycle")
"""Columns that all legs and the body have in common."""
SUPPORT = "support"
"""In place of ``phase``, as a number, which every program reads."""


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


def describe_fields(run: StoredRun) -> tuple[dict[str, Field], dict[str, dict[str, Field]]]:
    """What :func:`read_steps` gives, with units: shared columns, and those of each group; raises BadRun."""
    shared, groups = {}, {}
    for path, legs in _list_tables(run):
        table = next(read_parts(run.folder / path), None)
        if table is None or not _is_plain(table, legs):
            raise BadRun(f"{run.folder / path}: holds no step of a run, or other columns than a run writes")
        fields = {name: _describe(table, name) for name in table.column_names if name not in ("leg", "phase")}
        if legs:
            fields[SUPPORT] = Field("", "planned phase: 1 support, 0 transfer", pa.int32())
            numbers = np.unique(as_array(table, "leg")).tolist()
            shared = {name: fields[name] for name in SHARED}
        for name in [f"leg{number}" for number in numbers] if legs else ["body"]:
            groups[name] = {key: field for key, field in fields.items() if key not in SHARED}
    return shared, groups


def _is_plain(table: pa.Table, legs: bool) -> bool:
    """Whether a table has steps, and numbers alone but for the phase."""
    types = dict(zip(table.column_names, table.schema.types, strict=True))
    phase = not legs or pa.types.is_dictionary(types.pop("phase", pa.null()))
    plain = all(pa.types.is_floating(kind) or pa.types.is_integer(kind) for kind in types.values())
    return bool(table.num_rows) and phase and plain and {*SHARED, *(["leg"] if legs else [])} <= types.keys()


def _list_tables(run: StoredRun) -> list[tuple[str, bool]]:
    """Names of the tables of steps, and whether they have a row for each leg."""
    return [(TRACE_FILE, True), *([(BODY_FILE, False)] if BODY_FILE in run.manifest["files"] else [])]


def read_steps(run: StoredRun) -> Iterator[StepChunk]:
    """All steps that the trace kept, only a part of them in memory at a time; raises BadRun."""
    tables = _list_tables(run)
    names: set[str] = set()
    for parts in zip_longest(*(read_parts(run.folder / name) for name, _ in tables)):
        shared: dict[str, Array] = {}
        groups: dict[str, dict[str, Array]] = {}
        for table, (_, legs) in zip(parts, tables, strict=True):
            for group, rows in _split(table, legs) if table is not None else ():
                columns = {key: as_array(rows, key) for key in rows.column_names if key not in ("leg", "phase")}
                if legs:
                    columns[SUPPORT] = is_support(rows).astype(np.int32)
                own = {key: columns.pop(key) for key in SHARED}
                shared = shared or own
                groups[group] = columns if np.array_equal(own["step"], shared["step"]) else {}
        names = names or {*groups}
        if {*groups} != names or not all(groups.values()):
            raise BadRun(f"{run.folder}: {' and '.join(name for name, _ in tables)} have not the same steps for all")
        yield StepChunk(shared, groups)


def _split(table: pa.Table, legs: bool) -> Iterator[tuple[str, pa.Table]]:
    """The rows of each leg, or all."""
    if not legs:
        yield "body", table
        return
    leg = as_array(table, "leg")
    for number in np.unique(leg).tolist():
        yield f"leg{number}", select_rows(table, leg == number)
