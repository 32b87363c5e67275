"""A run as it stands on disk, for those who look at it: manifest, and tables as DataFrames."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow.compute as pc
import pyarrow.parquet as pq

from cmacexp import manifest as manifests
from cmacexp.errors import BadRun
from cmacexp.keep import BODY, BODY_METRICS, METRICS, TRACE, Scores
from cmacexp.pooled import table_of_cycles
from cmacexp.table import read_table

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class StoredRun:
    """A finished run; tables are read when they are asked for.

    Raises:
        BadRun: on first use of something that is missing or cannot be read.
    """

    folder: Path

    @cached_property
    def manifest(self) -> manifests.Manifest:
        """How it ended, and of what config."""
        return manifests.read(self.folder)

    @property
    def config(self) -> dict[str, Any]:
        """As plain dictionaries."""
        return dict(self.manifest["config"])

    @property
    def status(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])

    def _table(self, name: str) -> "pd.DataFrame":
        try:
            return read_table(self.folder / name).to_pandas()
        except (OSError, ValueError) as error:
            raise BadRun(f"{self.folder / name}: cannot be read ({str(error).splitlines()[0]})") from None

    @cached_property
    def trace(self) -> "pd.DataFrame":
        """One row per step and leg."""
        return self._table(TRACE)

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per cycle and leg."""
        return self._table(METRICS)

    @property
    def walks(self) -> bool:
        """Whether there is a body on legs."""
        return BODY in self.manifest["files"]

    @cached_property
    def body(self) -> "pd.DataFrame":
        """One row per step; only of a run that :attr:`walks`."""
        return self._table(BODY)

    @cached_property
    def body_metrics(self) -> "pd.DataFrame":
        """One row per cycle; only of a run that :attr:`walks`."""
        return self._table(BODY_METRICS)

    def _summary(self) -> tuple[str, list[str], list[list[str]]]:
        """How it ended in a line, titles and rows of its main metrics."""
        manifest = self.manifest
        body = read_table(self.folder / BODY_METRICS) if BODY_METRICS in manifest["files"] else None
        titles, rows = table_of_cycles(Scores(read_table(self.folder / METRICS), body))
        cause = f" {manifest['cause']}" if manifest.get("cause") else ""
        line = f"{self.folder}: {self.config.get('scenario')}, {self.status}{cause}, {manifest['steps']} steps"
        return line, [f"{title} {unit}".rstrip() for title, unit in titles], rows

    def __repr__(self) -> str:
        """How it ended, and its main metrics per cycle."""
        try:
            line, titles, rows = self._summary()
        except (BadRun, OSError, KeyError) as error:
            return f"{type(self).__name__}({str(self.folder)!r}: {error})"
        widths = [max(map(len, column)) for column in zip(titles, *rows, strict=True)]
        lines = ("  ".join(cell.rjust(n) for cell, n in zip(row, widths, strict=True)) for row in [titles, *rows])
        return "\n".join([line, *lines] if rows else [line])

    def _repr_html_(self) -> str:
        """The same for a notebook."""
        line, titles, rows = self._summary()
        head = "".join(f"<th>{escape(title)}</th>" for title in titles)
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        return f"<p>{escape(line)}</p><table><tr>{head}</tr>{body}</table>"

    def cycles(self, numbers: Sequence[int], name: str = TRACE) -> "pd.DataFrame":
        """Rows of some cycles of the trace, or of another table, without holding all of a long run in memory."""
        try:
            return pq.read_table(self.folder / name, filters=pc.field("cycle").isin(list(numbers))).to_pandas()
        except (OSError, ValueError) as error:
            raise BadRun(f"{self.folder / name}: cannot be read ({str(error).splitlines()[0]})") from None

    def cycle(self, number: int, leg: int = 1) -> "pd.DataFrame":
        """Rows of one leg in one cycle; none if the run did not reach it."""
        trace = self.trace
        return trace[(trace["cycle"] == number) & (trace["leg"] == leg)]
