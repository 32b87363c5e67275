"""A run on disk: its manifest, and its tables as DataFrames."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from cmacexp.config import Config, to_config
from cmacexp.config.schema import count_steps
from cmacexp.data import manifest as manifests
from cmacexp.data.parquet import read_cycles, read_table
from cmacexp.data.tables import BODY_FILE, BODY_METRICS_FILE, METRICS_FILE, TRACE_FILE, Scores
from cmacexp.errors import BadRun, CmacexpError

if TYPE_CHECKING:
    import pandas as pd


def _count_steps(manifest: manifests.Manifest) -> int:
    return count_steps(manifest["config"]["gait"]["cycle_time"], manifest["config"]["sampling_period"])


def select_whole(manifest: manifests.Manifest, kept: Iterable[int]) -> list[int]:
    """Those of the cycles in a trace that are whole there, but for the thinning of their steps.

    ``kept`` are those of which the trace has a step: a run that did not complete keeps its last steps.
    """
    asked = manifest["config"].get("record", {}).get("cycles")
    whole = manifest["steps"] // _count_steps(manifest)
    return [cycle for cycle in kept if cycle <= whole and (asked is None or cycle in asked)]


@dataclass(frozen=True)
class StoredRun:
    """A finished run; tables are read when they are asked for.

    Raises:
        BadRun: on first use of a file that is missing, has changed or cannot be read.
    """

    folder: Path

    @cached_property
    def manifest(self) -> manifests.Manifest:
        """How it ended, and of what config."""
        manifest = manifests.read(self.folder)
        if "kind" in manifest:
            raise BadRun(f"{self.folder}: holds a {manifest['kind']}, not a run; give the folder of a run")
        return manifest

    @property
    def config(self) -> dict[str, Any]:
        """As plain dictionaries."""
        return dict(self.manifest["config"])

    @property
    def status(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])

    @property
    def ending(self) -> str:
        """Status and cause in one line."""
        return f"{self.status} {self.manifest.get('cause') or ''}".rstrip()

    @property
    def steps_per_cycle(self) -> int:
        """Samples of one cycle."""
        return _count_steps(self.manifest)

    @property
    def whole_cycles(self) -> int:
        """Number of cycles that the run completed."""
        return int(self.manifest["steps"]) // self.steps_per_cycle

    def select_whole(self, kept: Iterable[int]) -> list[int]:
        """Those of the cycles ``kept`` in the trace that are whole, see :func:`select_whole`."""
        return select_whole(self.manifest, kept)

    @property
    def last_cycle(self) -> int:
        """Number of the cycle in which the run ended."""
        return -(-int(self.manifest["steps"]) // self.steps_per_cycle)

    def _table(self, name: str, read: Callable[[Path], pa.Table] = read_table) -> "pd.DataFrame":
        _ = self.manifest  # without one there is nothing that the table could be compared with
        return read(self.folder / name).to_pandas()

    @cached_property
    def trace(self) -> "pd.DataFrame":
        """One row per step and leg."""
        return self._table(TRACE_FILE)

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per cycle and leg."""
        return self._table(METRICS_FILE)

    @property
    def walks(self) -> bool:
        """Whether there is a body on legs."""
        return BODY_METRICS_FILE in self.manifest["files"]

    @cached_property
    def body(self) -> "pd.DataFrame":
        """One row per step; only of a run that :attr:`walks`."""
        return self._table(BODY_FILE)

    @cached_property
    def body_metrics(self) -> "pd.DataFrame":
        """One row per cycle; only of a run that :attr:`walks`."""
        return self._table(BODY_METRICS_FILE)

    @property
    def scores(self) -> Scores:
        """The metrics of every cycle, as Arrow tables."""
        body = read_table(self.folder / BODY_METRICS_FILE) if BODY_METRICS_FILE in self.manifest["files"] else None
        return Scores(read_table(self.folder / METRICS_FILE), body)

    def cycles(self, numbers: Sequence[int], name: str = TRACE_FILE) -> "pd.DataFrame":
        """Rows of some cycles of the trace, or of another table, without holding all of a long run in memory."""
        return self._table(name, partial(read_cycles, numbers=numbers))


def read_config(run: StoredRun) -> Config:
    """The typed config of a stored run; raises BadRun if another version with other fields wrote it."""
    plain = run.config
    try:
        return to_config(plain)
    except CmacexpError as error:
        raise BadRun(f"{run.folder}: its config is not one of this version ({error}); run it again") from None
