"""One run from its config to its folder: roll out, trace, metrics, recording, manifest."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.config import Config, config_hash, to_plain
from cmacexp.config.schema import RecordConfig
from cmacexp.control import HybridController, Learns
from cmacexp.data import manifest as manifests
from cmacexp.data.files import remove_leftovers, sha256
from cmacexp.data.parquet import as_array, rows_of, table_writer
from cmacexp.data.signals import BODY_SIGNALS, LEG_SIGNALS, Signal, make_schema, select_signals
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import (
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
)
from cmacexp.data.weights import WEIGHTS, start_hash, write_weights
from cmacexp.errors import BadOutput, format_user_traceback
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.sources import code_hash
from cmacexp.loop import End, Samples, stream
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.trace import assemble, assemble_body, assemble_memory
from cmacexp.metrics import BodyScorer, Scorer
from cmacexp.metrics.drift import Drift, make_drift_entry
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.sensors.protocol import altered_by


def clear(folder: Path) -> None:
    """Make room for a run: what an earlier one left under the same names goes, its manifest first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (manifests.NAME, TRACE, BODY, MEMORY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING, WEIGHTS):
        (folder / name).unlink(missing_ok=True)
    remove_leftovers(folder)


def _columns(scenario: Scenario) -> tuple[tuple[Signal, ...], tuple[Signal, ...] | None]:
    """Columns of the traces of legs and body; None without a body."""
    altered, watched = altered_by(scenario.sensors), scenario.setup.config.plausibility.enabled
    legs = select_signals(LEG_SIGNALS, altered, watched)
    return legs, select_signals(BODY_SIGNALS, altered) if scenario.setup.mechanism.kind == LEGS_UNDER_BODY else None


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
    return assemble_memory(weights, feedforward.params.weights.shape[1], colliding, first)


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
) -> StoredRun:
    """Run a scenario and keep what it gives in ``folder``.

    Args:
        config: a checked config.
        folder: is made if missing; files of an earlier run in it are replaced.
        watch: is called with the cycles done so far, see :func:`cmacexp.loop.stream`.
        prepared: the scenario of ``config`` if it is already made.
        warn: is called when a drift of learning is detected, while the run goes on; see :mod:`cmacexp.metrics.drift`.

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
        "drift": make_drift_entry(scores.legs),
        "learning_lead": scenario.setup.lead,
        **_told_by_parts(scenario),
        "rollout_seconds": end.seconds,
        "wall_seconds": time.perf_counter() - began,
        "files": {name: sha256(folder / name) for name in names},
    }
    if end.error is not None and not isinstance(end.error, BadOutput):
        manifest["traceback"] = format_user_traceback(end.error)
    manifests.write(folder, manifest)
    return StoredRun(folder)


class RunWriter:
    """Takes what a run leaves of its steps, part by part; see :func:`writing`."""

    def __init__(self, writers: Sequence[pq.ParquetWriter], record: RecordConfig, steps_per_cycle: int):
        self.writers = writers
        self.record = record
        self.legs, self.body = Scorer(steps_per_cycle), BodyScorer(steps_per_cycle)

    def _kept(self, table: pa.Table) -> pa.Table:
        """The rows that go into the trace."""
        if not self.record.thins:
            return table
        keep = as_array(table, "step") % self.record.every_nth_step == 0
        if self.record.cycles is not None:
            keep &= np.isin(as_array(table, "cycle"), self.record.cycles)
        return rows_of(table, keep)

    def add(self, traces: Traces) -> None:
        """Score the next cycles, and keep of their traces what is asked for."""
        self.legs.add(traces.legs)
        if traces.body is not None:
            self.body.add(traces.body)
        if traces.memory is not None:
            self.legs.add_memory(traces.memory)
        for writer, table in zip(self.writers, traces[:2], strict=False):
            kept = self._kept(table)
            if kept.num_rows:
                writer.write_table(kept)

    @property
    def drift(self) -> Drift | None:
        """The first drift so far."""
        return self.legs.drift

    @property
    def scores(self) -> Scores:
        """The metrics of all steps so far."""
        return Scores(self.legs.table(), self.body.table() if len(self.writers) > 1 else None)


@contextmanager
def writing(
    folder: Path,
    record: RecordConfig,
    steps_per_cycle: int,
    legs: Sequence[Signal],
    body: Sequence[Signal] | None,
) -> Iterator[RunWriter]:
    """Write the traces of a run as it goes on; they appear when the block ends well.

    Args:
        folder: of the run.
        record: what of the traces is kept.
        steps_per_cycle: N.
        legs: columns of their trace.
        body: likewise; None for a machine without a body.
    """
    with ExitStack() as stack:
        files = [(TRACE, legs), *([(BODY, body)] if body else [])]
        writers = [stack.enter_context(table_writer(folder / name, make_schema(columns))) for name, columns in files]
        yield RunWriter(writers, record, steps_per_cycle)
