"""The results of a sweep as one table: a row for each job, cycle and leg."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from cmacexp.data.discovery import runs_below
from cmacexp.data.parquet import as_array
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import METRICS, Scores
from cmacexp.experiment.sweep_results import make_column, parse_overrides
from cmacexp.report.run_summary import sort_folders

if TYPE_CHECKING:
    import pandas as pd


def load_sweep(folder: str | Path) -> "pd.DataFrame":
    """All metrics of all jobs of a sweep, or of all runs below a folder.

    Args:
        folder: of the sweep.

    Returns:
        A row for each job, cycle and leg: ``run``, the folder of the job in that of the sweep; a column for each key
        that some job overrides; ``status``; the columns of ``metrics.parquet`` and of ``body_metrics.parquet``, see
        ``docs/metrics.md``. A job without metrics has one row, which lacks them.

    Raises:
        BadRun: there is no run, or one is not intact.
    """
    root = Path(folder).resolve()
    runs = [StoredRun(path) for path in sort_folders(runs_below(root))]
    tables = [join_scores(run.scores if METRICS in run.manifest["files"] else None) for run in runs]
    settings = parse_overrides([run.manifest.get("overrides", []) for run in runs])
    rows = [
        {"run": str(run.folder.relative_to(root)), **values, "status": run.status}
        for run, values in zip(runs, settings, strict=True)
    ]
    return stack(rows, tables)


def stack(rows: Sequence[Mapping[str, Any]], tables: Sequence[pa.Table]) -> "pd.DataFrame":
    """Tables of runs as one, each with the values of its run in columns of their own."""
    run = np.repeat(np.arange(len(tables)), [table.num_rows for table in tables])
    columns = {name: make_column([row[name] for row in rows]).take(run) for name in rows[0]}
    values = pa.concat_tables(tables, promote_options="default")
    return pa.table(columns | dict(zip(values.column_names, values.columns, strict=True))).to_pandas()


def join_scores(scores: Scores | None) -> pa.Table:
    """Metrics of a run, with those of its body for each leg; a row of nothing if it has none."""
    if scores is None:
        return pa.table({"cycle": pa.nulls(1)})
    table, body = scores
    if body is not None and table.num_rows:
        rows = np.searchsorted(as_array(body, "cycle"), as_array(table, "cycle"))
        for name in body.column_names:
            if name not in table.column_names:
                table = table.append_column(name, body[name].take(rows))
    return table
