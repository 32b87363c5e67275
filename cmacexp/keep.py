"""The files of a run by name, and those that are computed from its trace alone."""

from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.errors import BadRun
from cmacexp.files import write_atomically
from cmacexp.metrics import compute
from cmacexp.table import read_table, write_table

TRACE, METRICS, METRICS_CSV, RECORDING = "trace.parquet", "metrics.parquet", "metrics.csv", "recording.rrd"


def read_trace(path: Path) -> pa.Table:
    """The trace at ``path``.

    Raises:
        BadRun: there is none, or it cannot be read.
    """
    try:
        return read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise BadRun(f"{path}: cannot be read as a trace ({str(error).splitlines()[0]})") from None


def write_metrics(folder: Path, trace: pa.Table, steps_per_cycle: int) -> tuple[pa.Table, list[str]]:
    """Compute the metrics of a trace and write them; the table and the names of the files."""
    metrics = compute(trace, steps_per_cycle)
    write_table(metrics, folder / METRICS)
    with write_atomically(folder / METRICS_CSV) as temporary:
        pa_csv.write_csv(metrics, temporary)
    return metrics, [METRICS, METRICS_CSV]
