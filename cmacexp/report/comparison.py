"""A sweep as a table: one row per job with what was swept, how it ended, and its main metrics."""

import math
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from cmacexp.config.difference import flat
from cmacexp.config.load import WITHOUT_EFFECT
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import RESULTS, faults
from cmacexp.data.parquet import read_table
from cmacexp.data.tables import BODY, BODY_METRICS, MEMORY, METRICS, TRACE, Scores
from cmacexp.errors import BadRun
from cmacexp.metrics.summary import COLUMNS, Row, Shown, all_of_cycle, best, defined, number, rows_per_cycle

TABLES = (TRACE, BODY, MEMORY, METRICS, BODY_METRICS)
"""Files of a run that a report can be computed from."""
PARTS = ("plant", "sensors", "controller", "feedforward")
"""Config keys whose value is the part chosen."""
BROKEN = "not whole"
"""Status of a run that left no whole manifest and tables."""


@dataclass(frozen=True)
class Job:
    """A run as a row of a table; metrics are those of whole cycles, in SI units, pooled over the legs."""

    folder: Path
    status: str
    cause: str
    config: dict[str, Any] = field(default_factory=dict)
    """Flat; empty if the run is broken."""
    cycles: list[Row] = field(default_factory=list)
    """The main metrics."""
    last: Row = field(default_factory=dict)
    """All metrics of the last whole cycle."""
    bad_input: bool = False
    """Whether it failed before anything was simulated, for a config that cannot be run."""

    @property
    def is_result(self) -> bool:
        """Whether it can be compared with others."""
        return self.status in RESULTS

    def final(self, name: str) -> float:
        """A metric of the last whole cycle; NaN if there is none."""
        return float(self.cycles[-1].get(name, math.nan)) if self.cycles else math.nan

    def best(self, name: str) -> float:
        """The best value that a metric has over all whole cycles; NaN if it is never defined."""
        return best([row.get(name, math.nan) for row in self.cycles], COLUMNS[name].good)


def _settings(manifest: manifests.Manifest) -> dict[str, Any]:
    """Its config, flat; a list is one text, as everything that can stand in a table."""
    found = flat(manifest["config"])
    return {key: text_of(value) if isinstance(value, list) else value for key, value in found.items()}


def job_of(folder: Path) -> Job:
    """What a folder holds; a run that is not whole says why in ``cause``."""
    try:
        manifest = manifests.read(folder)
        wrong = [fault for fault in faults(folder) if fault.split(":")[0] in TABLES]
        if wrong:
            return Job(folder, BROKEN, "; ".join(wrong), _settings(manifest))
        if METRICS not in manifest["files"]:
            cause, bad_input = manifest.get("cause") or "", bool(manifest.get("bad_input"))
            return Job(folder, manifest["status"], cause, _settings(manifest), bad_input=bad_input)
        body = read_table(folder / BODY_METRICS) if BODY_METRICS in manifest["files"] else None
        scores = Scores(read_table(folder / METRICS), body)
    except (BadRun, OSError, ValueError) as error:
        return Job(folder, BROKEN, str(error).splitlines()[0].removeprefix(f"{folder}: "))
    whole = manifest["steps"] // steps_per_cycle(manifest["config"])
    cycles, last = rows_per_cycle(scores)[:whole], all_of_cycle(scores, whole) if whole else {}
    return Job(folder, manifest["status"], manifest["cause"] or "", _settings(manifest), cycles, last)


def steps_per_cycle(config: dict[str, Any]) -> int:
    """Samples of one cycle of a run, from the config in its manifest."""
    return round(config["gait"]["cycle_time"] / config["sampling_period"])


class Swept(NamedTuple):
    """What tells the runs of a sweep apart."""

    keys: list[str]
    """Config keys that vary independently of each other."""
    along: dict[str, list[str]]
    """Keys that vary together with one of ``keys``, by that key."""
    repeats: list[str]
    """Seeds that vary besides: runs that differ in them alone repeat each other."""


def _rank(key: str) -> tuple[int, int, str]:
    """What names a difference best: the scenario, then the part or method chosen, then the shortest key."""
    order = [key == "scenario", key in PARTS, key.endswith((".method", ".kind", ".rule", ".pattern"))]
    return (order.index(True) if True in order else len(order), len(key), key)


def _patterns(configs: Sequence[dict[str, Any]]) -> dict[tuple[int, ...], list[str]]:
    """Keys that differ, by the first run that has the same value as each run.

    What the scenario alone decides differs as the scenario does.
    """
    scenarios = [config.get("scenario") for config in configs]
    by_scenario = tuple(map(scenarios.index, scenarios))
    groups: dict[tuple[int, ...], list[str]] = {}
    for key in dict.fromkeys(key for config in configs for key in config):
        values = [repr(config.get(key)) for config in configs]
        pattern = tuple(map(values.index, values))
        decided = len(set(zip(by_scenario, pattern, strict=True))) == len(set(by_scenario))
        if len(set(values)) > 1 and key.split(".")[0] not in WITHOUT_EFFECT:
            groups.setdefault(by_scenario if decided else pattern, []).append(key)
    return groups


def find_swept(jobs: Iterable[Job]) -> Swept:
    """The config keys in which runs differ; keys whose values differ between the same runs are one."""
    groups = _patterns([job.config for job in jobs if job.config])
    together = [sorted(keys, key=_rank) for keys in groups.values()]
    seeds = [keys[0] for keys in together if keys[0].endswith("seed")]
    others = [keys for keys in together if not keys[0].endswith("seed")]
    if not others:
        return Swept(seeds, {}, [])
    return Swept([keys[0] for keys in others], {keys[0]: keys[1:] for keys in others if keys[1:]}, seeds)


def in_order(folders: Iterable[Path]) -> list[Path]:
    """Folders without repeats, in the order of the numbers in their names: job 2 before job 10."""
    unique = {folder.resolve() for folder in folders}
    return sorted(unique, key=lambda path: [(p.isdigit() and int(p), p) for p in re.split(r"(\d+)", str(path))])


def names_of(folders: Sequence[Path]) -> list[str]:
    """Short names of folders: their paths below the folder that holds them all."""
    base = os.path.commonpath([folder.resolve().parent for folder in folders])
    return [folder.resolve().relative_to(base).as_posix() for folder in folders]


def sweep_rows(jobs: Sequence[Job], keys: Sequence[str]) -> list[Row]:
    """One flat row per job: ``run``, the value of each key, how it ended, and its metrics.

    How it ended: ``status``, ``cause`` and ``cycles_done``, the whole ones. Metrics are in SI units under
    ``final_NAME`` (of the last whole cycle) and ``best_NAME`` (over all whole cycles), NaN where undefined.
    """
    rows = []
    for name, job in zip(names_of([job.folder for job in jobs]), jobs, strict=True):
        row: Row = {"run": name, **{key: job.config.get(key) for key in keys}}
        row |= {"status": job.status, "cause": job.cause, "cycles_done": len(job.cycles)}
        row |= {f"final_{metric}": value for metric, value in job.last.items()}
        row |= {f"final_{metric}": job.final(metric) for metric in COLUMNS}
        rows.append(row | {f"best_{metric}": job.best(metric) for metric, how in COLUMNS.items() if how.good})
    return rows


def _finals(rows: Sequence[Row], prefix: str) -> dict[str, Shown]:
    """The metrics that some run defines under ``final_`` or ``best_``."""
    return defined([{name: row.get(prefix + name, math.nan) for name in COLUMNS} for row in rows])


def table_of_jobs(
    jobs: Sequence[Job], keys: Sequence[str], prefix: str = "final_"
) -> tuple[list[str], list[list[str]]]:
    """Titles, whose units follow a line break, and one row of text for each run.

    Args:
        jobs: of a sweep.
        keys: what differs between them.
        prefix: ``final_`` or ``best_``.
    """
    rows = sweep_rows(jobs, keys)
    shown = _finals(rows, prefix)
    titles = ["run", *keys, "status", "cycles\ndone", *(f"{how.title}\n{how.unit}" for how in shown.values())]
    cells = []
    for row in rows:
        figures = [number(row[prefix + name] * how.factor) for name, how in shown.items()]
        cells.append(
            [row["run"], *(text_of(row[key]) for key in keys), row["status"], str(row["cycles_done"]), *figures]
        )
    return titles, cells


def text_of(value: Any) -> str:
    """A value of a config as text: short numbers, a class by its name."""
    if value is None:
        return "null"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = f"[{', '.join(map(str, value))}]" if isinstance(value, list) else str(value)
    return text.rpartition(".")[2] if text.startswith("cmacexp.") else text
