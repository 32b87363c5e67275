"""Runs of the benchmark: every method with its default setting, tuned for all tasks or for each, and guarded.

A trial is one method with one setting in one world: it walks, a task changes something, and it goes on with its
learnt weights.
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
from cmacexp.data.manifest import read_environment
from cmacexp.engine.launcher import Launcher
from cmacexp.engine.run import score_run
from cmacexp.errors import BadInput, describe_failure
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import exits_caught
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.registry import pool_legs
from cmacexp.study import Array, compute_final
from cmacexp.typing import Weights
from pipelines.benchmark.entrants import ALONE, PROTOCOL, TASKS, VERSION, Machine, Method, change_world
from pipelines.worlds import Draw

COMPLETED, REFUSED, FAILED = "completed", "refused", "failed"
AXES = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse_z")
ENDS = {"force": "force_rmse", "feedback": "feedback_rms", "torque_peak": "torque_peak", "energy": "energy"}
"""Columns that hold the median of a metric over the last cycles, and the metric."""
Row = dict[str, Any]
BEFORE = ""
"""Name of the stage before a change; the other stages have the names of tasks."""
BY_DEFAULT, FOR_ALL, FOR_EACH, GUARDED = SETTINGS = (
    "default", "one for all tasks", "one for each task", "default, guarded",
)  # fmt: skip
DEFAULT = ""
"""Setting of every method, as overrides in one text."""
GUARD = "learning.guard=freeze record.weights=true"
"""Setting of methods that learn, as users are advised to run them."""
TRIAL = ["machine", "method", "overrides", "world"]
"""Columns with equal values in all rows of one trial, which differ in the task."""
SAME = ["machine", "task", "world"]
"""Columns with equal values in a row and in its reference row of feedback only."""
TUNING = "tuning"
"""Name of the plan that runs in the worlds for tuning."""
RunPlan = Callable[[str, pd.DataFrame], pd.DataFrame]
""":func:`run_plan` for fixed machines, methods, workers and folder."""
Chosen = Mapping[Any, Mapping[str, str]]
"""Settings by machine and method: for all tasks under :data:`FOR_ALL`, for each task under its name."""


def list_overrides(
    machine: Machine, method: Method, setting: str, world: Sequence[str], task: str = BEFORE
) -> list[str]:
    """List the overrides of a stage: the run before the change, or the run after the change of ``task``."""
    if task == BEFORE:
        stage = [*world, f"cycles={machine.before}"]
    else:
        stage = [
            *change_world(world, machine.changes.get(task, ())),
            f"cycles={machine.after}",
            "learning.start_cycle=1",
        ]
    return [*machine.overrides, *PROTOCOL, *method.overrides, *setting.split(), *stage]


def _find_hash(stages: Mapping[str, Sequence[str]], last: int) -> str:
    """Compute the SHA-256 of everything that determines an outcome.

    This includes the code of a custom method, or the error if its config cannot be composed.
    """
    try:
        config = compose_config(stages[BEFORE])
        parts = [custom_code_hash(config), config_hash(to_plain(config))]
    except BadInput as error:  # the run itself reports it
        parts = [str(error)]
    return hashlib.sha256(
        json.dumps([VERSION, read_environment().code_hash, *parts, stages, last]).encode()
    ).hexdigest()


def run_stage(machine: Machine, overrides: Sequence[str], learnt: Weights | None = None) -> tuple[Row, Weights]:
    """Run one stage of a trial; return its row of results, and the learnt weights.

    ``status`` and ``cause`` describe a method that refuses the config, raises, or gives NaN; its errors are infinite.
    ``errors`` (cycles,) are the transfer errors of the feet over all axes, m; ``seconds`` is the time per step, s.
    """
    metrics = dict[str, Array]()
    seconds = np.nan
    kept: Weights = {}
    try:
        scenario = make_scenario(compose_config(overrides), learnt)
        scores = score_run(scenario)
        end = scenario.end
        if end.status == "interrupted":
            raise KeyboardInterrupt
        keep = next(
            (learner.learnt for learner in (scenario.controller, scenario.feedforward) if hasattr(learner, "learnt")),
            dict,
        )
        kept = exits_caught()(keep)() if end.status == COMPLETED else kept
        if end.guard and scenario.kept:  # the guard returned an external method to its weights of the best cycle
            kept = scenario.kept.get(end.guard[-1].restored, kept)
        status, cause = end.status, end.cause
        seconds = end.processor_seconds / max(1, end.steps)
        metrics = pool_legs(scores)
    except Exception as error:
        status, cause = REFUSED if isinstance(error, BadInput) else FAILED, describe_failure(error)
    completed = status == COMPLETED
    axes = [metrics[name] for name in AXES if name in metrics]
    errors = np.sqrt(sum(axis**2 for axis in axes)) if completed else np.full(machine.after, np.inf)
    return {
        "status": status,
        "cause": cause,
        "end_error": compute_final(errors, machine.last),
        "first_error": float(errors[0]),
        "worst_error": float(errors.max()),
        **{key: compute_final(metrics[name], machine.last) if completed else np.inf for key, name in ENDS.items()},
        "bytes": float(sum(np.asarray(array).nbytes for array in kept.values())) if completed else np.nan,
        "errors": errors.tolist(),
        "seconds": seconds,
    }, kept


def run_trial(
    machine: Machine, method: Method, setting: str, world: Sequence[str], tasks: Sequence[str], folder: Path
) -> list[Row]:
    """Run a trial and return the rows of its tasks; a stored outcome in ``folder`` is reused.

    Each outcome is a separate file, so that finished trials survive the end of a cluster job.
    """
    expect_runs(1000)
    stages = {task: list_overrides(machine, method, setting, world, task) for task in (BEFORE, *tasks)}
    path = folder / f"{_find_hash(stages, machine.last)[:24]}.json"
    if path.is_file() and path.stat().st_size:  # empty after a power failure during the write
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
    """Run the rows of a plan, equal ones only once, and return the plan with the results of each row.

    Args:
        machines: machines by name.
        methods: methods by name, including feedback only.
        launcher: Where the trials run.
        folder: folder of stored outcomes, which are reused.
        what: description of the runs for the terminal; TUNING selects the worlds for tuning.
        plan: table with the columns TRIAL, ``setting`` and ``task``.
    """
    different = plan[[*TRIAL, "task"]].drop_duplicates()
    trials = different.groupby(TRIAL, sort=False, as_index=False)["task"].agg(list)
    items = [
        (machines[machine], methods[method], setting, machines[machine].draw(world, what == TUNING), tasks, folder)
        for machine, method, setting, world, tasks in trials.itertuples(index=False)
    ]
    outcomes = zip(trials[TRIAL].to_dict("records"), launcher.map_in_order(what, run_trial, items), strict=True)
    rows = pd.DataFrame({**trial, **row} for trial, trial_rows in outcomes for row in trial_rows)
    return plan.merge(rows, how="left", on=[*TRIAL, "task"])


def _draw_value(draw: Draw, tuned: Any) -> str:
    """Draw a value of a tuned key, as text of an override: one of a list, or log-uniform between two ends."""
    if isinstance(tuned, list):
        value = draw.choose(*tuned)
        return f"[{','.join(map(str, value))}]" if isinstance(value, list) else str(value)
    value = draw.even_log(*tuned)
    return f"{value:.4g}" if any(isinstance(end, float) for end in tuned) else str(round(value))


def draw_settings(method: Method, number: int) -> list[str]:
    """Draw settings of a method: the default one, and up to ``number`` random ones of its tuned keys.

    A method always gets the same settings; with a larger ``number`` further ones are appended.
    """
    draw = Draw(zlib.crc32(method.name.encode()))
    drawn = [" ".join(f"++{key}={_draw_value(draw, tuned)}" for key, tuned in method.tuned) for _ in range(number)]
    return list(dict.fromkeys([DEFAULT, *drawn]))


def choose_setting(rows: pd.DataFrame) -> str:
    """Choose the setting with the fewest failed runs, then with the least mean score, then the first one drawn.

    ``rows`` have ``overrides``, in the order in which they were drawn, and ``score``, infinite where a run failed.
    """
    done = rows["score"].where(np.isfinite(rows["score"])).groupby(rows["overrides"], sort=False)
    ranked = done.agg(["count", "mean"]).sort_values(["count", "mean"], ascending=[False, True])
    return str(ranked.index[0])


def take_reference(rows: pd.DataFrame, columns: Any) -> Any:
    """Return columns of feedback only for the same machine, task and world as each row; a series for one column."""
    feedback_only = rows[rows["method"] == ALONE].set_index(SAME)[columns]
    return rows[SAME].join(feedback_only, on=SAME)[columns]


def tune(machines: Mapping[str, Machine], methods: Mapping[str, Method], run: RunPlan) -> Chosen:
    """Choose the best settings of each method on each machine by the mean score in the worlds for tuning."""
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
    errors, reference = (values.to_numpy() for values in (frame["end_error"], take_reference(frame, "end_error")))
    frame = frame.assign(score=relative_to(errors, reference))
    return {
        pair: {FOR_ALL: choose_setting(rows)} | {task: choose_setting(group) for task, group in rows.groupby("task")}
        for pair, rows in frame[frame["method"] != ALONE].groupby(["machine", "method"])
    }


def _find(chosen: Mapping[str, str], method: Method, kind: str, task: str) -> str:
    """Return the setting of a kind for a task; tasks that were not tuned have the setting for all tasks."""
    general = chosen.get(FOR_ALL, DEFAULT)
    return {
        BY_DEFAULT: DEFAULT,
        FOR_ALL: general,
        FOR_EACH: chosen.get(task, general),
        GUARDED: DEFAULT if method.name == ALONE else GUARD,
    }[kind]


def test(
    machines: Mapping[str, Machine],
    methods: Mapping[str, Method],
    run: RunPlan,
    chosen: Chosen,
) -> pd.DataFrame:
    """Test the methods; return a row for each machine, method, kind of setting, task and world."""
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
