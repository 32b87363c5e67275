"""The tables of a run on disk: its traces, and the metrics that are computed from them alone."""

from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.errors import BadRun
from cmacexp.files import write_atomically
from cmacexp.metrics import compute, compute_body
from cmacexp.table import read_table, write_table
from cmacexp.trace import COLUMNS

TRACE, BODY = "trace.parquet", "body.parquet"
METRICS, METRICS_CSV, BODY_METRICS = "metrics.parquet", "metrics.csv", "body_metrics.parquet"
RECORDING = "recording.rrd"


class Traces(NamedTuple):
    """What a run left of every step."""

    legs: pa.Table
    """One row per step and leg."""
    body: pa.Table | None
    """One row per step; None without a body."""


class Scores(NamedTuple):
    """What was measured of every cycle."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def _read(path: Path) -> pa.Table:
    try:
        return read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise BadRun(f"{path}: cannot be read as a trace ({str(error).splitlines()[0]})") from None


def read_traces(folder: Path) -> Traces:
    """The traces of a run.

    Raises:
        BadRun: one is missing or cannot be read.
    """
    traces = Traces(_read(folder / TRACE), _read(folder / BODY) if (folder / BODY).exists() else None)
    missing = {column.name for column in COLUMNS} - set(traces.legs.column_names)
    if missing:
        raise BadRun(f"{folder / TRACE}: not a trace: it has no {', '.join(sorted(missing))}")
    return traces


def write_traces(folder: Path, traces: Traces) -> list[str]:
    """Write the traces of a run; the names of the files."""
    write_table(traces.legs, folder / TRACE)
    if traces.body is None:
        return [TRACE]
    write_table(traces.body, folder / BODY)
    return [TRACE, BODY]


def write_scores(folder: Path, traces: Traces, steps_per_cycle: int) -> tuple[Scores, list[str]]:
    """Compute the metrics of a run and write them; with the names of the files."""
    legs = compute(traces.legs, steps_per_cycle)
    write_table(legs, folder / METRICS)
    with write_atomically(folder / METRICS_CSV) as temporary:
        pa_csv.write_csv(legs, temporary)
    if traces.body is None:
        return Scores(legs, None), [METRICS, METRICS_CSV]
    body = compute_body(traces.body, steps_per_cycle)
    write_table(body, folder / BODY_METRICS)
    return Scores(legs, body), [METRICS, METRICS_CSV, BODY_METRICS]
