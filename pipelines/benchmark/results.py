"""The results of the benchmark: every method with its default setting, tuned for all tasks or each, and guarded."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.engine.pool import ParallelMap
from cmacexp.study.comparison import relative_to
from cmacexp.typing import Array
from pipelines.benchmark.entrants import ALONE, Method
from pipelines.benchmark.tasks import TASKS, Machine
from pipelines.benchmark.trial import BEFORE, Row, list_overrides, run_trial
from pipelines.worlds import Draw

Setting = tuple[str, ...]
DEFAULT: Setting = ()
DIGITS = 4
"""Of a drawn number."""
BY_DEFAULT, FOR_ALL, FOR_EACH, GUARDED = SETTINGS = (
    "default", "one for all tasks", "one for each task", "default, guarded",
)  # fmt: skip
SAME = ["machine", "task", "world"]
"""Columns with equal values in a row and in the one that it is relative to."""
TUNING = "tuning"
"""What is run in the worlds of tuning."""
GUARD: Setting = ("learning.guard=freeze", "record.weights=true")
"""Of methods that learn: what users are advised to add."""
Chosen = Mapping[tuple[str, str], Mapping[str, Setting]]
"""By machine and method: the setting for all tasks by :data:`FOR_ALL`, that for each by the name of the task."""
Key = tuple[str, str, Setting]
"""Machine, method and setting."""


Place = tuple[str, str, str, str]
"""Machine, method, kind of setting (in tuning its overrides) and task: rows of all worlds."""
COLUMNS = ("machine", "method", "setting", "task")


@dataclass(frozen=True)
class Bench:
    """What takes part, and how it is run."""

    machines: Mapping[str, Machine]
    methods: Mapping[str, Method]
    """Feedback only among them."""
    each: ParallelMap
    """Runs work on workers."""
    folder: Path
    """Of outcomes, which are used again."""

    def run(self, what: str, places: Mapping[Place, Setting]) -> pd.DataFrame:
        """Run settings, nothing twice: a row for each place and world, the same however it was run."""
        wanted: dict[Key, list[str]] = {}
        for (name, method, _, task), setting in places.items():
            wanted.setdefault((name, method, setting), []).append(task)
        keys, items, tunes = list[tuple[Key, int]](), [], what == TUNING
        for key, tasks in wanted.items():
            machine, learner = self.machines[key[0]], self.methods[key[1]]
            for number in range(machine.tuning_worlds if tunes else machine.worlds):
                world = machine.draw(number, tunes)
                stages = {task: list_overrides(machine, learner, key[2], world, task) for task in (BEFORE, *tasks)}
                keys.append((key, number))
                items.append((machine, stages, self.folder))
        found: dict[tuple[Key, str], list[Row]] = {}
        for (key, number), rows in zip(keys, self.each(what, run_trial, items, long=True), strict=True):
            for row in rows:
                found.setdefault((key, row["task"]), []).append({**row, "world": number})
        return pd.DataFrame(
            {**dict(zip(COLUMNS, place, strict=True)), **row, "overrides": " ".join(setting)}
            for place, setting in places.items()
            for row in found[(*place[:2], setting), place[3]]
        )


def _draw_value(draw: Draw, tuned: Any) -> str:
    """A value as an override says it: one of a list, or between two ends, evenly in its logarithm."""
    value = draw.choose(*tuned) if isinstance(tuned, list) else draw.even_log(*tuned)
    if isinstance(value, list):
        return "[" + ",".join(map(str, value)) + "]"
    if isinstance(tuned, tuple) and not any(isinstance(end, float) for end in tuned):
        return str(round(value))
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def draw_settings(method: Method, number: int) -> list[Setting]:
    """The default setting of a method, and ``number`` others from what its fields are tuned over; none without any.

    The same method always gets the same ones: the first of a larger number are those of a smaller one.
    """
    if not method.tuned:
        return [DEFAULT]
    draw = Draw(zlib.crc32(method.name.encode()))
    drawn = [tuple(f"++{key}={_draw_value(draw, tuned)}" for key, tuned in method.tuned) for _ in range(number)]
    return [DEFAULT, *dict.fromkeys(drawn)]


def choose_setting(settings: Sequence[Setting], scores: Mapping[Setting, Array]) -> Setting:
    """The setting with which the fewest runs fail, of these that with the least mean score; of equal ones the first.

    Args:
        settings: in the order in which they were drawn.
        scores: any shape, by setting; infinite where a run failed.
    """

    def rank(setting: Setting) -> tuple[int, float]:
        done = scores[setting][np.isfinite(scores[setting])]
        return scores[setting].size - done.size, float(done.mean()) if done.size else np.inf

    return min(settings, key=rank)


def tune(bench: Bench) -> tuple[Chosen, pd.DataFrame]:
    """The best settings of each method on each machine, by the mean score in the worlds of tuning.

    And the rows there with the setting for all tasks.
    """
    drawn = {
        (name, method.name): draw_settings(method, machine.draws)
        for name, machine in bench.machines.items()
        for method in bench.methods.values()
    }
    drawn = {place: settings for place, settings in drawn.items() if len(settings) > 1}
    alone = {(machine, ALONE): [DEFAULT] for machine, _ in drawn}
    places = {
        (*place, " ".join(setting), task): setting
        for place, settings in (drawn | alone).items()
        for setting in settings
        for task in TASKS
    }
    chosen: dict[tuple[str, str], dict[str, Setting]] = {}
    if not drawn:
        return chosen, pd.DataFrame(columns=[*COLUMNS, "overrides"])
    frame = bench.run(TUNING, places)
    alone_at = frame[frame["method"] == ALONE].set_index(SAME)["end_error"]
    reference = frame[SAME].join(alone_at, on=SAME)["end_error"]
    frame = frame.assign(score=relative_to(frame["end_error"].to_numpy(), reference.to_numpy()))
    for (machine, method), settings in drawn.items():
        own = frame[(frame["machine"] == machine) & (frame["method"] == method)]
        by_task = {FOR_ALL: own, **dict(iter(own.groupby("task", sort=False)))}
        chosen[machine, method] = {
            kind: choose_setting(
                settings, {each: rows["score"][rows["setting"] == " ".join(each)].to_numpy() for each in settings}
            )
            for kind, rows in by_task.items()
        }
    best = {place: " ".join(own[FOR_ALL]) for place, own in chosen.items()}
    kept = [row.setting == best.get((row.machine, row.method), "") for row in frame.itertuples()]
    return chosen, frame[kept].assign(setting=FOR_ALL)


def _find(chosen: Chosen, machine: str, method: str, kind: str, task: str) -> Setting:
    """The setting of a place."""
    own = chosen.get((machine, method), {})
    if kind == GUARDED and method != ALONE:
        return GUARD
    if kind in (BY_DEFAULT, GUARDED) or not own:
        return DEFAULT
    # A task that does not count has none of its own.
    return own.get(task if kind == FOR_EACH else FOR_ALL, own[FOR_ALL])


def test(bench: Bench, chosen: Chosen) -> pd.DataFrame:
    """A row for each machine, method, kind of setting, task and world."""
    places = [
        (machine, method, kind, task)
        for machine in bench.machines
        for method in bench.methods
        for kind in SETTINGS
        if kind != GUARDED or bench.methods[method].learns or method == ALONE
        for task in bench.machines[machine].changes
    ]
    return bench.run("testing", {place: _find(chosen, *place) for place in places})
