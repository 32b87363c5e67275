"""The metrics of a run, one row per cycle and leg, from its traces, which may come in blocks of cycles."""

import numpy as np
import pyarrow as pa

from cmacexp.data.records import Drift
from cmacexp.data.run import Run
from cmacexp.data.tables import Scores
from cmacexp.data.trace import Trace, read_memory, stream_trace
from cmacexp.errors import BadRun
from cmacexp.metrics.block import Block, split_cycles
from cmacexp.metrics.body import compute_body
from cmacexp.metrics.drift import LEARNING, MEMORY_METRICS, DriftDetector, join_memory
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import to_table
from cmacexp.metrics.registry import LEG_METRICS, OF_A_CYCLE
from cmacexp.typing import Array


class RunScorer:
    """The metrics of a run, from traces of consecutive cycles; only the last cycle of the run may be incomplete."""

    def __init__(self, steps_per_cycle: int):
        self.steps_per_cycle = steps_per_cycle
        self._block: Block | None = None
        self._values: list[dict[str, Array]] = []
        self.memory: list[Trace] = []
        """Traces of the weights at the end of each cycle (``memory.parquet``)."""
        self._body: list[pa.Table] = []
        self._detector: DriftDetector | None = None

    @property
    def drift(self) -> Drift | None:
        """The first drift so far, with the growth at its detection; None if there is none."""
        return self._detector.first if self._detector else None

    def add(self, trace: Trace) -> Drift | None:
        """Score the next cycles of legs, body and memory; return the first drift if these cycles contain it."""
        earlier_drift = self.drift
        self._block = block = split_cycles(trace, self.steps_per_cycle, self._block)
        metrics = OF_A_CYCLE if block.joint_error is None else {**OF_A_CYCLE, **SPATIAL}
        values = {name: metric.compute(block) for name, metric in metrics.items()}
        feedback = values["feedback_rms"]
        self._detector = self._detector or DriftDetector(feedback.shape[1])
        values["feedback_growth"], values["drift_cycle"] = self._detector.add(feedback)
        self._values.append(values)
        if trace.body is not None:
            done = sum(table.num_rows for table in self._body)
            self._body.append(compute_body(trace.body, self.steps_per_cycle, done + 1))
        if trace.memory is not None:
            self.memory.append(trace.memory)
        return None if earlier_drift else self.drift

    @property
    def scores(self) -> Scores:
        """The metrics of all cycles so far; NaN where undefined."""
        values = {name: np.concatenate([block[name] for block in self._values]) for name in self._values[0]}
        cycles, legs = next(iter(values.values())).shape
        values |= {name: metric.compute(values) for name, metric in LEARNING.items()}
        memory = join_memory(self.memory, cycles, legs)
        values |= {name: metric.compute(memory) for name, metric in MEMORY_METRICS.items()}
        index = {
            "cycle": np.repeat(np.arange(1, cycles + 1), legs),
            "leg": np.tile(np.arange(1, legs + 1), cycles),
        }
        body = pa.concat_tables(self._body).combine_chunks() if self._body else None
        columns = {**LEG_METRICS, **SPATIAL} if SPATIAL.keys() <= values.keys() else LEG_METRICS
        return Scores(to_table(index, values, columns), body)


def score_traces(run: Run) -> Scores:
    """Compute the metrics of a stored run; raises BadRun if its traces do not contain every step and cycle."""
    scorer = RunScorer(run.steps_per_cycle)
    steps = 0
    for trace in stream_trace(run.folder):
        scorer.add(trace)
        steps += trace.steps
    if steps != run.manifest["steps"]:
        raise BadRun(f"{run.folder}: its trace has {steps} steps, not all {run.manifest['steps']}")
    if (memory := read_memory(run.folder)) is not None:
        if memory.steps != run.last_cycle:
            raise BadRun(f"{run.folder}: its memory has {memory.steps} cycles, not all {run.last_cycle}")
        scorer.memory.append(memory)
    return scorer.scores
