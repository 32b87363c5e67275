"""Time to write a trace: this project's Parquet file against the closest alternatives."""

import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from benchmarks.timing import Row, Table, compared, in_turn, stopwatch
from cmacexp.config.compose import compose_config
from cmacexp.data.tables import write_table
from cmacexp.loop.driver import Driver
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.stop import RUNNING
from cmacexp.loop.trace import make_trace, select_columns


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.2f} MB"


def of_run(cycles: int, folder: Path, rounds: int) -> list[Row]:
    """Time writing the trace of one leg, from samples in memory to a complete file."""
    config = compose_config(["scenario=one_leg", f"cycles={cycles}"])
    scenario = make_scenario(config)
    samples, body = make_samples(config.cycles * config.steps_per_cycle, config.legs, wide=False)
    assert Driver(scenario, None).run(samples, body) == RUNNING
    ours, plain, csv, npy = (folder / f"{cycles}.{kind}" for kind in ("parquet", "plain", "csv", "npy"))

    def make() -> pa.Table:
        return make_trace(scenario, select_columns(scenario), 0, samples, body).table

    table = make()

    workers = {
        "ours": stopwatch(lambda: write_table(make(), ours)),
        "plain": stopwatch(lambda: pq.write_table(table, plain)),
        "csv": stopwatch(lambda: pa_csv.write_csv(table, csv)),
        "npy": stopwatch(lambda: np.save(npy, samples)),
    }
    times = in_turn(workers, rounds)
    megabytes = table.nbytes / 1e6
    what = f"{table.num_rows} rows ({megabytes / min(times['ours']):.0f} MB/s, {_size(ours)} of {megabytes:.2f} MB)"
    return [
        compared(times, what, "ours", "plain", f"pyarrow's own settings ({_size(plain)})"),
        compared(times, what, "ours", "csv", f"CSV by pyarrow ({_size(csv)})"),
        compared(times, what, "ours", "npy", f"`numpy.save`, no metadata ({_size(npy)})"),
    ]


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their table."""
    rounds = 5 if quick else 21
    with tempfile.TemporaryDirectory() as name:
        rows = of_run(5, Path(name), rounds) + of_run(100, Path(name), max(3, rounds // 3))
    note = "With assembling the table, fsync and the rename that makes a file appear only when whole."
    return [Table("Trace writing, one leg", rows, note)]
