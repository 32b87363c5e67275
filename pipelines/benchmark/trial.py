"""One method with one setting in some worlds: it starts, something changes, it goes on with what it has learnt."""

import hashlib
import json
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config import config_hash, to_plain
from cmacexp.config.component import custom_code_hash
from cmacexp.config.compose import compose_config
from cmacexp.data.files import write_atomically
from cmacexp.engine.failure import describe_failure
from cmacexp.engine.run import score_scenario
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import exits_caught
from cmacexp.jit.sources import code_hash
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.final import compute_final
from cmacexp.metrics.pooling import pool_legs
from cmacexp.terminal.messages import announce_compiling
from cmacexp.typing import Array, Weights
from pipelines.benchmark.entrants import Method
from pipelines.benchmark.tasks import PROTOCOL, VERSION, Machine, change_world

COMPLETED, REFUSED, FAILED = "completed", "refused", "failed"
AXES = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse_z")
ENDS = {"force": "force_rmse", "feedback": "feedback_rms", "torque_peak": "torque_peak", "energy": "energy"}
"""Columns that hold the median of a metric over the last cycles."""


@dataclass(frozen=True)
class Trial:
    """A method with a setting, and the worlds and tasks that it is tried in."""

    machine: Machine
    method: Method
    setting: Sequence[str]
    """Overrides besides those of the method; empty: its defaults."""
    worlds: Sequence[int]
    tasks: Sequence[str]
    tuning: bool = False
    """Whether the worlds are those that settings are tuned in."""

    def find_hash(self) -> str:
        """Of all that the outcome depends on, the code of a custom method included.

        Raises:
            BadInput: the method cannot be composed.
        """
        config = compose_config(self.list_overrides(self.machine.draw(self.worlds[0], self.tuning)))
        code = [VERSION, code_hash(), custom_code_hash(config), config_hash(to_plain(config))]
        return hashlib.sha256(json.dumps([*code, asdict(self)], sort_keys=True).encode()).hexdigest()

    def list_overrides(self, world: Sequence[str], *more: str) -> list[str]:
        """Overrides of a run in a world."""
        return [*self.machine.overrides, *PROTOCOL, *self.method.overrides, *self.setting, *world, *more]


@dataclass(frozen=True)
class Stage:
    """What one run gave."""

    status: str
    cause: str
    metrics: Mapping[str, Array]
    """One value a cycle, legs pooled."""
    learnt: Weights | None
    seconds_per_step: float

    @property
    def errors(self) -> Array:
        """(cycles,): transfer error of the feet over all axes, m."""
        error: Array = np.sqrt(sum(self.metrics[name] ** 2 for name in AXES if name in self.metrics))
        return error


def run_stage(overrides: Sequence[str], learnt: Weights | None = None) -> Stage:
    """Run a method from what it has learnt; a method that refuses, raises or gives NaN has failed, and says why."""
    try:
        scenario = make_scenario(compose_config(overrides), learnt)
        end, scorer = score_scenario(scenario)
        entered = [scenario.controller, scenario.feedforward]
        keep = next((part.learnt for part in entered if hasattr(part, "learnt")), None)
        kept = None if keep is None or end.status != COMPLETED else exits_caught()(keep)()
        if end.events and scenario.kept:  # an external method: the guard returned to what it knew in the best cycle
            kept = scenario.kept.get(end.events[-1].restored, kept)
    except Exception as error:
        return Stage(REFUSED if isinstance(error, BadInput) else FAILED, describe_failure(error), {}, None, 0.0)
    if end.status == "interrupted":
        raise KeyboardInterrupt
    return Stage(end.status, end.cause, pool_legs(scorer.scores), kept, end.processor_seconds / max(1, end.steps))


def _summarise(trial: Trial, task: str, world: int, stage: Stage) -> dict[str, Any]:
    """A row of the results; of a method that did not complete its errors are infinite."""
    machine, completed = trial.machine, stage.status == COMPLETED
    errors = stage.errors if completed else np.full(machine.after, np.inf)
    ends = {
        column: compute_final(stage.metrics[name], machine.last) if completed else np.inf
        for column, name in ENDS.items()
    }
    held = float(sum(np.asarray(values).nbytes for values in (stage.learnt or {}).values()))
    return {
        "task": task,
        "world": world,
        "status": stage.status,
        "cause": stage.cause,
        "end_error": compute_final(errors, machine.last),
        "first_error": float(errors[0]),
        "worst_error": float(errors.max()),
        **ends,
        "bytes": held if completed else np.nan,
        "errors": errors.tolist(),
    }


def _try_world(trial: Trial, world: int) -> tuple[list[dict[str, Any]], list[float]]:
    """Rows of all tasks in a world, and times of a step."""
    machine, drawn = trial.machine, trial.machine.draw(world, trial.tuning)
    before = run_stage(trial.list_overrides(drawn, f"cycles={machine.before}"))
    rows, times = [], [before.seconds_per_step]
    for task in trial.tasks:
        after = before
        if before.status == COMPLETED:
            changed = change_world(drawn, machine.changes[task])
            more = (f"cycles={machine.after}", "learning.start_cycle=1")
            after = run_stage(trial.list_overrides(changed, *more), before.learnt or None)
            times.append(after.seconds_per_step)
        rows.append(_summarise(trial, task, world, after))
    return rows, times


def run_trial(trial: Trial, folder: Path) -> tuple[list[dict[str, Any]], float]:
    """Rows of all tasks in all worlds, and the median time of a step, s; an outcome in ``folder`` is used again."""
    announce_compiling()
    expect_runs(1000)
    path = None
    try:
        path = folder / f"{trial.find_hash()[:24]}.json"
        if path.is_file():
            known = json.loads(path.read_text(encoding="utf-8"))
            return known["rows"], known["seconds_per_step"]
    except BadInput:  # its runs say why
        pass
    tried = [_try_world(trial, world) for world in trial.worlds]
    rows, seconds = [row for own, _ in tried for row in own], statistics.median(t for _, own in tried for t in own)
    if path is not None:
        folder.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as new:
            new.write_text(json.dumps({"rows": rows, "seconds_per_step": seconds}), encoding="utf-8")
    return rows, seconds
