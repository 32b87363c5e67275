"""The results of a study: a table with one row a run, selected by config, and the runs themselves."""

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
    """One run: what it was asked for, and what it gave."""

    run: Run
    settings: Mapping[str, Any]
    """Labels, chosen options and config fields, by key."""
    shown: Mapping[str, Any]
    """The settings that the study sets."""
    measures: Mapping[str, float]
    seeded: bool = False
    """Whether the study repeats it for other seeds."""

    def history(self, name: str) -> Array:
        """(cycles,): a metric in the whole cycles of the run, see :func:`cmacexp.metrics.registry.find_history`."""
        return find_history(self.run.pooled, name)


class NoSuchRuns(BadInput):
    """A selection without runs, of a setting that they have: a sample must never be empty."""


def read_row(
    folder: Path,
    labels: Mapping[str, Any],
    options: Mapping[str, str],
    keys: Sequence[str],
    measured: Mapping[str, float],
    seeded: bool,
) -> RunRow:
    """Read a run of which further measures are known, and whether it is repeated for other seeds."""
    run = Run(folder)
    _ = run.outcome  # read once
    settings = {**run.settings, **options, **labels}
    return RunRow(run, settings, {key: settings.get(key) for key in keys} | dict(labels), measured, seeded)


@dataclass(frozen=True)
class Results:
    """The runs of a study, or a selection of them."""

    rows: Sequence[RunRow]
    computed: Mapping[str, DataFrame] = field(default_factory=dict)
    """Tables that the study computes besides its runs."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def has_one_seed(self) -> bool:
        """Whether runs that are to be repeated for other seeds were not."""
        return len({row.settings.get("seed") for row in self.rows if row.seeded}) == 1

    @property
    def runs(self) -> list[Run]:
        """The runs, with their traces."""
        return [row.run for row in self.rows]

    @property
    def run(self) -> Run:
        """The only run, or the one of the first seed."""
        return self.runs[0]

    def values(self, key: str) -> list[Any]:
        """The different values of a setting, in the order of the runs.

        Raises:
            BadInput: none of them has this setting.
        """
        known = {name for row in self.rows for name in row.settings}
        if self.rows and key not in known:
            raise BadInput("setting", key, f"no run has it{suggest(str(key), sorted(known))}")
        values = [row.settings.get(key) for row in self.rows]
        return list(dict.fromkeys(format_setting(value) if isinstance(value, list) else value for value in values))

    def value(self, key: str) -> Any:
        """The value of a setting that all runs share.

        Raises:
            ValueError: they do not share it.
        """
        found = self.values(key)
        if len(found) != 1:
            raise ValueError(f"{key} has {len(found)} values in these runs: {', '.join(map(str, found))}")
        return found[0]

    def select(self, settings: Mapping[str, Any] | None = None, /, **more: Any) -> "Results":
        """The runs with these values of labels, options and config fields; a list means any of its values.

        Raises:
            NoSuchRuns: there is none.
            BadInput: none of them has such a setting.
        """
        wanted = {**(settings or {}), **more}
        rows: Sequence[RunRow] = self.rows
        for key, value in wanted.items():
            before, allowed = rows, value if isinstance(value, list | tuple) else [value]
            rows = [row for row in before if any(_same(row.settings.get(key), each) for each in allowed)]
            if not rows:
                present = Results(before).values(key)
                raise NoSuchRuns(key, value, f"no run has it; they have {', '.join(map(repr, present))}")
        return Results(rows, self.computed)

    def by(self, key: str) -> "dict[Any, Results]":
        """The runs by the values of a setting."""
        return {value: self.select({key: value}) for value in self.values(key)}

    def measure(self, name: str) -> Array:
        """(runs,): a measure of the study, or a metric in the last whole cycle.

        Raises:
            BadInput: there is neither.
        """
        if name in ALL_METRICS:
            return np.array([h[-1] if len(h := row.history(name)) else np.nan for row in self.rows])
        for row in self.rows:
            require_name("measure", name, row.measures)
        return np.array([row.measures[name] for row in self.rows])

    def at(self, cycle: int, name: str) -> Array:
        """(runs,): a metric in one cycle; of a run that ended before, the worst value that there is.

        Raises:
            BadInput: the cycle is below 1, a run was to end before it, or no such metric.
        """
        worst = worst_value(name)
        asked = min((row.run.cycles_done for row in self.rows if row.run.completed), default=cycle)
        require(1 <= cycle <= asked, "cycle", cycle, f"must be from 1 to {asked}, the cycles of a run that completed")
        histories = [row.history(name) for row in self.rows]
        return np.array([float(h[cycle - 1]) if cycle <= len(h) else worst for h in histories])

    def end(self, name: str, cycles: int = LAST_CYCLES) -> Array:
        """(runs,): final value of a metric, over the last cycles; of a run that did not complete, the worst value."""
        worst = worst_value(name)
        has_it = all(len(row.history(name)) for row in self.rows if row.run.completed)
        require(has_it, "metric", name, "these machines do not have it; a robot has all")
        return np.array(
            [compute_final(row.history(name), cycles) if row.run.completed else worst for row in self.rows]
        )

    def history(self, name: str) -> list[Array]:
        """A metric in all whole cycles of each run."""
        return [found for row in self.rows if len(found := row.history(name))]

    @property
    def completed(self) -> list[bool]:
        """Whether each run reached its end."""
        return [row.run.completed for row in self.rows]

    @property
    def done(self) -> Array:
        """(runs,): the share of its cycles that each run did."""
        return np.array([row.run.cycles_done / row.settings["cycles"] for row in self.rows])

    @property
    def lasted(self) -> Array:
        """(runs,): the share of its time that each run did."""
        return np.array([run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]) for run in self.runs])

    @property
    def cycles(self) -> list[int]:
        """Whole cycles of each run."""
        return [row.run.cycles_done for row in self.rows]

    @property
    def table(self) -> DataFrame:
        """One row a run: what the study sets, how the run ended, its measures, and its metrics in the last cycle."""
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
    """What a metric of a run that ended before counts as; NaN if neither direction is better; raises BadInput."""
    require_name("metric", name, ALL_METRICS)
    better = ALL_METRICS[name].better
    return float("nan") if better == NEITHER else 0.0 if better == LARGE else float("inf")


def _same(value: Any, wanted: Any) -> bool:
    return bool(value == wanted) or format_setting(value) == format_setting(wanted)


def _plain(row: RunRow) -> dict[str, Any]:
    """What the study sets, as values of columns; null is an empty field, in a column of numbers too."""
    return {
        key: value if value is None or isinstance(value, int | float | str) else format_setting(value)
        for key, value in row.shown.items()
    }
