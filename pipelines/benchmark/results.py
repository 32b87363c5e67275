"""The results of the benchmark: every method with its default setting, tuned for all tasks or each, and guarded."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cmacexp.engine.pool import ParallelMap
from cmacexp.study import DataFrame
from cmacexp.study.comparison import relative_to
from cmacexp.typing import Array
from pipelines.benchmark.entrants import ALONE, Method
from pipelines.benchmark.tasks import TASKS, Machine
from pipelines.benchmark.trial import Trial, run_trial
from pipelines.benchmark.tuning import DEFAULT, Setting, choose_setting, draw_settings

BY_DEFAULT, FOR_ALL, FOR_EACH, GUARDED = SETTINGS = (
    "default", "one for all tasks", "one for each task", "default, guarded",
)  # fmt: skip
GUARD: Setting = ("learning.guard=freeze", "record.weights=true")
"""Of methods that learn: what users are advised to add."""
TOGETHER = 5
"""Worlds of a trial: what a worker does at a time."""
Rows = list[dict[str, Any]]
Chosen = Mapping[str, Setting]
"""Of a method on a machine: the setting for all tasks by :data:`FOR_ALL`, that for each by the name of the task."""


class Key(NamedTuple):
    """A method with a setting on a machine, in the worlds of tests or of tuning."""

    machine: str
    method: str
    setting: Setting = DEFAULT
    tuning: bool = False


class Bench:
    """Runs what is asked for on workers, and nothing twice.

    Args:
        machines: by name.
        methods: feedback only among them.
        each: runs work on workers.
        folder: of outcomes, which are used again.
    """

    def __init__(self, machines: Mapping[str, Machine], methods: Sequence[Method], each: ParallelMap, folder: Path):
        self.machines, self.methods = machines, {method.name: method for method in methods}
        self.each, self.folder = each, folder
        self.rows: dict[tuple[Key, str], Rows] = {}
        """Of each task, a row for each world."""
        self.seconds: dict[Key, float] = {}
        """Time of a step."""

    def run(self, what: str, wanted: Sequence[tuple[Key, Sequence[str]]]) -> None:
        """Run methods in tasks."""
        missing = {
            key: tuple(task for task in dict.fromkeys(tasks) if (key, task) not in self.rows)
            for key, tasks in dict(wanted).items()
        }
        trials = [(key, trial) for key, tasks in missing.items() if tasks for trial in self._split(key, tasks)]
        if not trials:
            return
        done = self.each(what, run_trial, [(trial, self.folder) for _, trial in trials], long=True)
        for (key, trial), (rows, seconds) in zip(trials, done, strict=True):
            self.seconds[key] = min(seconds, self.seconds.get(key, np.inf))
            for task in trial.tasks:
                self.rows.setdefault((key, task), []).extend(row for row in rows if row["task"] == task)

    def _split(self, key: Key, tasks: Sequence[str]) -> list[Trial]:
        machine = self.machines[key.machine]
        count = machine.tuning_worlds if key.tuning else machine.worlds
        return [
            Trial(
                machine,
                self.methods[key.method],
                key.setting,
                tuple(range(start, min(start + TOGETHER, count))),
                tuple(tasks),
                key.tuning,
            )
            for start in range(0, count, TOGETHER)
        ]

    def score(self, key: Key) -> Array:
        """(tasks, worlds): end errors over those of feedback only in the same world; infinite where a run failed."""
        own, alone = (
            np.array([[row["end_error"] for row in self.rows[each, task]] for task in TASKS])
            for each in (key, key._replace(method=ALONE, setting=DEFAULT))
        )
        return relative_to(own, alone)


def tune(bench: Bench) -> dict[tuple[str, str], Chosen]:
    """The best settings of each method on each machine, by the mean score in the worlds of tuning."""
    drawn = {
        (machine, method): draw_settings(bench.methods[method], bench.machines[machine].draws)
        for machine in bench.machines
        for method in bench.methods
    }
    tuned = {place: settings for place, settings in drawn.items() if len(settings) > 1}
    keys = [Key(*place, setting, True) for place, settings in tuned.items() for setting in settings]
    keys += [Key(machine, ALONE, DEFAULT, True) for machine in dict.fromkeys(machine for machine, _ in tuned)]
    bench.run("tuning", [(key, TASKS) for key in keys])
    chosen: dict[tuple[str, str], Chosen] = {}
    for place, settings in tuned.items():
        scores = {setting: bench.score(Key(*place, setting, True)) for setting in settings}
        best = {FOR_ALL: choose_setting(settings, scores)}
        for number, task in enumerate(TASKS):
            best[task] = choose_setting(settings, {setting: score[number] for setting, score in scores.items()})
        chosen[place] = best
    return chosen


def test(bench: Bench, chosen: Mapping[tuple[str, str], Chosen]) -> DataFrame:
    """A row for each machine, method, kind of setting, task and world; sorted, the same however it was run."""
    places = {
        (machine, method, kind, task): Key(
            machine,
            method,
            GUARD if kind == GUARDED and method != ALONE else _find(chosen.get((machine, method)), kind, task),
        )
        for machine in bench.machines
        for method in bench.methods
        for kind in SETTINGS
        if kind != GUARDED or bench.methods[method].learns or method == ALONE
        for task in bench.machines[machine].changes
    }
    wanted: dict[Key, list[str]] = {}
    for (*_, task), key in places.items():
        wanted.setdefault(key, []).append(task)
    bench.run("testing", list(wanted.items()))
    return _tabulate(bench, places)


def tabulate_tuning(bench: Bench, chosen: Mapping[tuple[str, str], Chosen]) -> DataFrame:
    """Likewise in the worlds of tuning, with the setting that was chosen there for all tasks."""
    machines = dict.fromkeys(machine for machine, _ in chosen)
    places = [*chosen, *((machine, ALONE) for machine in machines)]
    return _tabulate(
        bench,
        {
            (*place, FOR_ALL, task): Key(*place, _find(chosen.get(place), FOR_ALL, task), True)
            for place in places
            for task in TASKS
        },
    )


def _tabulate(bench: Bench, places: Mapping[tuple[str, str, str, str], Key]) -> DataFrame:
    import pandas as pd

    return pd.DataFrame(
        {"machine": machine, "method": method, "setting": kind, **row, "overrides": " ".join(key.setting)}
        for (machine, method, kind, task), key in places.items()
        for row in bench.rows[key, task]
    )


def _find(chosen: Chosen | None, kind: str, task: str) -> Setting:
    if chosen is None or kind == BY_DEFAULT:
        return DEFAULT
    return chosen.get(task if kind == FOR_EACH else FOR_ALL, chosen[FOR_ALL])  # a task that does not count has none
