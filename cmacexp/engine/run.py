"""One run from its config to its folder: closed loop, traces, metrics, recording, manifest; also one that failed."""

import json
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config import Config, to_plain
from cmacexp.config.component import COMPONENTS
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.control import DriveController, HybridController
from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256, write_atomically
from cmacexp.data.folder import RUN_KEY, ResultWriter, new_result
from cmacexp.data.integrity import compute_hashes
from cmacexp.data.records import Drift
from cmacexp.data.run import Run
from cmacexp.data.signals import (
    BODY_SIGNALS,
    LEG_SIGNALS,
    LIVE_SIGNALS,
    MODEL_SIGNALS,
    SPATIAL_SIGNALS,
    Signal,
    select_signals,
)
from cmacexp.data.tables import (
    BODY_FILE,
    MEMORY_FILE,
    RECORDING_FILE,
    TRACE_FILE,
    Scores,
    write_scores,
    write_table,
)
from cmacexp.data.trace import SampledTrace, Trace, concat_traces, count_steps_by_cycle, trace_writer
from cmacexp.data.weights import WEIGHTS
from cmacexp.engine.stop_cause import explain_stop
from cmacexp.errors import BadInput, BadOutput, describe_failure, format_user_traceback, in_one_line
from cmacexp.feedforward import Learns
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.interrupt import exits_caught, interrupt_held_back
from cmacexp.loop import End, Samples, stream
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.trace import Sampled, assemble, assemble_body
from cmacexp.metrics.drift import make_drift_entry
from cmacexp.metrics.score import RunScorer
from cmacexp.models.mechanism import PLANE, has_body
from cmacexp.sensors.protocol import find_altered
from cmacexp.typing import Array, Status

Columns = tuple[tuple[Signal, ...], tuple[Signal, ...] | None]
"""Columns of the traces of the legs, and of the body if there is one."""


@lru_cache(64)
def _select(
    joints: int, models: int, altered: frozenset[str], watched: bool, is_body: bool, is_live: bool
) -> Columns:
    """Columns of legs with so many joints, for so many of which there is the torque of a model."""
    table = LEG_SIGNALS if joints == len(PLANE) else (*LEG_SIGNALS, *SPATIAL_SIGNALS)
    legs = select_signals((*table, *MODEL_SIGNALS[:models]), altered, watched)
    body = (*BODY_SIGNALS, *LIVE_SIGNALS) if is_live else BODY_SIGNALS
    return legs, select_signals(body, altered) if is_body else None


def _columns(scenario: Scenario) -> Columns:
    """Columns of the traces; sensors that alter a signal, or are supervised, add some."""
    mechanism, watched = scenario.setup.mechanism, scenario.setup.config.plausibility.enabled
    joints, altered = mechanism.shape[1], frozenset(find_altered(scenario.sensors))
    models = 0 if _known_torque(scenario) is None else joints
    return _select(joints, models, altered, watched, has_body(mechanism), hasattr(scenario.plant, "list_steps"))


def _known_torque(scenario: Scenario) -> Array | None:
    """Torque (N, L, J) of a model that a built-in feedforward learns on top of, N m."""
    feedforward = scenario.feedforward
    return feedforward.model_torque if isinstance(feedforward, BuiltInFeedforward) else None


def _list_sampled(scenario: Scenario, columns: Columns, samples: Samples) -> Sampled:
    """What was sampled, and what its trace needs besides."""
    plan, config, legs = scenario.setup.plan, scenario.setup.config, samples.columns()
    period, start = config.sampling_period, samples.start
    body = None
    if columns[1] is not None:
        moves, sampled = scenario.first.travel is not None, samples.body_columns() | samples.live
        body = Trace(assemble_body(scenario.setup, sampled, legs, moves, start, columns[1]))
    controller, steered = scenario.controller, False
    if isinstance(controller, HybridController | DriveController) and scenario.fault is None:
        steered = controller.params.steering is not None
    return Sampled(plan, legs, period, start, columns[0], _known_torque(scenario), steered, body, samples.memory)


@exits_caught()
def sample_scenario(
    scenario: Scenario,
    keep: Callable[[Sampled], None],
    watch: Callable[[float], None] = lambda cycles: None,
) -> End:
    """Run a new scenario and write nothing; ``keep`` is called with what is sampled of some cycles at a time."""
    columns = _columns(scenario)
    return stream(scenario, lambda samples: keep(_list_sampled(scenario, columns, samples)), watch)


def score_scenario(
    scenario: Scenario,
    keep: Callable[[SampledTrace], None] = lambda trace: None,
    watch: Callable[[float], None] = lambda cycles: None,
    warn: Callable[[Drift], None] = lambda drift: None,
    machines: int = 1,
) -> tuple[End, RunScorer]:
    """:func:`sample_scenario`, with what has the metrics; ``watch`` and ``warn`` as by :func:`run_scenario`.

    The legs of the scenario are those of so many ``machines``.
    """
    scorer = RunScorer(scenario.setup.config.steps_per_cycle, machines)

    def take(sampled: Sampled) -> None:
        known, trace = scorer.drift, assemble(sampled)
        keep(trace)
        scorer.add(trace)
        if known is None and scorer.drift is not None:
            warn(scorer.drift)

    return sample_scenario(scenario, take, watch), scorer


def _roll_out(
    scenario: Scenario, folder: Path, watch: Callable[[float], None], warn: Callable[[Drift], None]
) -> tuple[End, Scores, list[str]]:
    """Run, and write traces and memory; how the run ended, its metrics, and the names of the files."""
    columns, record = _columns(scenario), scenario.setup.config.record
    last = deque[Trace](maxlen=2)  # the last one may be short
    with trace_writer(folder, record, *columns) as writer:

        def keep(trace: Trace) -> None:
            writer.write(trace)
            last.append(trace)

        end, scorer = score_scenario(scenario, keep, watch, warn)
        writer.finish(end.status == Status.COMPLETED)
    end = replace(end, cause=end.cause + explain_stop(scenario, end, last, scorer.drift))
    if not record.trace:
        return end, scorer.scores, []
    names = [TRACE_FILE, BODY_FILE] if columns[1] else [TRACE_FILE]
    if scorer.memory:
        write_table(concat_traces(scorer.memory).table, folder / MEMORY_FILE)
        names.append(MEMORY_FILE)
    return end, scorer.scores, names


@exits_caught()
def _write_extras(scenario: Scenario, writer: ResultWriter, manifest: manifests.Manifest, names: list[str]) -> None:
    """Write weights and recording if the config asks for them; weights are added to the names of the files."""
    record, folder = scenario.setup.config.record, writer.part
    if record.weights and isinstance(scenario.feedforward, Learns):
        restored = [event["restored"] for event in manifest["guard"]]
        best = scenario.kept.get(restored[-1]) if restored else None
        with write_atomically(folder / WEIGHTS) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **(best or scenario.feedforward.learnt()))
        names.append(WEIGHTS)
    if record.recording and count_steps_by_cycle(folder):
        from cmacexp.recording.write import Options, write_recording

        run = Run(folder, {**manifest, "files": dict.fromkeys(names)})
        write_recording([run], folder / RECORDING_FILE, Options(label=writer.folder.name))


@interrupt_held_back()  # the loop itself raises it: what is done is written
def run_scenario(
    config: Config,
    folder: Path,
    watch: Callable[[float], None] = lambda cycles: None,
    prepared: Scenario | None = None,
    warn: Callable[[Drift], None] = lambda drift: None,
    record: Mapping[str, str] | None = None,
    overrides: Sequence[str] | None = None,
    durable: bool = True,
) -> Run:
    """Run a scenario of a checked config and write its results to ``folder``.

    They take the place of an earlier run at the end; a run that diverged, failed or was interrupted keeps its results
    up to there. One that failed or was interrupted stands beside an earlier one with a result, as NAME.failed or
    NAME.interrupted. ``prepared`` is the scenario if it is already made. ``watch`` is called with the number of
    cycles done so far, see :func:`cmacexp.loop.stream`, ``warn`` once a drift is detected. ``record`` is Hydra's own,
    texts by file name. ``overrides`` are those that the config comes from, None if it came whole. A result that is
    not ``durable`` may be lost in a power failure: a sweep that is resumed runs such a job again.

    Raises BadInput, with nothing simulated or written, if the machine cannot follow the plan, or the folder
    holds something else; OSError if the folder cannot be written: an earlier run in it stays as it was.
    """
    began = time.perf_counter()
    scenario = prepared or make_scenario(config)
    start = config.learning.start_from
    if start is not None and Path(start).resolve() == folder.resolve():
        raise BadInput("learning.start_from", start, f"is the folder of this run; choose another {RUN_KEY}")
    with new_result(folder, RUN_KEY, durable=durable) as writer:
        for name, text in (record or {}).items():
            writer.write_text(f"{manifests.HYDRA_FOLDER}/{name}", text)
        manifest, scores = _write(scenario, writer, watch, warn)
        manifest |= {} if overrides is None else {"overrides": list(overrides)}
        manifest["wall_seconds"] = time.perf_counter() - began
        manifests.write(writer.part, manifest, durable=False)  # but with the whole result, if that is
        writer.status = manifest["status"]
    if writer.overtook:
        text = f"warning: {folder}: another run was written there meanwhile, which this one has replaced"
        print(in_one_line(text), file=sys.stderr)
    run = Run(writer.folder, manifest)
    run.scores = scores
    return run


def describe_run(scenario: Scenario, end: End) -> manifests.Manifest:
    """The manifest of a run that has ended, without what its metrics and its files add."""
    config, controller, feedforward = scenario.setup.config, scenario.controller, scenario.feedforward
    # External components may use these names for something else.
    dropped = controller.dropped if isinstance(controller, HybridController) else {}
    memory = feedforward.memory if isinstance(feedforward, BuiltInFeedforward) else ()
    entries: dict[str, Any] = {
        "steps": end.steps,
        "guard": to_plain([*end.events]),
        "dropped": [{"leg": leg, "step": step} for leg, step in dropped.items()],
        "memory": to_plain([*memory]),
        **compute_hashes(config, *(getattr(scenario, group) for group in COMPONENTS)),
        "learning_lead": end.estimates[-1].lead if end.estimates else scenario.setup.lead,
        "learning_rate": end.rate,
        "lead_estimates": to_plain(end.estimates),
        "carried": [
            {"cycle": cycle, "measured_weight": weight, **load._asdict()} for cycle, load, weight in end.load_history
        ],
        "rollout_seconds": end.seconds,
        "processor_seconds": end.processor_seconds,
    }
    mechanism = scenario.setup.mechanism
    if mechanism.chains is not None and isinstance(config.machine, RobotMachine):  # for views of its trace
        entries["robot"] = {
            "chains": mechanism.chains.tolist(),
            "hips": mechanism.hips.tolist(),
            "foot_radius": float(read_model(config.machine).legs.foot_radius.max()),
        }
    plant = scenario.plant
    if scenario.fault is None and hasattr(plant, "describe"):
        try:
            with exits_caught():
                described = plant.describe()
            entries["plant"] = json.loads(json.dumps(described))
        except Exception as raised:
            cause = f"after step {end.steps}: {type(plant).__name__}.describe: {describe_failure(raised)}"
            end = end if end.error else replace(end, status=Status.FAILED, cause=cause, error=raised)
    if end.error is not None and not isinstance(end.error, BadOutput | MemoryError):
        entries["traceback"] = format_user_traceback(end.error)
    return manifests.make_manifest(to_plain(config), end.status, end.cause, **entries)


def _write(
    scenario: Scenario, writer: ResultWriter, watch: Callable[[float], None], warn: Callable[[Drift], None]
) -> tuple[manifests.Manifest, Scores]:
    """Run, and write everything but the manifest, which is returned, with the metrics."""
    config, folder = scenario.setup.config, writer.part
    end, scores, names = _roll_out(scenario, folder, watch, warn)
    names += write_scores(folder, scores, config.record.trace)
    manifest = describe_run(scenario, end)
    try:
        _write_extras(scenario, writer, manifest, names)
    except Exception as error:  # of a disk that is full, or of a component: what is listed is whole
        manifest |= {"status": str(Status.FAILED), "cause": f"after step {end.steps}: {describe_failure(error)}"}
        if not isinstance(error, OSError | BadOutput | MemoryError):
            manifest["traceback"] = format_user_traceback(error)
    manifest["drift"] = make_drift_entry(scores.legs)
    return manifest | {"files": {name: sha256(folder / name) for name in names}}, scores
