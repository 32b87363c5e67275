"""The results of a study: its runs, selected by their settings, and a table with one row per run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.errors import BadInput, require, require_name, suggest
from cmacexp.metrics.metric import LARGE, NEITHER
from cmacexp.metrics.registry import ALL_METRICS, FINAL_CYCLES, compute_final, find_history, format_setting
from cmacexp.typing import Array, DataFrame

Measure = Callable[[Run], float]
Measures = Mapping[str, Measure]
LAST_CYCLES = FINAL_CYCLES


@dataclass(frozen=True)
class RunRow:
    """A run with its settings and measures."""

    run: Run
    settings: Mapping[str, Any]
    """Labels, chosen options and config fields, by key."""
    shown: Mapping[str, Any]
    """The settings that the study sets: its columns in the table of results."""
    measures: Mapping[str, float]
    seeded: bool = False
    """True if the study repeats the run for other seeds."""

    def history(self, name: str) -> Array:
        """Return a metric in the whole cycles of the run, (cycles,).

        See :func:`cmacexp.metrics.registry.find_history`.
        """
        return find_history(self.run.pooled, name)


class NoSuchRuns(BadInput):
    """Error of a selection that contains no run, although runs have the setting: no sample may be empty."""


def read_row(
    folder: Path,
    labels: Mapping[str, Any],
    options: Mapping[str, str],
    keys: Sequence[str],
    measured: Mapping[str, float],
    seeded: bool,
) -> RunRow:
    """Read the run in a folder as a row of the results.

    ``keys`` are the settings that the study sets, ``options`` the chosen option by config group, ``measured`` the
    measures of the study; ``seeded`` is true if the run is repeated for other seeds.
    """
    run = Run(folder)
    _ = run.outcome  # cached from here on
    settings = {**run.settings, **options, **labels}
    return RunRow(run, settings, {key: settings.get(key) for key in keys} | dict(labels), measured, seeded)


@dataclass(frozen=True)
class Results:
    """The runs of a study, or a selection of them."""

    rows: Sequence[RunRow]
    computed: Mapping[str, DataFrame] = field(default_factory=dict)
    """Further tables that the study computes, by name."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def has_one_seed(self) -> bool:
        """True if the seeded runs have a single seed."""
        return len({row.settings.get("seed") for row in self.rows if row.seeded}) == 1

    @property
    def has_picked_conditions(self) -> bool:
        """True if the runs differ only in settings chosen by hand: their one seed is not varied by the study."""
        seeds = {row.settings.get("seed") for row in self.rows}
        return len(seeds) == 1 and not any(row.seeded for row in self.rows)

    @property
    def runs(self) -> list[Run]:
        """The runs, which give access to their traces."""
        return [row.run for row in self.rows]

    @property
    def run(self) -> Run:
        """The first run: the only one, or the one with the first seed."""
        return self.runs[0]

    def values(self, key: str) -> list[Any]:
        """List the distinct values of a setting, in the order of the runs.

        Raises:
            BadInput: no run has this setting.
        """
        keys = {name for row in self.rows for name in row.settings}
        if self.rows and key not in keys:
            raise BadInput("setting", key, f"no run has it{suggest(str(key), sorted(keys))}")
        values = [row.settings.get(key) for row in self.rows]
        return list(dict.fromkeys(format_setting(value) if isinstance(value, list) else value for value in values))

    def value(self, key: str) -> Any:
        """Return the value of a setting that is equal in all runs.

        Raises:
            ValueError: the runs have different values.
        """
        values = self.values(key)
        if len(values) != 1:
            raise ValueError(f"{key} has {len(values)} values in these runs: {', '.join(map(str, values))}")
        return values[0]

    def select(self, settings: Mapping[str, Any] | None = None, /, **more: Any) -> "Results":
        """Select the runs with these values of labels, options and config fields; a list allows any of its values.

        Raises:
            NoSuchRuns: no run has these values.
            BadInput: no run has such a setting.
        """
        wanted = {**(settings or {}), **more}
        rows: Sequence[RunRow] = self.rows
        for key, value in wanted.items():
            candidates = rows
            allowed = value if isinstance(value, list | tuple) else [value]
            rows = [row for row in candidates if any(_same(row.settings.get(key), option) for option in allowed)]
            if not rows:
                present = Results(candidates).values(key)
                raise NoSuchRuns(key, value, f"no run has it; they have {', '.join(map(repr, present))}")
        return Results(rows, self.computed)

    def by(self, key: str) -> "dict[Any, Results]":
        """Group the runs by the values of a setting, in the order of the runs."""
        return {value: self.select({key: value}) for value in self.values(key)}

    def measure(self, name: str) -> Array:
        """Return a measure of the study, or a metric in the last whole cycle, of each run, (runs,).

        Raises:
            BadInput: there is no such measure or metric.
        """
        if name in ALL_METRICS:
            return np.array([h[-1] if len(h := row.history(name)) else np.nan for row in self.rows])
        for row in self.rows:
            require_name("measure", name, row.measures)
        return np.array([row.measures[name] for row in self.rows])

    def at(self, cycle: int, name: str) -> Array:
        """Return a metric in one cycle of each run, (runs,); the worst value if the run ended before that cycle.

        Raises:
            BadInput: the cycle is below 1 or after the last cycle of a completed run, or there is no such metric.
        """
        worst = worst_value(name)
        last = min((row.run.cycles_done for row in self.rows if row.run.completed), default=cycle)
        require(1 <= cycle <= last, "cycle", cycle, f"must be from 1 to {last}, the cycles of a run that completed")
        histories = [row.history(name) for row in self.rows]
        return np.array([float(h[cycle - 1]) if cycle <= len(h) else worst for h in histories])

    def end(self, name: str, cycles: int = LAST_CYCLES) -> Array:
        """Return the final value of a metric over the last ``cycles`` of each run, (runs,).

        A run that did not complete has the worst value.

        Raises:
            BadInput: there is no such metric, or a completed run does not have it.
        """
        worst = worst_value(name)
        has_it = all(len(row.history(name)) for row in self.rows if row.run.completed)
        require(has_it, "metric", name, "these machines do not have it; a robot has all")
        return np.array(
            [compute_final(row.history(name), cycles) if row.run.completed else worst for row in self.rows]
        )

    def history(self, name: str) -> list[Array]:
        """Return a metric in all whole cycles of each run, (cycles,) per run; runs without it are left out."""
        return [values for row in self.rows if len(values := row.history(name))]

    @property
    def completed(self) -> list[bool]:
        """True for each run that reached its end."""
        return [row.run.completed for row in self.rows]

    @property
    def done(self) -> Array:
        """Completed cycles over planned cycles of each run, (runs,)."""
        return np.array([row.run.cycles_done / row.settings["cycles"] for row in self.rows])

    @property
    def lasted(self) -> Array:
        """Simulated time over planned time of each run, (runs,)."""
        return np.array([run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]) for run in self.runs])

    @property
    def cycles(self) -> list[int]:
        """Number of whole cycles of each run."""
        return [row.run.cycles_done for row in self.rows]

    @property
    def table(self) -> DataFrame:
        """Table with one row per run: settings of the study, outcome, measures, and metrics in the last cycle."""
        import pandas as pd

        frame = pd.DataFrame(
            {
                **_plain(row),
                "cycles": row.run.cycles_done,
                "status": row.run.outcome.status,
                "cause": row.run.outcome.cause,
            }
            | dict(row.measures)
            | {name: row.run.final(name) for name in row.run.pooled}
            for row in self.rows
        )
        mixed = [name for name in frame if len({isinstance(value, str) for value in frame[name].dropna()}) > 1]
        return frame.assign(**{name: frame[name].map(format_setting, na_action="ignore") for name in mixed})


def worst_value(name: str) -> float:
    """Return the worst possible value of a metric, which counts for runs that ended early.

    It is NaN if neither small nor large values are better.

    Raises:
        BadInput: there is no such metric.
    """
    require_name("metric", name, ALL_METRICS)
    better = ALL_METRICS[name].better
    return float("nan") if better == NEITHER else 0.0 if better == LARGE else float("inf")


def _same(value: Any, wanted: Any) -> bool:
    return bool(value == wanted) or format_setting(value) == format_setting(wanted)


def _plain(row: RunRow) -> dict[str, Any]:
    """Convert the settings of the study in a row to numbers and texts; None becomes an empty field of any column."""
    return {
        key: value if value is None or isinstance(value, int | float | str) else format_setting(value)
        for key, value in row.shown.items()
    }
