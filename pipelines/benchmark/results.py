"""What the benchmark runs: every method with its default setting, tuned for all tasks or each, and guarded.

A trial is one method with one setting in one world: it starts, something changes, it goes on with what it has learnt.
"""

import hashlib
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.addons.study.comparison import relative_to
from cmacexp.config import config_hash, to_plain
from cmacexp.config.component import custom_code_hash
from cmacexp.config.compose import compose_config
from cmacexp.data.files import write_atomically
from cmacexp.engine.launcher import Launcher
from cmacexp.engine.run import score_run
from cmacexp.errors import BadInput, describe_failure
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import exits_caught
from cmacexp.jit.sources import code_hash
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.registry import pool_legs
from cmacexp.study import Array, compute_final
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
BY_DEFAULT, FOR_ALL, FOR_EACH, GUARDED = SETTINGS = (
    "default", "one for all tasks", "one for each task", "default, guarded",
)  # fmt: skip
DEFAULT, GUARD = "", "learning.guard=freeze record.weights=true"
"""Settings, which are overrides as text: of every method; of those that learn, what users are advised to add."""
TRIAL = ["machine", "method", "overrides", "world"]
"""Columns of rows that belong to one trial, each to another task."""
SAME = ["machine", "task", "world"]
"""Columns with equal values in a row and in the one that it is relative to."""
TUNING = "tuning"
"""What is run in the worlds of tuning."""
RunPlan = Callable[[str, pd.DataFrame], pd.DataFrame]
"""See :func:`run_plan`, of the same machines and methods."""
Chosen = Mapping[Any, Mapping[str, str]]
"""By machine and method: the setting for all tasks by :data:`FOR_ALL`, that for each by the name of the task."""


def list_overrides(
    machine: Machine, method: Method, setting: str, world: Sequence[str], task: str = BEFORE
) -> list[str]:
    """Overrides of the run before the change, or of that after the change of a task."""
    before = [*world, f"cycles={machine.before}"]
    after = [*change_world(world, machine.changes.get(task, ())), f"cycles={machine.after}", "learning.start_cycle=1"]
    own = before if task == BEFORE else after
    return [*machine.overrides, *PROTOCOL, *method.overrides, *setting.split(), *own]


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
        scores, end = score_run(scenario), scenario.end
        if end.status == "interrupted":
            raise KeyboardInterrupt
        keep = next(
            (part.learnt for part in (scenario.controller, scenario.feedforward) if hasattr(part, "learnt")), dict
        )
        kept = exits_caught()(keep)() if end.status == COMPLETED else kept
        if end.guard and scenario.kept:  # an external method: the guard returned to what it knew in the best cycle
            kept = scenario.kept.get(end.guard[-1].restored, kept)
        status, cause, seconds = end.status, end.cause, end.processor_seconds / max(1, end.steps)
        metrics = pool_legs(scores)
    except Exception as error:
        status, cause = REFUSED if isinstance(error, BadInput) else FAILED, describe_failure(error)
    completed, axes = status == COMPLETED, [metrics[name] for name in AXES if name in metrics]
    errors = np.sqrt(sum(axis**2 for axis in axes)) if completed else np.full(machine.after, np.inf)
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


def run_trial(
    machine: Machine, method: Method, setting: str, world: Sequence[str], tasks: Sequence[str], folder: Path
) -> list[Row]:
    """Rows of all tasks in a world; an outcome in ``folder`` is used again.

    Each outcome is a file, which a task of a cluster leaves even if the others are ended.
    """
    expect_runs(1000)
    stages = {task: list_overrides(machine, method, setting, world, task) for task in (BEFORE, *tasks)}
    path = folder / f"{_find_hash(stages, machine.last)[:24]}.json"
    if path.is_file() and path.stat().st_size:  # or the machine lost its power before it was on the disk
        return list(json.loads(path.read_text(encoding="utf-8")))
    before, learnt = run_stage(machine, stages[BEFORE])
    rows = [
        {"task": t, **(run_stage(machine, stages[t], learnt or None)[0] if before["status"] == COMPLETED else before)}
        for t in tasks
    ]
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(path, durable=False) as new:
        new.write_text(json.dumps(rows), encoding="utf-8")
    return rows


def run_plan(
    machines: Mapping[str, Machine],
    methods: Mapping[str, Method],
    launcher: Launcher,
    folder: Path,
    what: str,
    plan: pd.DataFrame,
) -> pd.DataFrame:
    """Run the rows of a plan, nothing twice: the plan, and what came out of each row, however it was run.

    Args:
        machines: that take part, by name.
        methods: likewise, feedback only among them.
        each: runs work on workers.
        folder: of outcomes, which are used again.
        what: is run, for the terminal; in worlds of tuning if it is TUNING.
        plan: with the columns TRIAL, ``setting`` and ``task``.
    """
    different = plan[[*TRIAL, "task"]].drop_duplicates()
    trials = different.groupby(TRIAL, sort=False, as_index=False)["task"].agg(list)
    items = [
        (machines[machine], methods[method], setting, machines[machine].draw(world, what == TUNING), tasks, folder)
        for machine, method, setting, world, tasks in trials.itertuples(index=False)
    ]
    found = zip(trials[TRIAL].to_dict("records"), launcher.map_in_order(what, run_trial, items), strict=True)
    rows = pd.DataFrame({**trial, **row} for trial, own in found for row in own)
    return plan.merge(rows, how="left", on=[*TRIAL, "task"])


def _draw_value(draw: Draw, tuned: Any) -> str:
    """A value as an override says it: one of a list, or between two ends, evenly in its logarithm."""
    if isinstance(tuned, list):
        value = draw.choose(*tuned)
        return f"[{','.join(map(str, value))}]" if isinstance(value, list) else str(value)
    value = draw.even_log(*tuned)
    return f"{value:.4g}" if any(isinstance(end, float) for end in tuned) else str(round(value))


def draw_settings(method: Method, number: int) -> list[str]:
    """The default setting of a method, and ``number`` others from what its fields are tuned over; none without any.

    The same method always gets the same ones: the first of a larger number are those of a smaller one.
    """
    draw = Draw(zlib.crc32(method.name.encode()))
    drawn = [" ".join(f"++{key}={_draw_value(draw, tuned)}" for key, tuned in method.tuned) for _ in range(number)]
    return list(dict.fromkeys([DEFAULT, *drawn]))


def choose_setting(rows: pd.DataFrame) -> str:
    """The setting with which the fewest runs fail, of these that with the least mean score; of equal ones the first.

    ``rows`` have ``overrides``, in the order in which they were drawn, and ``score``, infinite where a run failed.
    """
    done = rows["score"].where(np.isfinite(rows["score"])).groupby(rows["overrides"], sort=False)
    ranked = done.agg(["count", "mean"]).sort_values(["count", "mean"], ascending=[False, True])
    return str(ranked.index[0])


def take_reference(rows: pd.DataFrame, columns: Any) -> Any:
    """Columns of feedback only on the machine, in the task and in the world of each row; of one column a series."""
    alone = rows[rows["method"] == ALONE].set_index(SAME)[columns]
    return rows[SAME].join(alone, on=SAME)[columns]


def tune(machines: Mapping[str, Machine], methods: Mapping[str, Method], run: RunPlan) -> Chosen:
    """The best settings of each method on each machine, by the mean score in the worlds of tuning."""
    drawn = {
        (name, method.name): settings
        for name, machine in machines.items()
        for method in methods.values()
        if len(settings := draw_settings(method, machine.draws)) > 1
    }
    if not drawn:
        return {}
    plan = pd.DataFrame(
        {"machine": name, "method": method, "setting": FOR_ALL, "task": task, "world": n, "overrides": setting}
        for (name, method), settings in (drawn | {(machine, ALONE): [DEFAULT] for machine, _ in drawn}).items()
        for setting in settings
        for task in TASKS
        for n in range(machines[name].tuning_worlds)
    )
    frame = run(TUNING, plan)
    reference = take_reference(frame, "end_error").to_numpy()
    frame = frame.assign(score=relative_to(frame["end_error"].to_numpy(), reference))
    return {
        place: {FOR_ALL: choose_setting(own)} | {task: choose_setting(rows) for task, rows in own.groupby("task")}
        for place, own in frame[frame["method"] != ALONE].groupby(["machine", "method"])
    }


def _find(own: Mapping[str, str], method: Method, kind: str, task: str) -> str:
    """The setting of a method whose chosen ones are its ``own``; a task that does not count has none."""
    guarded, general = DEFAULT if method.name == ALONE else GUARD, own.get(FOR_ALL, DEFAULT)
    return {BY_DEFAULT: DEFAULT, FOR_ALL: general, FOR_EACH: own.get(task, general), GUARDED: guarded}[kind]


def test(
    machines: Mapping[str, Machine],
    methods: Mapping[str, Method],
    run: RunPlan,
    chosen: Chosen,
) -> pd.DataFrame:
    """A row for each machine, method, kind of setting, task and world."""
    plan = pd.DataFrame(
        {
            "machine": name, "method": method.name, "setting": kind, "task": task, "world": number,
            "overrides": _find(chosen.get((name, method.name), {}), method, kind, task),
        }
        for name, machine in machines.items()
        for method in methods.values()
        for kind in SETTINGS
        if kind != GUARDED or method.learns or method.name == ALONE
        for task in machine.changes
        for number in range(machine.worlds)
    )  # fmt: skip
    return run("testing", plan)
