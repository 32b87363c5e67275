"""A run on disk: how it ended, of what config, its tables, and its views."""

import math
import os
import re
from collections.abc import Collection, Iterable
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config import Config, to_config
from cmacexp.config.component import require_shipped
from cmacexp.config.describe import flatten_config
from cmacexp.config.schema import count_steps
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import list_faults
from cmacexp.data.records import RunEnd
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    METRICS_FILE,
    TABLES,
    TRACE_FILE,
    Scores,
    as_array,
    list_units,
    read_schema,
    read_table,
    to_frame,
)
from cmacexp.data.trace import Trace, read_trace
from cmacexp.entry_points import load_view
from cmacexp.errors import BadRun, CmacexpError, in_one_line, require_extra, require_name
from cmacexp.typing import RESULTS, Array, DataFrame, Dataset, Status

NO_VALUES = ("step", "time", "cycle", "leg", "phase")
"""Signals that say where a value belongs."""


class Run:
    """A run that has ended, by its folder; what :func:`cmacexp.run` and :func:`cmacexp.load` return.

    Nothing is read before it is asked for. ``repr`` gives one line; ``str`` and a notebook also show the main metrics
    of each cycle.

    Args:
        folder: of the run.
        manifest: as it has just been written; None: it is read.

    Raises:
        BadRun: on first use of a file that is missing, has changed or cannot be read.
    """

    is_checked = True
    """Whether it has files, by which it is intact or not."""

    def __init__(self, folder: str | Path, manifest: manifests.Manifest | None = None):
        self.folder = Path(folder)
        if manifest is not None:
            self.manifest = manifest

    @cached_property
    def manifest(self) -> manifests.Manifest:
        """How it ended, of what config, versions, and the hashes of its files: ``manifest.json``."""
        return manifests.read(self.folder)

    @property
    def config(self) -> dict[str, Any]:
        """Its config as plain dictionaries; ``cmacexp.run(run.config)`` runs it again.

        A config that names code outside this package, as with a custom controller, needs ``trust=True`` there.
        """
        return dict(self.manifest["config"])

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The config by dotted keys; empty if it cannot be read."""
        try:
            return flatten_config(self.config)
        except BadRun:
            return {}

    @property
    def status(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])

    @property
    def ending(self) -> str:
        """Status and cause in one line."""
        return f"{self.status} {self.manifest['cause'] or ''}".rstrip()

    @property
    def steps_per_cycle(self) -> int:
        """Samples of one cycle."""
        return count_steps(self.config["gait"]["cycle_time"], self.config["sampling_period"])

    @property
    def whole_cycles(self) -> int:
        """Number of cycles that the run completed."""
        steps = int(self.manifest["steps"])
        return steps // self.steps_per_cycle if steps else 0  # else its config may be of any kind

    @property
    def last_cycle(self) -> int:
        """Number of the cycle in which the run ended."""
        steps = int(self.manifest["steps"])
        return -(-steps // self.steps_per_cycle) if steps else 0

    def select_whole(self, kept: Iterable[int]) -> list[int]:
        """Those of the cycles in the trace that are whole there, but for the thinning of their steps.

        ``kept`` are those of which the trace has a step: a run that did not complete keeps its last steps.
        """
        asked, whole = self.config["record"]["cycles"], self.whole_cycles
        return [cycle for cycle in kept if cycle <= whole and (asked is None or cycle in asked)]

    def wrote(self, name: str) -> bool:
        """Whether a file is one of the run."""
        return name in self.manifest["files"]

    @property
    def walks(self) -> bool:
        """Whether there is a body on legs."""
        return self.wrote(BODY_METRICS_FILE)

    def _table(self, name: str) -> DataFrame:
        _ = self.manifest  # without one there is nothing that the table could be compared with
        return to_frame(read_table(self.folder / name))

    @cached_property
    def trace(self) -> DataFrame:
        """One row per step and leg."""
        return self._table(TRACE_FILE)

    @cached_property
    def metrics(self) -> DataFrame:
        """One row per cycle and leg."""
        return self._table(METRICS_FILE)

    @cached_property
    def body(self) -> DataFrame:
        """One row per step; only of a run that :attr:`walks`."""
        return self._table(BODY_FILE)

    @cached_property
    def body_metrics(self) -> DataFrame:
        """One row per cycle; only of a run that :attr:`walks`."""
        return self._table(BODY_METRICS_FILE)

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of all columns of these tables, by name; empty where a column has none."""
        names = [name for name in TABLES if self.wrote(name)]
        return {key: unit for name in names for key, unit in list_units(read_schema(self.folder / name)).items()}

    def read_trace(self, cycles: Collection[int] | None = None, every: int = 1) -> Trace:
        """The trace as arrays (steps, legs) by name: of all cycles or of some, one step in ``every``."""
        _ = self.manifest
        return read_trace(self.folder, cycles, every)

    @cached_property
    def scores(self) -> Scores:
        """The metrics of every cycle, as Arrow tables; raises BadRun unless they have those of all cycles."""
        path = self.folder / METRICS_FILE
        cycles = np.arange(1, self.last_cycle + 1)
        legs = Trace(read_table(path))
        body = Trace(read_table(self.folder / BODY_METRICS_FILE)) if self.walks else None
        BadRun.unless(
            all(np.array_equal(table.shared("cycle"), cycles) for table in (legs, body) if table is not None),
            f"{path}: not the metrics of the run: it must have a row for each cycle, in order",
        )
        return Scores(legs.table, None if body is None else body.table)

    @cached_property
    def _summary(self) -> tuple[RunEnd, dict[str, Array], int]:
        """How it ended, its metrics in whole cycles, pooled over the legs, and the number of legs."""
        try:
            manifest, pooled, legs = self.manifest, {}, 1
            checked = self.is_checked and (manifest["files"] or self.status in RESULTS)
            found = list_faults(self.folder, manifest) if checked else []
            wrong = [fault for fault in found if fault.split(":")[0] in TABLES]
            if wrong:
                return RunEnd(Status.NOT_INTACT, "; ".join(wrong)), {}, 1
            if self.wrote(METRICS_FILE):
                scores, cycles = self.scores, self.whole_cycles
                pooled = {name: values[:cycles] for name, values in load_view("pool")(scores).items()}
                legs = int(as_array(scores.legs, "leg").max(initial=1))
        except (BadRun, OSError, ValueError) as error:
            status = Status.NOT_INTACT if os.path.lexists(self.folder / manifests.MANIFEST) else Status.UNFINISHED
            return RunEnd(status, str(error).splitlines()[0].removeprefix(f"{self.folder}: ")), {}, 1
        return RunEnd(self.status, manifest["cause"] or ""), pooled, legs

    @property
    def outcome(self) -> RunEnd:
        """How it ended; of a run that is not intact the reason. It never raises: a table of runs lists all."""
        return self._summary[0]

    @property
    def completed(self) -> bool:
        """Whether it is intact and reached its end."""
        return self.outcome.status == Status.COMPLETED

    @property
    def pooled(self) -> dict[str, Array]:
        """All metrics by name, (whole cycles,) each, in SI units, pooled over the legs.

        Empty of a run that has none, or that is not intact.
        """
        return self._summary[1]

    @property
    def legs(self) -> int:
        """Number of legs that have metrics."""
        return self._summary[2]

    @property
    def cycles_done(self) -> int:
        """Number of whole cycles that have metrics."""
        return len(next(iter(self.pooled.values()), ()))

    def final(self, name: str) -> float:
        """A metric of the last whole cycle, pooled over the legs; NaN if the run has none.

        Raises BadInput if there is no such metric.
        """
        require_name("metric", name, self.pooled if name in self.pooled else load_view("metrics"))
        return float(self.pooled[name][-1]) if self.cycles_done and name in self.pooled else math.nan

    def report(self) -> Path:
        """Write the report of the run, as ``python -m cmacexp.report`` with its folder; returns the page."""
        return load_view("report")(self)

    def to_xarray(self) -> Dataset:
        """The trace as a Dataset with units: signals of the legs over (step, leg), of the body over (step).

        ``support`` takes the place of ``phase``. Needs the extra ``xarray``; raises CmacexpError without it.
        """
        require_extra("xarray")
        import xarray

        trace, signals = self.read_trace(), dict[str, Any]()
        for own in filter(None, (trace, trace.body)):
            dimensions = ("step", "leg") if own.legs else ("step",)
            for name in [name for name in own.names if name not in NO_VALUES]:
                signals[name] = (dimensions, own[name], {"units": trace.units[name]})
        signals["support"] = (("step", "leg"), trace.support)
        coordinates: dict[str, Any] = {name: ("step", trace.shared(name)) for name in ("step", "time", "cycle")}
        coordinates["leg"] = ("leg", np.arange(1, trace.legs + 1))
        return xarray.Dataset(signals, coordinates, {"folder": str(self.folder), "status": self.status})

    def view(self) -> None:
        """Show the run in Rerun's viewer: in a notebook below the cell, else in a window, until that is closed."""
        load_view("view")(self)

    def __repr__(self) -> str:
        """Folder, scenario, and how it ended, in one line; of a damaged run the reason, without an error."""
        try:
            text = f"{self.config.get('scenario')}, {self.ending}, {self.manifest['steps']} steps"
        except Exception as error:
            text = str(error)
        return in_one_line(f"Run({str(self.folder)!r}: {' '.join(text.split())})")

    def __str__(self) -> str:
        """The same, and below it the main metrics per cycle."""
        try:
            lines = load_view("format")(self.scores)
        except Exception:
            lines = []
        return "\n".join([repr(self), *lines])

    def _repr_html_(self) -> str:
        """The same for a notebook."""
        import pandas as pd

        try:
            main, rows = load_view("tabulate")(self.scores)
        except Exception:
            main, rows = {}, []
        titles = ["cycle", *(f"{shown.title} {shown.unit}" for shown in main.values())]
        table = pd.DataFrame(rows, columns=titles).to_html(index=False) if rows else ""
        return f"<p>{escape(repr(self))}</p>{table}"


def sort_folders(folders: Iterable[Path]) -> list[Path]:
    """Folders without repeats, in the order of the numbers in their names: job 2 before job 10."""
    unique = {folder.resolve() for folder in folders}
    return sorted(unique, key=lambda path: [(p.isdigit() and int(p), p) for p in re.split(r"(\d+)", str(path))])


def read_config(run: Run, trust: bool = False, consent: str = "trust=True") -> Config:
    """Read the typed config of a stored run, which imports the classes that it names.

    Raises BadInput if one is no class of this package, unless there is ``trust`` in the run, with how to give
    ``consent``; BadRun if another version with other fields wrote the config.
    """
    plain = run.config
    if not trust:
        require_shipped(plain, consent)
    try:
        return to_config(plain)
    except CmacexpError as error:
        raise BadRun(f"{run.folder}: its config is not one of this version ({error}); run it again") from None
