"""A stored run: its outcome, config, tables and views."""

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
"""Signals that index the others, such as time and leg."""


class Run:
    """A stored run that has ended, as :func:`cmacexp.run` and :func:`cmacexp.load` return it.

    Files are read on first access. ``repr`` gives one line; ``str`` and a notebook also show the main metrics of each
    cycle.

    Args:
        folder: Folder of the run.
        manifest: Its manifest, if it has just been written; None: it is read from the folder.

    Raises:
        BadRun: On first access to a file that is missing, has changed or cannot be read.
    """

    is_checked = True
    """True if the run has files whose hashes are checked."""

    def __init__(self, folder: str | Path, manifest: manifests.Manifest | None = None):
        self.folder = Path(folder)
        if manifest is not None:
            self.manifest = manifest

    @cached_property
    def manifest(self) -> manifests.Manifest:
        """Content of ``manifest.json``: outcome, config, versions, and hashes of the files."""
        return manifests.read(self.folder)

    @property
    def config(self) -> dict[str, Any]:
        """Config of the run as plain dictionaries; ``cmacexp.run(run.config)`` repeats the run.

        A config that names code outside this package, as with a custom controller, needs ``trust=True`` there.
        """
        return dict(self.manifest["config"])

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Config with dotted keys, e.g. ``terrain.stiffness``; empty if it cannot be read."""
        try:
            return flatten_config(self.config)
        except BadRun:
            return {}

    @property
    def status(self) -> str:
        """Outcome: ``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])

    @property
    def ending(self) -> str:
        """Status and cause of the end of the run, in one line."""
        return f"{self.status} {self.manifest['cause'] or ''}".rstrip()

    @property
    def steps_per_cycle(self) -> int:
        """Number of samples of one gait cycle."""
        return count_steps(self.config["gait"]["cycle_time"], self.config["sampling_period"])

    @property
    def whole_cycles(self) -> int:
        """Number of cycles that the run completed."""
        steps = int(self.manifest["steps"])
        return steps // self.steps_per_cycle if steps else 0  # a run without a step may have an invalid config

    @property
    def last_cycle(self) -> int:
        """Number of the cycle in which the run ended."""
        steps = int(self.manifest["steps"])
        return -(-steps // self.steps_per_cycle) if steps else 0

    def select_whole(self, kept: Iterable[int]) -> list[int]:
        """Select, of the cycles ``kept``, those that the trace contains completely, apart from thinned steps.

        ``kept`` are the cycles with at least one step in the trace: if a run did not complete, its trace also has the
        last steps of cycles that ``record.cycles`` excludes.
        """
        recorded = self.config["record"]["cycles"]
        whole = self.whole_cycles
        return [cycle for cycle in kept if cycle <= whole and (recorded is None or cycle in recorded)]

    def wrote(self, name: str) -> bool:
        """Check whether the run wrote the file ``name``."""
        return name in self.manifest["files"]

    @property
    def walks(self) -> bool:
        """True if the machine has a body on legs."""
        return self.wrote(BODY_METRICS_FILE)

    def _table(self, name: str) -> DataFrame:
        _ = self.manifest  # raises BadRun without one: the table could not be checked
        return to_frame(read_table(self.folder / name))

    @cached_property
    def trace(self) -> DataFrame:
        """Signals of the legs, one row per step and leg."""
        return self._table(TRACE_FILE)

    @cached_property
    def metrics(self) -> DataFrame:
        """Metrics of the legs, one row per cycle and leg."""
        return self._table(METRICS_FILE)

    @cached_property
    def body(self) -> DataFrame:
        """Signals of the body, one row per step; only if the run :attr:`walks`."""
        return self._table(BODY_FILE)

    @cached_property
    def body_metrics(self) -> DataFrame:
        """Metrics of the body, one row per cycle; only if the run :attr:`walks`."""
        return self._table(BODY_METRICS_FILE)

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit of every column of the tables of the run, by column name; empty for a column without a unit."""
        names = [name for name in TABLES if self.wrote(name)]
        return {key: unit for name in names for key, unit in list_units(read_schema(self.folder / name)).items()}

    def read_trace(self, cycles: Collection[int] | None = None, every: int = 1) -> Trace:
        """Read the trace as arrays (steps, legs) by name.

        Only the steps of ``cycles``, if not None, and of these one in ``every``.
        """
        _ = self.manifest
        return read_trace(self.folder, cycles, every)

    @cached_property
    def scores(self) -> Scores:
        """Metrics of all cycles, as Arrow tables; raises BadRun if the metrics of a cycle are missing."""
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
        """Outcome, metrics of the whole cycles pooled over the legs, and number of legs."""
        try:
            manifest = self.manifest
            checked = self.is_checked and (manifest["files"] or self.status in RESULTS)
            faults = list_faults(self.folder, manifest) if checked else []
            table_faults = [fault for fault in faults if fault.split(":")[0] in TABLES]
            if table_faults:
                return RunEnd(Status.NOT_INTACT, "; ".join(table_faults)), {}, 1
            end = RunEnd(self.status, manifest["cause"] or "")
            if not self.wrote(METRICS_FILE):
                return end, {}, 1
            pooled = {name: values[: self.whole_cycles] for name, values in load_view("pool")(self.scores).items()}
            return end, pooled, int(as_array(self.scores.legs, "leg").max(initial=1))
        except (BadRun, OSError, ValueError) as error:
            status = Status.NOT_INTACT if os.path.lexists(self.folder / manifests.MANIFEST) else Status.UNFINISHED
            return RunEnd(status, str(error).splitlines()[0].removeprefix(f"{self.folder}: ")), {}, 1

    @property
    def outcome(self) -> RunEnd:
        """Outcome of the run, or why it is not intact. Never raises, so that tables can list damaged runs."""
        return self._summary[0]

    @property
    def completed(self) -> bool:
        """True if the run is intact and reached its last step."""
        return self.outcome.status == Status.COMPLETED

    @property
    def pooled(self) -> dict[str, Array]:
        """Metrics by name, each an array (whole cycles,) in SI units, pooled over the legs.

        Empty if the run has no metrics or is not intact.
        """
        return self._summary[1]

    @property
    def legs(self) -> int:
        """Number of legs with metrics."""
        return self._summary[2]

    @property
    def cycles_done(self) -> int:
        """Number of whole cycles with metrics."""
        return len(next(iter(self.pooled.values()), ()))

    def final(self, name: str) -> float:
        """Return a metric of the last whole cycle, pooled over the legs; NaN if the run lacks it.

        Raises BadInput if no metric has this name.
        """
        require_name("metric", name, self.pooled if name in self.pooled else load_view("metrics"))
        return float(self.pooled[name][-1]) if self.cycles_done and name in self.pooled else math.nan

    def report(self) -> Path:
        """Write the report of the run, as ``python -m cmacexp.report FOLDER`` does; returns the path of its page."""
        return load_view("report")(self)

    def to_xarray(self) -> Dataset:
        """Convert the trace to a Dataset with units: leg signals over (step, leg), body signals over (step).

        The boolean ``support`` replaces ``phase``. Raises CmacexpError if the extra ``xarray`` is not installed.
        """
        require_extra("xarray")
        import xarray

        trace = self.read_trace()
        signals: dict[str, Any] = {}
        for table in filter(None, (trace, trace.body)):
            dimensions = ("step", "leg") if table.legs else ("step",)
            for name in [name for name in table.names if name not in NO_VALUES]:
                signals[name] = (dimensions, table[name], {"units": trace.units[name]})
        signals["support"] = (("step", "leg"), trace.support)
        coordinates: dict[str, Any] = {name: ("step", trace.shared(name)) for name in ("step", "time", "cycle")}
        coordinates["leg"] = ("leg", np.arange(1, trace.legs + 1))
        return xarray.Dataset(signals, coordinates, {"folder": str(self.folder), "status": self.status})

    def view(self) -> None:
        """Show the run in the Rerun viewer: in a notebook below the cell, else in a window until it is closed."""
        load_view("view")(self)

    def __repr__(self) -> str:
        """Describe the run in one line: folder, scenario and outcome; for a damaged run the fault. Never raises."""
        try:
            text = f"{self.config.get('scenario')}, {self.ending}, {self.manifest['steps']} steps"
        except Exception as error:
            text = str(error)
        return in_one_line(f"Run({str(self.folder)!r}: {' '.join(text.split())})")

    def __str__(self) -> str:
        """Describe the run in one line, followed by a table of the main metrics per cycle."""
        try:
            lines = load_view("format")(self.scores)
        except Exception:
            lines = []
        return "\n".join([repr(self), *lines])

    def _repr_html_(self) -> str:
        """Describe the run and its main metrics per cycle as HTML, for notebooks."""
        import pandas as pd

        try:
            columns, rows = load_view("tabulate")(self.scores)
        except Exception:
            return f"<p>{escape(repr(self))}</p>"
        titles = ["cycle", *(f"{column.title} {column.unit}" for column in columns.values())]
        table = pd.DataFrame(rows, columns=titles).to_html(index=False) if rows else ""
        return f"<p>{escape(repr(self))}</p>{table}"


def sort_folders(folders: Iterable[Path]) -> list[Path]:
    """Sort folders, without duplicates, by the numbers in their names: job 2 before job 10."""
    unique = {folder.resolve() for folder in folders}
    return sorted(unique, key=lambda path: [(p.isdigit() and int(p), p) for p in re.split(r"(\d+)", str(path))])


def read_config(run: Run, trust: bool = False, consent: str = "trust=True") -> Config:
    """Read the typed config of a stored run; this imports the classes that the config names.

    Raises BadInput if a class is not of this package, unless ``trust`` is true; the message says that ``consent``
    (an argument or an option) allows it. Raises BadRun if the config was written by a version with other fields.
    """
    plain = run.config
    if not trust:
        require_shipped(plain, consent)
    try:
        return to_config(plain)
    except CmacexpError as error:
        raise BadRun(f"{run.folder}: its config is not one of this version ({error}); run it again") from None
