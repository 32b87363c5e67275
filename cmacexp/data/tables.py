"""The files of a run, and its tables of metrics."""

from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data.parquet import write_table

TRACE_FILE, BODY_FILE, MEMORY_FILE = "trace.parquet", "body.parquet", "memory.parquet"
METRICS_FILE, METRICS_CSV, BODY_METRICS_FILE = "metrics.parquet", "metrics.csv", "body_metrics.parquet"
RECORDING_FILE, WEIGHTS = "recording.rrd", "weights.npz"
TABLES = (TRACE_FILE, BODY_FILE, MEMORY_FILE, METRICS_FILE, BODY_METRICS_FILE)
"""Files of a run that views of it are computed from."""


class Scores(NamedTuple):
    """Metrics of every cycle."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def write_scores(folder: Path, scores: Scores, as_csv: bool = True) -> list[str]:
    """Write the metrics of a run, as CSV too unless that is not wanted; the names of the files but for the CSV."""
    write_table(scores.legs, folder / METRICS_FILE)
    names = [METRICS_FILE]
    if as_csv:
        pa_csv.write_csv(scores.legs, folder / METRICS_CSV)
    if scores.body is not None:
        write_table(scores.body, folder / BODY_METRICS_FILE)
        names.append(BODY_METRICS_FILE)
    return names
