"""One run from its config to its folder: closed loop, traces, metrics, recording, manifest; also one that failed."""

import hashlib
import json
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.config import Config, to_plain
from cmacexp.config.component import COMPONENTS
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.control import HybridController
from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256, write_atomically
from cmacexp.data.folder import RUN_KEY, ResultWriter, new_result
from cmacexp.data.integrity import compute_hashes
from cmacexp.data.records import Drift
from cmacexp.data.run import Run
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    MEMORY_FILE,
    METRICS_FILE,
    RECORDING_FILE,
    TRACE_FILE,
    Scores,
    as_array,
    write_scores,
    write_table,
)
from cmacexp.data.trace import Trace, concat_traces, count_steps_by_cycle, trace_writer
from cmacexp.data.weights import WEIGHTS
from cmacexp.engine.stop_cause import explain_stop
from cmacexp.errors import BadInput, BadOutput, describe_failure, format_user_traceback, in_one_line
from cmacexp.feedforward import Learns
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.interrupt import exits_caught, interrupt_held_back
from cmacexp.loop import run_cycles
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.trace import TraceColumns, select_columns
from cmacexp.metrics.drift import make_drift_entry
from cmacexp.metrics.score import RunScorer
from cmacexp.protocols import Described, offers
from cmacexp.typing import Status


class Recorder:
    """Follows a run, cycle by cycle: its metrics, and the traces of its last cycles, which show why it stopped."""

    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self.scorer = RunScorer(scenario.setup.config.steps_per_cycle)
        self._last = deque[Trace](maxlen=2)  # the last one may be short

    def add(self, trace: Trace) -> Drift | None:
        """Take the next cycles; returns the first drift if it is in them."""
        self._last.append(trace)
        return self.scorer.add(trace)

    def finish(self) -> Scores:
        """Add to the cause of a fall or a divergence what was seen before it; returns the metrics."""
        end = self.scenario.end
        end.cause += explain_stop(self.scenario, self._last, self.scorer.drift)
        return self.scorer.scores


def score_run(scenario: Scenario) -> Scores:
    """Run a new scenario and write nothing; returns its metrics, ``scenario.end`` says how it ended."""
    recorder = Recorder(scenario)
    for trace in run_cycles(scenario):
        recorder.add(trace)
    return recorder.finish()


def describe_scores(scores: Scores) -> manifests.Manifest:
    """Describe metrics that have no files: the first drift, and in place of files the hashes of their values."""
    tables = {METRICS_FILE: scores.legs} | ({} if scores.body is None else {BODY_METRICS_FILE: scores.body})
    files = {}
    for name, table in tables.items():
        values = np.column_stack([as_array(table, column) for column in table.column_names])
        files[name] = hashlib.sha256(values.tobytes()).hexdigest()
    return {"drift": make_drift_entry(scores.legs), "files": files}


@exits_caught()
def _write_extras(scenario: Scenario, writer: ResultWriter, manifest: manifests.Manifest, names: list[str]) -> None:
    """Write weights and recording if the config asks for them; weights are added to the names of the files."""
    record = scenario.setup.config.record
    folder = writer.part
    if record.weights and offers(scenario.feedforward, Learns):
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
    cycles done so far, see :func:`cmacexp.loop.run_cycles`, ``warn`` once a drift is detected. ``record`` is Hydra's
    own, texts by file name. ``overrides`` are those that the config comes from, None if it came whole. A result that
    is not ``durable`` may be lost in a power failure: a sweep that is resumed runs such a job again.

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


def describe_run(scenario: Scenario) -> manifests.Manifest:
    """Describe a run that has ended: its manifest, without what its metrics and its files add."""
    end = scenario.end
    config = scenario.setup.config
    # External components may use these names for something else.
    controller = scenario.controller
    feedforward = scenario.feedforward
    dropped = controller.dropped if isinstance(controller, HybridController) else {}
    memory = feedforward.memory if isinstance(feedforward, BuiltInFeedforward) else ()
    entries: dict[str, Any] = {
        **to_plain(end.list_entries()),
        "dropped": [{"leg": leg, "step": step} for leg, step in dropped.items()],
        "memory": to_plain([*memory]),
        **compute_hashes(config, *(vars(scenario)[group] for group in COMPONENTS)),
    }
    mechanism = scenario.setup.mechanism
    if mechanism.chains is not None and isinstance(config.machine, RobotMachine):  # for views of its trace
        entries["robot"] = {
            "chains": mechanism.chains.tolist(),
            "hips": mechanism.hips.tolist(),
            "foot_radius": float(read_model(config.machine).legs.foot_radius.max()),
        }
    plant = scenario.plant
    if scenario.fault is None and offers(plant, Described):
        try:
            with exits_caught():
                described = plant.describe()
            entries["plant"] = json.loads(json.dumps(described))
        except Exception as raised:
            if end.error is None:
                entries["cause"] = (
                    f"after step {end.steps}: {type(plant).__name__}.describe: {describe_failure(raised)}"
                )
                entries["status"] = str(Status.FAILED)
                end.error = raised
    if end.error is not None and not isinstance(end.error, BadOutput | MemoryError):
        entries["traceback"] = format_user_traceback(end.error)
    return manifests.make_manifest(to_plain(config), **entries)


def _write(
    scenario: Scenario, writer: ResultWriter, watch: Callable[[float], None], warn: Callable[[Drift], None]
) -> tuple[manifests.Manifest, Scores]:
    """Run, and write everything but the manifest, which is returned, with the metrics."""
    config = scenario.setup.config
    folder = writer.part
    columns = select_columns(scenario)
    recorder = Recorder(scenario)
    with trace_writer(folder, config.record, *columns) as traces:
        for trace in run_cycles(scenario, watch):
            traces.write(trace)
            if (drift := recorder.add(trace)) is not None:
                warn(drift)
        traces.finish(scenario.end.status == Status.COMPLETED)
    scores = recorder.finish()
    names = _write_tables(recorder, folder, columns, scores)
    manifest = describe_run(scenario)
    try:
        _write_extras(scenario, writer, manifest, names)
    except Exception as error:  # of a disk that is full, or of a component: what is listed is whole
        cause = f"after step {scenario.end.steps}: {describe_failure(error)}"
        manifest |= {"status": str(Status.FAILED), "cause": cause}
        if not isinstance(error, OSError | BadOutput | MemoryError):
            manifest["traceback"] = format_user_traceback(error)
    manifest["drift"] = make_drift_entry(scores.legs)
    return manifest | {"files": {name: sha256(folder / name) for name in names}}, scores


def _write_tables(recorder: Recorder, folder: Path, columns: TraceColumns, scores: Scores) -> list[str]:
    """Write memory and metrics of a run beside its traces; returns the names of all of its tables."""
    keeps_trace = recorder.scenario.setup.config.record.trace
    names = []
    if keeps_trace:
        names = [TRACE_FILE, BODY_FILE] if columns.body else [TRACE_FILE]
        if recorder.scorer.memory:
            write_table(concat_traces(recorder.scorer.memory).table, folder / MEMORY_FILE)
            names.append(MEMORY_FILE)
    return names + write_scores(folder, scores, keeps_trace)
