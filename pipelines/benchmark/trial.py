"""One method with one setting in one world: it starts, something changes, it goes on with what it has learnt."""

import hashlib
import json
from collections.abc import Mapping, Sequence
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
from cmacexp.metrics.pooling import pool_legs
from cmacexp.study import Array, compute_final
from cmacexp.terminal.messages import announce_compiling
from cmacexp.typing import Weights
from pipelines.benchmark.entrants import Method
from pipelines.benchmark.tasks import PROTOCOL, VERSION, Machine, change_world

COMPLETED, REFUSED, FAILED = "completed", "refused", "failed"
AXES = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse_z")
ENDS = {"force": "force_rmse", "feedback": "feedback_rms", "torque_peak": "torque_peak", "energy": "energy"}
"""Columns that hold the median of a metric over the last cycles."""
Row = dict[str, Any]
BEFORE = ""
"""The stage before a change, beside those by task."""


def list_overrides(
    machine: Machine, method: Method, setting: Sequence[str], world: Sequence[str], task: str = ""
) -> list[str]:
    """Overrides of the run before the change, or of that after the change of a task."""
    own = [*world, f"cycles={machine.before}"]
    if task:
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
    text = json.dumps([VERSION, code_hash(), *own, stages, last])
    return hashlib.sha256(text.encode()).hexdigest()


def run_stage(
    machine: Machine, overrides: Sequence[str], learnt: Weights | None = None
) -> tuple[Row, Weights | None]:
    """What a run gives, and what is learnt; a method that refuses, raises or gives NaN has failed, and says why."""
    try:
        scenario = make_scenario(compose_config(overrides), learnt)
        end, scorer = score_scenario(scenario)
        entered = [scenario.controller, scenario.feedforward]
        keep = next((part.learnt for part in entered if hasattr(part, "learnt")), None)
        kept = None if keep is None or end.status != COMPLETED else exits_caught()(keep)()
        if end.events and scenario.kept:  # an external method: the guard returned to what it knew in the best cycle
            kept = scenario.kept.get(end.events[-1].restored, kept)
    except Exception as error:
        status = REFUSED if isinstance(error, BadInput) else FAILED
        return _summarise(machine, status, describe_failure(error), {}, None, np.nan), None
    if end.status == "interrupted":
        raise KeyboardInterrupt
    seconds = end.processor_seconds / max(1, end.steps)
    return _summarise(machine, end.status, end.cause, pool_legs(scorer.scores), kept, seconds), kept


def _summarise(
    machine: Machine, status: str, cause: str, metrics: Mapping[str, Array], learnt: Weights | None, seconds: float
) -> Row:
    """A row of the results, its errors infinite of a method that did not complete.

    ``errors`` (cycles,) are those of the feet in transfer over all axes, m; ``seconds`` the time of a step.
    """
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
        "bytes": float(sum(np.asarray(own).nbytes for own in (learnt or {}).values())) if completed else np.nan,
        "errors": errors.tolist(),
        "seconds": seconds,
    }


def run_trial(machine: Machine, stages: Mapping[str, Sequence[str]], folder: Path) -> list[Row]:
    """Rows of all tasks in a world; an outcome in ``folder`` is used again.

    ``stages`` are the overrides of the run before the change, by BEFORE, and of those after it, by their tasks.
    """
    announce_compiling()
    expect_runs(1000)
    path = folder / f"{_find_hash(stages, machine.last)[:24]}.json"
    if path.is_file():
        known: list[Row] = json.loads(path.read_text(encoding="utf-8"))
        return known
    before, learnt = run_stage(machine, stages[BEFORE])
    rows = []
    for task in [task for task in stages if task != BEFORE]:
        done = before["status"] == COMPLETED
        rows.append({"task": task, **(run_stage(machine, stages[task], learnt or None)[0] if done else before)})
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as new:
        new.write_text(json.dumps(rows), encoding="utf-8")
    return rows
