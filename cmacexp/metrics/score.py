"""The metrics of a run, one row per cycle and leg, from its tables, which may come in parts."""

import numpy as np
import pyarrow as pa

from cmacexp.data.hashes import was_written
from cmacexp.data.parquet import read_parts
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY_FILE, MEMORY_FILE, TRACE_FILE, Scores, Traces
from cmacexp.metrics.block import Block, split_cycles
from cmacexp.metrics.body import compute_body
from cmacexp.metrics.drift import LEARNING, Drift, DriftDetector
from cmacexp.metrics.memory import MEMORY_METRICS, split_columns
from cmacexp.metrics.metric import CYCLE, LEG, to_table
from cmacexp.metrics.registry import LEG_METRICS, OF_A_CYCLE
from cmacexp.metrics.tracking import SPATIAL
from cmacexp.typing import Array


class RunScorer:
    """The metrics of a run whose tables come in parts: of some cycles each, the last of the run may be short."""

    def __init__(self, steps_per_cycle: int):
        self.steps_per_cycle = steps_per_cycle
        self._block: Block | None = None
        self._parts: list[dict[str, Array]] = []
        self.memory: list[pa.Table] = []
        """Weights at the end of cycles (:func:`cmacexp.loop.trace.assemble_memory`)."""
        self._body: list[pa.Table] = []
        self._detector: DriftDetector | None = None

    @property
    def drift(self) -> Drift | None:
        """The first drift so far, as known when it was detected."""
        return self._detector.first if self._detector else None

    def add(self, traces: Traces) -> None:
        """Score the next cycles."""
        self.add_legs(traces.legs)
        if traces.body is not None:
            self.add_body(traces.body)
        if traces.memory is not None:
            self.memory.append(traces.memory)

    def add_legs(self, trace: pa.Table) -> None:
        """Score the legs in the next cycles (:func:`cmacexp.loop.trace.assemble`)."""
        self._block = block = split_cycles(trace, self.steps_per_cycle, self._block)
        known = OF_A_CYCLE if block.joint_error is None else {**OF_A_CYCLE, **SPATIAL}
        part = {name: metric.compute(block) for name, metric in known.items()}
        feedback = part["feedback_rms"]
        self._detector = self._detector or DriftDetector(feedback.shape[1])
        part["feedback_growth"], part["drift_cycle"] = self._detector.add(feedback)
        self._parts.append(part)

    def add_body(self, body: pa.Table) -> None:
        """Score the body in the next cycles (:func:`cmacexp.loop.trace.assemble_body`)."""
        done = sum(table.num_rows for table in self._body)
        self._body.append(compute_body(body, self.steps_per_cycle, done + 1))

    @property
    def scores(self) -> Scores:
        """The metrics of all cycles so far; undefined is NaN."""
        values = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        cycles, legs = next(iter(values.values())).shape
        values |= {name: metric.compute(values) for name, metric in LEARNING.items()}
        memory = split_columns(pa.concat_tables(self.memory) if self.memory else None, cycles, legs)
        values |= {name: metric.compute(memory) for name, metric in MEMORY_METRICS.items()}
        index = {
            "cycle": (CYCLE, np.repeat(np.arange(1, cycles + 1), legs)),
            "leg": (LEG, np.tile(np.arange(1, legs + 1), cycles)),
        }
        body = pa.concat_tables(self._body).combine_chunks() if self._body else None
        columns = {**LEG_METRICS, **SPATIAL} if SPATIAL.keys() <= values.keys() else LEG_METRICS
        return Scores(to_table(index, values, columns), body)


def score_traces(run: StoredRun) -> Scores:
    """The metrics of a run from its traces, which must hold every step; raises BadRun."""
    scorer, folder = RunScorer(run.steps_per_cycle), run.folder
    for part in read_parts(folder / TRACE_FILE):
        scorer.add_legs(part)
    if was_written(folder / MEMORY_FILE):
        scorer.memory.extend(read_parts(folder / MEMORY_FILE))
    if was_written(folder / BODY_FILE):
        for part in read_parts(folder / BODY_FILE):
            scorer.add_body(part)
    return scorer.scores
