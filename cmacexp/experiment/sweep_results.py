"""The table of a sweep, one row per job: all of it read from disk, whatever processes ran the jobs."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import yaml

from cmacexp.data.discovery import HYDRA_FOLDER
from cmacexp.data.files import place_of
from cmacexp.data.parquet import arrow, arrow_strings
from cmacexp.experiment.sweep_start import Sweep, select_run_overrides
from cmacexp.report.comparison import Row, make_rows
from cmacexp.report.run_summary import RunSummary, read_summary, sort_folders


class SweepResults(NamedTuple):
    """The jobs of a sweep, as they ended."""

    jobs: list[RunSummary]
    """Those that were begun; their config holds the overridden keys alone."""
    keys: list[str]
    """All keys that some job overrides."""
    overrides: list[str]
    """Of each job, as typed."""

    def rows(self) -> list[Row]:
        """The rows of the table."""
        rows = make_rows(self.jobs, self.keys)
        return [{"run": row["run"], "overrides": text, **row} for row, text in zip(rows, self.overrides, strict=True)]


def read_results(sweep: Sweep) -> SweepResults:
    """The jobs of a sweep that were begun; not those that an earlier sweep left in its folder."""
    missing: Counter[tuple[str, ...]] = Counter(sweep.planned)
    jobs, all_overrides = [], []
    attempts = _find_attempts(sweep.folder)
    for folder in sort_folders(attempts):
        overrides = select_run_overrides(_read_overrides(attempts[folder]))
        if missing[tuple(overrides)] > 0 or not sweep.planned:  # a sweeper that searches need not plan its jobs
            missing[tuple(overrides)] -= 1
            jobs.append(replace(read_summary(attempts[folder]), folder=folder))
            all_overrides.append(overrides)
    texts = [dict(text.lstrip("+").partition("=")[::2] for text in overrides) for overrides in all_overrides]
    keys = list(dict.fromkeys(key for each in texts for key in each))
    configs = [{key: parse_value(each[key]) if key in each else None for key in keys} for each in texts]
    jobs = [replace(job, config=config) for job, config in zip(jobs, configs, strict=True)]
    return SweepResults(jobs, keys, [" ".join(overrides) for overrides in all_overrides])


def _find_attempts(folder: Path) -> dict[Path, Path]:
    """The folder of each job below ``folder``, and the one in it that the last attempt left, if it left no result."""
    found = sorted(path.parent.resolve() for path in folder.rglob(HYDRA_FOLDER))
    return {place_of(path): path for path in found}  # what an attempt left comes after the folder of the job


def _read_overrides(folder: Path) -> list[str]:
    """The overrides of a job, as Hydra recorded them; none if it was killed before."""
    try:
        found = yaml.safe_load((folder / HYDRA_FOLDER / "overrides.yaml").read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError):
        return []
    return [str(text) for text in found] if isinstance(found, list) else []


def parse_value(text: str) -> Any:
    """A value as typed on the command line: a number, true, false, null, else text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return None if text == "null" else text.strip("'\"")


def make_table(rows: Sequence[Row]) -> pa.Table:
    """Rows as a table; a number that a row lacks is NaN."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return pa.table({name: _make_column([row.get(name, math.nan) for row in rows]) for name in names})


def _make_column(values: Sequence[Any]) -> pa.Array:
    """Values as an Arrow column: of integers, floats or booleans if all are, else of text."""
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return arrow(np.array(values), pa.int8()).cast(pa.bool_())
    if kinds == {int} and max(map(abs, values)) < 2**63:
        return arrow(np.array(values), pa.int64())
    if kinds <= {int, float}:
        return arrow(np.array(values, dtype=float), pa.float64())
    return arrow_strings(["null" if value is None else str(value) for value in values])
