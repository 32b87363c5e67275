"""The results of the benchmark: every method with its default setting, tuned for all tasks or each, and guarded."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from cmacexp.engine.pool import ParallelMap
from cmacexp.study.comparison import relative_to
from cmacexp.typing import Array
from pipelines.benchmark.entrants import ALONE, Method
from pipelines.benchmark.tasks import TASKS, Machine
from pipelines.benchmark.trial import Row, Trial, run_trial
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


class Place(NamedTuple):
    """Rows of the table of results: those of all worlds."""

    machine: str
    method: str
    setting: str
    """Its kind, one of SETTINGS; in tuning its overrides."""
    task: str


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
        for place, setting in places.items():
            wanted.setdefault((place.machine, place.method, setting), []).append(place.task)
        keys, trials = list[Key](), []
        for key, tasks in wanted.items():
            machine, tunes = self.machines[key[0]], what == TUNING
            for world in range(machine.tuning_worlds if tunes else machine.worlds):
                keys.append(key)
                trials.append(Trial(machine, self.methods[key[1]], key[2], world, tuple(dict.fromkeys(tasks)), tunes))
        found: dict[tuple[Key, str], list[Row]] = {}
        done = self.each(what, run_trial, [(trial, self.folder) for trial in trials], long=True)
        for key, rows in zip(keys, done, strict=True):
            for row in rows:
                found.setdefault((key, row["task"]), []).append(row)
        return pd.DataFrame(
            {**place._asdict(), **row, "overrides": " ".join(setting)}
            for place, setting in places.items()
            for row in found[(place.machine, place.method, setting), place.task]
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
        Place(*place, " ".join(setting), task): setting
        for place, settings in (drawn | alone).items()
        for setting in settings
        for task in TASKS
    }
    frame, chosen = bench.run(TUNING, places), dict[tuple[str, str], dict[str, Setting]]()
    if not drawn:
        return chosen, frame
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


def _find(chosen: Chosen, place: Place) -> Setting:
    """The setting of a place."""
    own = chosen.get((place.machine, place.method), {})
    if place.setting == GUARDED and place.method != ALONE:
        return GUARD
    if place.setting in (BY_DEFAULT, GUARDED) or not own:
        return DEFAULT
    return own.get(
        place.task if place.setting == FOR_EACH else FOR_ALL, own[FOR_ALL]
    )  # a task that counts not has none


def test(bench: Bench, chosen: Chosen) -> pd.DataFrame:
    """A row for each machine, method, kind of setting, task and world."""
    places = [
        Place(machine, method, kind, task)
        for machine in bench.machines
        for method in bench.methods
        for kind in SETTINGS
        if kind != GUARDED or bench.methods[method].learns or method == ALONE
        for task in bench.machines[machine].changes
    ]
    return bench.run("testing", {place: _find(chosen, place) for place in places})
