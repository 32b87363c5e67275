"""A run as a row of a table of runs: its settings, how it ended, and its metrics pooled over the legs."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config.difference import flat
from cmacexp.data.integrity import RESULTS, faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY, BODY_METRICS, MEMORY, METRICS, TRACE
from cmacexp.errors import BadRun
from cmacexp.metrics.pooling import count_legs, is_shown, pool_legs
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.metrics.text import format_setting
from cmacexp.typing import Array

TABLES = (TRACE, BODY, MEMORY, METRICS, BODY_METRICS)
"""Files of a run that a report can be computed from."""
BROKEN = "not intact"
"""Status of a run whose manifest or tables are missing or changed."""


@dataclass(frozen=True)
class RunSummary:
    """A run as a row of a table; metrics are those of whole cycles, in SI units, pooled over the legs."""

    folder: Path
    status: str
    cause: str
    config: dict[str, Any] = field(default_factory=dict)
    """Flat; empty if the run is broken."""
    cycles: int = 0
    """Number of whole cycles."""
    metrics: dict[str, Array] = field(default_factory=dict)
    """All metrics by name, a value for each whole cycle."""
    legs: int = 1
    bad_input: bool = False
    """Whether it failed before anything was simulated, for a config that cannot be run."""

    @property
    def is_result(self) -> bool:
        """Whether it can be compared with others."""
        return self.status in RESULTS

    def shows(self, name: str) -> bool:
        """Whether tables and figures show one of the main metrics for this run."""
        return is_shown(name, self.metrics, self.legs)

    def final(self, name: str) -> float:
        """A metric of the last whole cycle; NaN if there is none."""
        return float(self.metrics[name][-1]) if self.cycles and name in self.metrics else math.nan

    def best(self, name: str) -> float:
        """The best value of a metric over all whole cycles; NaN if it is never defined."""
        return ALL_METRICS[name].find_best(self.metrics.get(name, np.empty(0)))


def read_summary(folder: Path) -> RunSummary:
    """Summarise a run; one that is not intact gives the reason in ``cause``."""
    run = StoredRun(folder)
    try:
        manifest = run.manifest
        settings = {
            key: format_setting(value) if isinstance(value, list) else value
            for key, value in flat(run.config).items()
        }
        wrong = [fault for fault in faults(folder) if fault.split(":")[0] in TABLES]
        if wrong:
            return RunSummary(folder, BROKEN, "; ".join(wrong), settings)
        cause = manifest.get("cause") or ""
        if METRICS not in manifest["files"]:
            return RunSummary(folder, run.status, cause, settings, bad_input=bool(manifest.get("bad_input")))
        scores, cycles = run.scores, run.whole_cycles
    except (BadRun, OSError, ValueError) as error:
        return RunSummary(folder, BROKEN, str(error).splitlines()[0].removeprefix(f"{folder}: "))
    metrics = {name: values[:cycles] for name, values in pool_legs(scores).items()}
    return RunSummary(folder, run.status, cause, settings, cycles, metrics, count_legs(scores))


def sort_folders(folders: Iterable[Path]) -> list[Path]:
    """Folders without repeats, in the order of the numbers in their names: job 2 before job 10."""
    unique = {folder.resolve() for folder in folders}
    return sorted(unique, key=lambda path: [(p.isdigit() and int(p), p) for p in re.split(r"(\d+)", str(path))])
