"""Runs as rows of a table: settings, how each ended, and its metrics pooled over the legs."""

import math
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config.difference import flatten_config
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import RESULTS, faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY_FILE, BODY_METRICS_FILE, MEMORY_FILE, METRICS_FILE, TRACE_FILE
from cmacexp.errors import BadRun, in_one_line
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.pooling import count_legs, is_shown, pool_legs, shorten
from cmacexp.metrics.registry import ALL_METRICS, MAIN, RANKED
from cmacexp.metrics.text import format_cell, format_setting
from cmacexp.metrics.tracking import SPATIAL
from cmacexp.terminal.tables import KEY, format_title, print_table
from cmacexp.typing import Array

TABLES = (TRACE_FILE, BODY_FILE, MEMORY_FILE, METRICS_FILE, BODY_METRICS_FILE)
"""Files of a run that a report can be computed from."""
BROKEN, UNFINISHED = "not intact", "unfinished"
"""Status of a run whose manifest or tables are missing or changed; of one that was killed before it had any."""
RunRow = dict[str, Any]


@dataclass(frozen=True)
class RunSummary:
    """A run as a row of a table; metrics are those of whole cycles, in SI units, pooled over the legs."""

    folder: Path
    status: str
    cause: str
    config: dict[str, Any] = field(default_factory=dict)
    """Flat; empty if it cannot be read."""
    cycles: int = 0
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
            for key, value in flatten_config(run.config).items()
        }
        wrong = [fault for fault in faults(folder) if fault.split(":")[0] in TABLES]
        if wrong:
            return RunSummary(folder, BROKEN, "; ".join(wrong), settings)
        cause = manifest.get("cause") or ""
        if METRICS_FILE not in manifest["files"]:
            return RunSummary(folder, run.status, cause, settings, bad_input=bool(manifest.get("bad_input")))
        scores, cycles = run.scores, run.whole_cycles
    except (BadRun, OSError, ValueError) as error:
        status = BROKEN if os.path.lexists(folder / manifests.MANIFEST) else UNFINISHED
        return RunSummary(folder, status, str(error).splitlines()[0].removeprefix(f"{folder}: "))
    metrics = {name: values[:cycles] for name, values in pool_legs(scores).items()}
    return RunSummary(folder, run.status, cause, settings, cycles, metrics, count_legs(scores))


def sort_folders(folders: Iterable[Path]) -> list[Path]:
    """Folders without repeats, in the order of the numbers in their names: job 2 before job 10."""
    unique = {folder.resolve() for folder in folders}
    return sorted(unique, key=lambda path: [(p.isdigit() and int(p), p) for p in re.split(r"(\d+)", str(path))])


def make_names(runs: Sequence[RunSummary]) -> list[str]:
    """Short names of runs: the paths of their folders below the one that holds them all."""
    folders = [run.folder.resolve() for run in runs]
    base = os.path.commonpath([folder.parent for folder in folders])
    return [folder.relative_to(base).as_posix() for folder in folders]


def make_rows(runs: Sequence[RunSummary], keys: Sequence[str]) -> list[RunRow]:
    """One flat row per run: ``run``, the value of each key, how it ended, and its metrics.

    How it ended: ``status``, ``cause`` and ``cycles_done``, the whole ones. Metrics are in SI units under
    ``final_NAME`` (of the last whole cycle) and ``best_NAME`` (over all whole cycles), NaN where undefined.
    """
    rows, (main, ranked) = [], (_omit_robots(runs, names) for names in (MAIN, RANKED))
    for name, run in zip(make_names(runs), runs, strict=True):
        row: RunRow = {"run": name, **{key: run.config.get(key) for key in keys}}
        row |= {"status": run.status, "cause": run.cause, "cycles_done": run.cycles}
        final = dict.fromkeys([*run.metrics, *main])
        row |= {f"final_{metric}": run.final(metric) for metric in final}
        rows.append(row | {f"best_{metric}": run.best(metric) for metric in ranked})
    return rows


def _omit_robots(runs: Sequence[RunSummary], names: Iterable[str]) -> list[str]:
    """Names of metrics without those that robots alone have, if no run is one of a robot."""
    return [name for name in names if name not in SPATIAL or any(name in run.metrics for run in runs)]


def tabulate_runs(
    runs: Sequence[RunSummary], keys: Sequence[str]
) -> tuple[dict[str, MetricDisplay], list[list[str]]]:
    """The main metrics that at least one run defines, by name, and one row of text for each run.

    A row has the run's name, the values of ``keys``, the status, the number of whole cycles, and the metrics of the
    last of them.
    """
    columns = {
        name: [shown.factor * run.final(name) if run.shows(name) else math.nan for run in runs]
        for name, shown in MAIN.items()
    }
    main = {name: shown for name, shown in MAIN.items() if not np.isnan(columns[name]).all()}
    rows = []
    for index, (name, run) in enumerate(zip(make_names(runs), runs, strict=True)):
        settings = [format_setting(run.config.get(key)) for key in keys]
        rows.append([name, *settings, run.status, str(run.cycles), *(format_cell(columns[m][index]) for m in main)])
    return main, rows


def format_runs(runs: Sequence[RunSummary], keys: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Titles, whose units follow a line break, and the rows of :func:`tabulate_runs`."""
    main, rows = tabulate_runs(runs, keys)
    return ["run", *keys, "status", "cycles done", *(f"{s.title}\n{s.unit}" for s in main.values())], rows


def print_runs(runs: Sequence[RunSummary], keys: Sequence[str], all_in: Path) -> None:
    """Print a table of runs; of many runs some, and where all are."""
    main, rows = tabulate_runs(runs, keys)
    shown = shorten(rows)
    heads = [key.replace(".", ".\n") + "\n" for key in keys]
    print_table(["run\n", *heads, "status\n", "cycles\ndone\n", *map(format_title, main.values())], shown)
    if len(shown) < len(rows):
        print(in_one_line(f"{len(shown)} of {len(rows)} runs; all are in {all_in}"))
    if main:
        print("metrics are those of the last whole cycle")
        print(KEY)
