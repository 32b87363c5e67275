"""One run from its config to its folder: roll out, trace, metrics, recording, manifest."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from cmacexp import manifest as manifests
from cmacexp.config import Config, config_hash, to_plain
from cmacexp.control import HybridController, Learns
from cmacexp.control.feedforward import BuiltInFeedforward
from cmacexp.errors import BadAnswer, users_traceback
from cmacexp.files import remove_leftovers, sha256
from cmacexp.keep import (
    BODY,
    BODY_METRICS,
    MEMORY,
    METRICS,
    METRICS_CSV,
    RECORDING,
    TRACE,
    Scores,
    Traces,
    steps_by_cycle,
    write_memory,
    write_scores,
    writing,
)
from cmacexp.metrics.drift import Drift, drift_entry
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.rollout import End, Samples, stream
from cmacexp.scenario import Scenario, make_scenario
from cmacexp.sensors.protocol import altered_by
from cmacexp.sources import code_hash
from cmacexp.trace import BODY_COLUMNS, COLUMNS, Column, assemble, assemble_body, assemble_memory, with_measured
from cmacexp.weights import WEIGHTS, start_hash, write_weights


@dataclass(frozen=True)
class RunResult:
    """What a run gave, and where it is kept."""

    folder: Path
    manifest: manifests.Manifest
    scores: Scores

    @property
    def status(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])


def clear(folder: Path) -> None:
    """Make room for a run: what an earlier one left under the same names goes, its manifest first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (manifests.NAME, TRACE, BODY, MEMORY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING, WEIGHTS):
        (folder / name).unlink(missing_ok=True)
    remove_leftovers(folder)


def _columns(scenario: Scenario) -> tuple[tuple[Column, ...], tuple[Column, ...] | None]:
    """Columns of the traces of legs and body; None without a body."""
    altered, watched = altered_by(scenario.sensors), scenario.setup.config.plausibility.enabled
    legs = with_measured(COLUMNS, altered, watched)
    return legs, with_measured(BODY_COLUMNS, altered) if scenario.setup.mechanism.kind == LEGS_UNDER_BODY else None


def _traces(scenario: Scenario, samples: Samples) -> Traces:
    """The part of the traces that some steps give."""
    plan, config, columns = scenario.setup.plan, scenario.setup.config, samples.columns()
    period, start = config.sampling_period, samples.start
    of_legs, of_body = _columns(scenario)
    legs, memory = assemble(plan, columns, period, start, of_legs), _memory(scenario, samples)
    if of_body is None:
        return Traces(legs, None, memory)
    walk = assemble_body(plan, samples.body_columns(), columns["force"], period, start, of_body)
    return Traces(legs, walk, memory)


def _memory(scenario: Scenario, samples: Samples) -> pa.Table | None:
    """What the weights were at the end of the cycles of some steps."""
    weights, feedforward = samples.weights, scenario.feedforward
    if weights is None or not isinstance(feedforward, BuiltInFeedforward):
        return None
    counted = [use.cells_colliding for use in feedforward.memory] or [None] * weights.shape[1]
    colliding = [math.nan if count is None else count for count in counted]
    first = samples.start // scenario.setup.config.steps_per_cycle + 1
    return assemble_memory(weights, feedforward.law.weights.shape[1], colliding, first)


def _roll_out(
    scenario: Scenario, folder: Path, watch: Callable[[int], None], warn: Callable[[Drift], None]
) -> tuple[End, Scores, list[str]]:
    """Run, and write all that it leaves behind but the manifest; how it ended, its metrics, names of the files."""
    config, (legs, body) = scenario.setup.config, _columns(scenario)
    with writing(folder, config.record, config.steps_per_cycle, legs, body) as writer:

        def keep(samples: Samples) -> None:
            known = writer.drift
            writer.add(_traces(scenario, samples))
            if known is None and writer.drift is not None:
                warn(writer.drift)

        end = stream(scenario, keep, watch)
    scores = writer.scores
    names = [TRACE, BODY] if body else [TRACE]
    names += write_memory(folder, writer.legs.memory) + write_scores(folder, scores)
    if config.record.weights and isinstance(scenario.feedforward, Learns):
        write_weights(folder, scenario.feedforward.learnt())
        names.append(WEIGHTS)
    if config.record.recording and (kept := steps_by_cycle(folder)):
        from cmacexp.recording import part_of, write_recording

        write_recording(folder, to_plain(config), folder / RECORDING, part=part_of(kept))
        names.append(RECORDING)
    return end, scores, names


def _told_by_parts(scenario: Scenario) -> manifests.Manifest:
    """What built-in parts tell of their run; a class of one's own may use the same names for something else."""
    controller, feedforward = scenario.controller, scenario.feedforward
    dropped = controller.dropped if isinstance(controller, HybridController) and scenario.fault is None else {}
    memory = feedforward.memory if isinstance(feedforward, BuiltInFeedforward) else []
    return {
        "dropped": [{"leg": i, "step": k} for i, k in dropped.items()],
        "memory": [use._asdict() for use in memory],
    }


def run_scenario(
    config: Config,
    folder: Path,
    watch: Callable[[int], None] = lambda cycle: None,
    prepared: Scenario | None = None,
    warn: Callable[[Drift], None] = lambda drift: None,
) -> RunResult:
    """Run a scenario and keep what it gives in ``folder``.

    Args:
        config: a checked config.
        folder: is made if missing; files of an earlier run in it are replaced.
        watch: is called with the cycles done so far, see :func:`cmacexp.rollout.stream`.
        prepared: the scenario of ``config`` if it is already made.
        warn: is called when learning is seen to drift, while the run goes on; see :mod:`cmacexp.metrics.drift`.

    Returns:
        The result; a run that diverged, failed or was interrupted keeps what it has, and says so in ``status``.

    Raises:
        BadInput: the plan asks for what the machine cannot do; nothing was simulated or written.
        OSError: the folder cannot be written.
    """
    began = time.perf_counter()
    scenario = prepared or make_scenario(config)
    clear(folder)
    end, scores, names = _roll_out(scenario, folder, watch, warn)
    plain = to_plain(config)
    manifest: manifests.Manifest = {
        "status": end.status,
        "cause": end.cause,
        "seed": config.seed,
        "config": plain,
        "config_hash": config_hash(plain),
        "code_hash": code_hash(),
        "versions": manifests.versions(),
        "git_commit": manifests.git_commit(),
        "steps": end.steps,
        "start_weights": start_hash(config),
        "drift": drift_entry(scores.legs),
        "learning_lead": config.lead,
        **_told_by_parts(scenario),
        "rollout_seconds": end.seconds,
        "wall_seconds": time.perf_counter() - began,
        "files": {name: sha256(folder / name) for name in names},
    }
    if end.error is not None and not isinstance(end.error, BadAnswer):
        manifest["traceback"] = users_traceback(end.error)
    manifests.write(folder, manifest)
    return RunResult(folder, manifest, scores)
