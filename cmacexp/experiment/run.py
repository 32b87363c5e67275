"""One run from its config to its folder: closed loop, traces, metrics, recording, manifest."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa

from cmacexp.config import Config, to_plain
from cmacexp.control import HybridController, Learns
from cmacexp.data import manifest as manifests
from cmacexp.data.files import remove_leftovers, sha256
from cmacexp.data.signals import BODY_SIGNALS, LEG_SIGNALS, Signal, select_signals
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import (
    BODY,
    BODY_METRICS,
    MEMORY,
    METRICS,
    METRICS_CSV,
    RECORDING,
    TRACE,
    Traces,
    steps_by_cycle,
    write_memory,
    write_scores,
)
from cmacexp.data.trace_writer import trace_writer
from cmacexp.data.weights import WEIGHTS, start_hash, write_weights
from cmacexp.errors import BadOutput, format_user_traceback
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.jit.sources import code_hash
from cmacexp.loop import End, Samples, stream
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.trace import assemble, assemble_body, assemble_memory
from cmacexp.metrics.drift import Drift, make_drift_entry
from cmacexp.metrics.score import RunScorer
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.sensors.protocol import find_altered

Columns = tuple[tuple[Signal, ...], tuple[Signal, ...] | None]
"""Columns of the traces of the legs, and of the body if there is one."""


def clear(folder: Path) -> None:
    """Remove the files of an earlier run, its manifest first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (manifests.NAME, TRACE, BODY, MEMORY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING, WEIGHTS):
        (folder / name).unlink(missing_ok=True)
    remove_leftovers(folder)


def _columns(scenario: Scenario) -> Columns:
    """Columns of the traces; sensors that alter a signal, or are supervised, add some."""
    altered, watched = find_altered(scenario.sensors), scenario.setup.config.plausibility.enabled
    walks = scenario.setup.mechanism.kind == LEGS_UNDER_BODY
    legs = select_signals(LEG_SIGNALS, altered, watched)
    return legs, select_signals(BODY_SIGNALS, altered) if walks else None


def _assemble(scenario: Scenario, columns: Columns, samples: Samples) -> Traces:
    """The traces of the steps that were sampled."""
    plan, config, legs = scenario.setup.plan, scenario.setup.config, samples.columns()
    period, start = config.sampling_period, samples.start
    body = memory = None
    if columns[1] is not None:
        moves = scenario.first.travel is not None
        body = assemble_body(scenario.setup, samples.body_columns(), legs, moves, start, columns[1])
    if samples.memory is not None:
        memory = assemble_memory(samples.memory, start // config.steps_per_cycle + 1)
    return Traces(assemble(plan, legs, period, start, columns[0]), body, memory)


def _roll_out(
    scenario: Scenario,
    folder: Path,
    scorer: RunScorer,
    watch: Callable[[int], None],
    warn: Callable[[Drift], None],
) -> tuple[End, list[str]]:
    """Run, score, and write traces and memory; how the run ended, and the names of the files."""
    columns, memory = _columns(scenario), list[pa.Table]()
    with trace_writer(folder, scenario.setup.config.record, *columns) as writer:

        def take(samples: Samples) -> None:
            known, traces = scorer.drift, _assemble(scenario, columns, samples)
            writer.write(traces)
            scorer.add(traces)
            if traces.memory is not None:
                memory.append(traces.memory)
            if known is None and scorer.drift is not None:
                warn(scorer.drift)

        end = stream(scenario, take, watch)
        writer.finish(end.status == "completed")
    names = [TRACE, BODY] if columns[1] else [TRACE]
    return end, names + write_memory(folder, memory)


def _write_extras(scenario: Scenario, folder: Path, manifest: manifests.Manifest) -> list[str]:
    """Write the weights and the recording if the config asks for them; the names of the files.

    Args:
        scenario: of the run.
        folder: of the run, with its trace and metrics.
        manifest: what is known of the run before its other files are written.
    """
    record, names = scenario.setup.config.record, list[str]()
    if record.weights and isinstance(scenario.feedforward, Learns):
        write_weights(folder, scenario.feedforward.learnt())
        names.append(WEIGHTS)
    if record.recording and (kept := steps_by_cycle(folder)):
        from cmacexp.recording.window import make_window
        from cmacexp.recording.write import write_recording

        write_recording(folder, manifest, folder / RECORDING, window=make_window(kept))
        names.append(RECORDING)
    return names


def _component_entries(scenario: Scenario) -> dict[str, Any]:
    """Excluded force sensors and use of memory; external components may use these names for something else."""
    controller, feedforward = scenario.controller, scenario.feedforward
    dropped = controller.dropped if isinstance(controller, HybridController) else {}
    memory = feedforward.memory if isinstance(feedforward, BuiltInFeedforward) else ()
    return {
        "dropped": [{"leg": leg, "step": step} for leg, step in dropped.items()],
        "memory": [use._asdict() for use in memory],
    }


@interrupt_held_back()  # the loop itself heeds it: what is done is written
def run_scenario(
    config: Config,
    folder: Path,
    watch: Callable[[int], None] = lambda cycle: None,
    prepared: Scenario | None = None,
    warn: Callable[[Drift], None] = lambda drift: None,
) -> StoredRun:
    """Run a scenario and write its results to ``folder``.

    Args:
        config: a checked config.
        folder: is made if missing; files of an earlier run in it are replaced.
        watch: is called with the number of cycles done so far, see :func:`cmacexp.loop.stream`.
        prepared: the scenario of ``config`` if it is already made.
        warn: is called once a drift is detected, while the run goes on; see :mod:`cmacexp.metrics.drift`.

    Returns:
        The result; a run that diverged, failed or was interrupted keeps its results up to there, see ``status``.

    Raises:
        BadInput: the machine cannot follow the plan; nothing was simulated or written.
        OSError: the folder cannot be written.
    """
    began = time.perf_counter()
    scenario, scorer = prepared or make_scenario(config), RunScorer(config.steps_per_cycle)
    clear(folder)
    end, names = _roll_out(scenario, folder, scorer, watch, warn)
    scores = scorer.scores
    names += write_scores(folder, scores)
    manifest = manifests.make_manifest(to_plain(config), end.status, end.cause, steps=end.steps)
    names += _write_extras(scenario, folder, manifest)
    entries = {
        **_component_entries(scenario),
        "code_hash": code_hash(),
        "start_weights": start_hash(config),
        "learning_lead": scenario.setup.lead,
        "drift": make_drift_entry(scores.legs),
        "rollout_seconds": end.seconds,
        "wall_seconds": time.perf_counter() - began,
        "files": {name: sha256(folder / name) for name in names},
    }
    if end.error is not None and not isinstance(end.error, BadOutput):
        entries["traceback"] = format_user_traceback(end.error)
    manifests.write(folder, manifest | entries)
    return StoredRun(folder)
