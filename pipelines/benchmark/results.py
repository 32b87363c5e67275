"""What the benchmark runs: every method with its default setting, tuned for all tasks or each, and guarded.

A trial is one method with one setting in one world: it starts, something changes, it goes on with what it has learnt.
"""

import hashlib
import json
import zlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.config import config_hash, to_plain
from cmacexp.config.component import custom_code_hash
from cmacexp.config.compose import compose_config
from cmacexp.data.files import write_atomically
from cmacexp.engine.failure import describe_failure
from cmacexp.engine.pool import ParallelMap
from cmacexp.engine.run import score_scenario
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import exits_caught
from cmacexp.jit.sources import code_hash
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.pooling import pool_legs
from cmacexp.study import Array, compute_final
from cmacexp.study.comparison import relative_to
from cmacexp.terminal.messages import announce_compiling
from cmacexp.typing import Weights
from pipelines.benchmark.entrants import ALONE, PROTOCOL, TASKS, VERSION, Machine, Method, change_world
from pipelines.worlds import Draw

COMPLETED, REFUSED, FAILED = "completed", "refused", "failed"
AXES = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse_z")
ENDS = {"force": "force_rmse", "feedback": "feedback_rms", "torque_peak": "torque_peak", "energy": "energy"}
"""Columns that hold the median of a metric over the last cycles."""
Row = dict[str, Any]
BEFORE = ""
"""The stage before a change, beside those by task."""
Setting = tuple[str, ...]
DEFAULT: Setting = ()
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
Place = tuple[str, str, str, str]
"""Machine, method, kind of setting (in tuning its overrides) and task: rows of all worlds."""
COLUMNS = ("machine", "method", "setting", "task")


def list_overrides(
    machine: Machine, method: Method, setting: Sequence[str], world: Sequence[str], task: str = BEFORE
) -> list[str]:
    """Overrides of the run before the change, or of that after the change of a task."""
    own = [*world, f"cycles={machine.before}"]
    if task != BEFORE:
        changed = change_world(world, machine.changes[task])
        own = [*changed, f"cycles={machine.after}", "learning.start_cycle=1"]
    return [*machine.overrides, *PROTOCOL, *method.overrides, *setting, *own]


def _find_hash(stages: Mapping[str, Sequence[str]], last: int) -> str:
    """Of all that an outcome depends on: the code of a custom method included, or why it cannot be composed."""
    try:
        config = compose_config(stages[BEFORE])
        own = [custom_code_hash(config), config_hash(to_plain(config))]
    except BadInput as error:  # its runs say so
        own = [str(error)]
    return hashlib.sha256(json.dumps([VERSION, code_hash(), *own, stages, last]).encode()).hexdigest()


def run_stage(machine: Machine, overrides: Sequence[str], learnt: Weights | None = None) -> tuple[Row, Weights]:
    """A row of the results, and what is learnt; a method that refuses, raises or gives NaN has failed, and says why.

    Errors of a method that did not complete are infinite. ``errors`` (cycles,) are those of the feet in transfer over
    all axes, m; ``seconds`` is the time of a step.
    """
    metrics, seconds = dict[str, Array](), np.nan
    kept: Weights = {}
    try:
        scenario = make_scenario(compose_config(overrides), learnt)
        end, scorer = score_scenario(scenario)
        if end.status == "interrupted":
            raise KeyboardInterrupt
        keep = next(
            (part.learnt for part in (scenario.controller, scenario.feedforward) if hasattr(part, "learnt")), dict
        )
        kept = exits_caught()(keep)() if end.status == COMPLETED else kept
        if end.events and scenario.kept:  # an external method: the guard returned to what it knew in the best cycle
            kept = scenario.kept.get(end.events[-1].restored, kept)
        status, cause, seconds = end.status, end.cause, end.processor_seconds / max(1, end.steps)
        metrics = pool_legs(scorer.scores)
    except Exception as error:
        status, cause = REFUSED if isinstance(error, BadInput) else FAILED, describe_failure(error)
    completed, errors = status == COMPLETED, np.full(machine.after, np.inf)
    if completed:
        errors = np.sqrt(sum(metrics[name] ** 2 for name in AXES if name in metrics))
    return {
        "status": status,
        "cause": cause,
        "end_error": compute_final(errors, machine.last),
        "first_error": float(errors[0]),
        "worst_error": float(errors.max()),
        **{key: compute_final(metrics[name], machine.last) if completed else np.inf for key, name in ENDS.items()},
        "bytes": float(sum(np.asarray(own).nbytes for own in kept.values())) if completed else np.nan,
        "errors": errors.tolist(),
        "seconds": seconds,
    }, kept


def run_trial(machine: Machine, stages: Mapping[str, Sequence[str]], folder: Path) -> list[Row]:
    """Rows of all tasks in a world; an outcome in ``folder`` is used again.

    ``stages`` are the overrides of the run before the change, by BEFORE, and of those after it, by their tasks. Each
    outcome is a file, which a task of a cluster leaves even if the others are ended.
    """
    announce_compiling()
    expect_runs(1000)
    path = folder / f"{_find_hash(stages, machine.last)[:24]}.json"
    if path.is_file():
        return list(json.loads(path.read_text(encoding="utf-8")))
    before, learnt = run_stage(machine, stages[BEFORE])
    done = before["status"] == COMPLETED
    rows = [
        {"task": task, **(run_stage(machine, stages[task], learnt or None)[0] if done else before)}
        for task in stages
        if task != BEFORE
    ]
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as new:
        new.write_text(json.dumps(rows), encoding="utf-8")
    return rows


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
        trials, tunes = defaultdict[tuple[str, str, Setting, int], list[str]](list), what == TUNING
        for (name, method, _, task), setting in places.items():
            machine = self.machines[name]
            for number in range(machine.tuning_worlds if tunes else machine.worlds):
                trials[name, method, setting, number].append(task)
        items = [self._list_stages(*key, tasks, tunes) for key, tasks in trials.items()]
        found = defaultdict[tuple[Any, ...], list[Row]](list)
        for key, rows in zip(trials, self.each(what, run_trial, items, long=True), strict=True):
            for row in rows:
                found[*key[:3], row["task"]].append({**row, "world": key[3]})
        return pd.DataFrame(
            {**dict(zip(COLUMNS, place, strict=True)), **row, "overrides": " ".join(setting)}
            for place, setting in places.items()
            for row in found[*place[:2], setting, place[3]]
        )

    def _list_stages(
        self, name: str, method: str, setting: Setting, number: int, tasks: list[str], tunes: bool
    ) -> Any:
        """What :func:`run_trial` takes."""
        machine = self.machines[name]
        world, learner = machine.draw(number, tunes), self.methods[method]
        stages = {task: list_overrides(machine, learner, setting, world, task) for task in (BEFORE, *tasks)}
        return machine, stages, self.folder


def _draw_value(draw: Draw, tuned: Any) -> str:
    """A value as an override says it: one of a list, or between two ends, evenly in its logarithm."""
    value = draw.choose(*tuned) if isinstance(tuned, list) else draw.even_log(*tuned)
    if isinstance(value, list):
        return "[" + ",".join(map(str, value)) + "]"
    if isinstance(tuned, tuple) and not any(isinstance(end, float) for end in tuned):
        return str(round(value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def draw_settings(method: Method, number: int) -> list[Setting]:
    """The default setting of a method, and ``number`` others from what its fields are tuned over; none without any.

    The same method always gets the same ones: the first of a larger number are those of a smaller one.
    """
    draw = Draw(zlib.crc32(method.name.encode()))
    drawn = [tuple(f"++{key}={_draw_value(draw, tuned)}" for key, tuned in method.tuned) for _ in range(number)]
    return [*dict.fromkeys([DEFAULT, *drawn])]


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
        (name, method.name): settings
        for name, machine in bench.machines.items()
        for method in bench.methods.values()
        if len(settings := draw_settings(method, machine.draws)) > 1
    }
    if not drawn:
        return {}, pd.DataFrame(columns=[*COLUMNS, "overrides"])
    alone = {(machine, ALONE): [DEFAULT] for machine, _ in drawn}
    places = {
        (*place, " ".join(setting), task): setting
        for place, settings in (drawn | alone).items()
        for setting in settings
        for task in TASKS
    }
    frame, chosen = bench.run(TUNING, places), dict[tuple[str, str], dict[str, Setting]]()
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
    places = {
        (machine, method, kind, task): _find(chosen, machine, method, kind, task)
        for machine in bench.machines
        for method in bench.methods
        for kind in SETTINGS
        if kind != GUARDED or bench.methods[method].learns or method == ALONE
        for task in bench.machines[machine].changes
    }
    return bench.run("testing", places)
