"""The tables of a run on disk: names, reading, writing."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from cmacexp.data.hashes import was_written
from cmacexp.data.parquet import as_array, read_parts, select_rows, write_table
from cmacexp.data.signals import BODY_SIGNALS, LEG_SIGNALS, Signal, make_schema, select_signals
from cmacexp.errors import BadRun

TRACE, BODY, MEMORY = "trace.parquet", "body.parquet", "memory.parquet"
METRICS, METRICS_CSV, BODY_METRICS = "metrics.parquet", "metrics.csv", "body_metrics.parquet"
RECORDING = "recording.rrd"


class Traces(NamedTuple):
    """Tables of the steps of a run, or of some cycles."""

    legs: pa.Table
    """One row per step and leg."""
    body: pa.Table | None
    """One row per step; None without a body."""
    memory: pa.Table | None = None
    """One row per cycle and leg; None without weights."""


class Scores(NamedTuple):
    """Metrics of every cycle."""

    legs: pa.Table
    """One row per cycle and leg."""
    body: pa.Table | None
    """One row per cycle; None without a body."""


def steps_by_cycle(folder: Path) -> dict[int, int]:
    """Number of steps of each cycle in the trace of a run.

    Raises:
        BadRun: it is missing, has changed or cannot be read.
    """
    steps: dict[int, int] = {}
    for part in read_parts(folder / TRACE, ["cycle", "leg"]):
        cycles, counts = np.unique(as_array(part, "cycle")[as_array(part, "leg") == 1], return_counts=True)
        for cycle, count in zip(cycles.tolist(), counts.tolist(), strict=True):
            steps[cycle] = steps.get(cycle, 0) + count
    return steps


def _read(path: Path, columns: Sequence[Signal], cycles: tuple[int, int], every: int) -> pa.Table:
    """A window of a trace, one step in ``every``; read part by part, so that only the window is in memory."""
    kept: list[pa.Table] = []
    steps = 0
    for part in read_parts(path):
        missing = {column.name for column in columns} - set(part.column_names)
        if missing:
            raise BadRun(f"{path}: not a trace: it has no {', '.join(sorted(missing))}")
        cycle = as_array(part, "cycle")
        part = select_rows(part, (cycle >= cycles[0]) & (cycle <= cycles[1]))
        legs = int(as_array(part, "leg").max(initial=1)) if "leg" in part.column_names else 1
        kept.append(select_rows(part, (np.arange(part.num_rows) // legs + steps) % every == 0))
        steps += part.num_rows // legs
    return pa.concat_tables(kept).combine_chunks() if kept else make_schema(columns).empty_table()


ALL_CYCLES = (1, 2**31 - 1)


def read_traces(folder: Path, cycles: tuple[int, int] = ALL_CYCLES, every: int = 1) -> Traces:
    """The traces of a run.

    Args:
        folder: of the run.
        cycles: the first and the last to read.
        every: read one step in so many.

    Raises:
        BadRun: one is missing, has changed or cannot be read.
    """
    legs = _read(folder / TRACE, select_signals(LEG_SIGNALS), cycles, every)
    walks = was_written(folder / BODY)
    return Traces(legs, _read(folder / BODY, select_signals(BODY_SIGNALS), cycles, every) if walks else None)


def write_scores(folder: Path, scores: Scores, as_csv: bool = True) -> list[str]:
    """Write the metrics of a run, as CSV too unless that is not wanted; the names of the files."""
    write_table(scores.legs, folder / METRICS)
    names = [METRICS]
    if as_csv:
        pa_csv.write_csv(scores.legs, folder / METRICS_CSV)
        names.append(METRICS_CSV)
    if scores.body is not None:
        write_table(scores.body, folder / BODY_METRICS)
        names.append(BODY_METRICS)
    return names
