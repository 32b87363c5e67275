"""From a trace to one row of metrics per cycle and leg."""

import numpy as np
import pyarrow as pa

from cmacexp.data.parquet import as_array, is_support
from cmacexp.metrics.block import Block, read_rhythm
from cmacexp.metrics.drift import Drift, DriftDetector
from cmacexp.metrics.learning import LEARNING
from cmacexp.metrics.memory import MEMORY, split_columns
from cmacexp.metrics.metric import CYCLE, LEG, to_table
from cmacexp.metrics.registry import METRICS, OF_A_CYCLE
from cmacexp.typing import Array


def cut(trace: pa.Table, steps_per_cycle: int, before: Block | None = None) -> Block:
    """Cut a trace into cycles; the last may be short.

    Args:
        trace: of a run, or a part of it.
        steps_per_cycle: N.
        before: the part before it, which has the rhythm of the run; None: this is the first part.
    """
    legs = int(as_array(trace, "leg").max(initial=1))
    rows = trace.num_rows
    cycles = -(-rows // (steps_per_cycle * legs))

    def block(values: Array) -> Array:
        padded = np.full(cycles * steps_per_cycle * legs, np.nan)
        padded[:rows] = values
        return np.ascontiguousarray(padded.reshape(cycles, steps_per_cycle, legs).swapaxes(1, 2))

    def columns(name: str) -> Array:
        return block(as_array(trace, name))

    time, progress = columns("time"), columns("progress")
    valid, support = ~np.isnan(time), block(is_support(trace).astype(float)) == 1.0
    return Block(
        before.rhythm if before else read_rhythm(time, progress, valid, support),
        valid,
        support,
        progress,
        time,
        columns("x") - columns("x_desired"),
        columns("y") - columns("y_desired"),
        columns("force"),
        columns("force_desired"),
        np.stack([columns("tau_feedback_1"), columns("tau_feedback_2")], axis=3),
        np.stack([columns("tau_feedforward_1"), columns("tau_feedforward_2")], axis=3),
        before.feedback[-1] if before else None,
    )


class Scorer:
    """The metrics of a run whose trace arrives in parts.

    Args:
        steps_per_cycle: N.
    """

    def __init__(self, steps_per_cycle: int):
        self.steps_per_cycle = steps_per_cycle
        self.block: Block | None = None
        self.parts: list[dict[str, Array]] = []
        self.memory: list[pa.Table] = []
        self.detector: DriftDetector | None = None

    @property
    def drift(self) -> Drift | None:
        """The first drift so far, as known when it was detected."""
        return self.detector.first if self.detector else None

    def add_memory(self, memory: pa.Table) -> None:
        """Add the weights at the end of the next cycles (:func:`cmacexp.loop.trace.assemble_memory`)."""
        self.memory.append(memory)

    def add(self, trace: pa.Table) -> None:
        """Score the next cycles; only the last of the run may be short."""
        self.block = block = cut(trace, self.steps_per_cycle, self.block)
        part = {name: metric.compute(block) for name, metric in OF_A_CYCLE.items()}
        self.parts.append(part)
        feedback = part["feedback_rms"]
        self.detector = self.detector or DriftDetector(feedback.shape[1])
        self.detector.add(feedback)

    def table(self) -> pa.Table:
        """One row per cycle and leg; undefined is NaN."""
        values = {name: np.concatenate([part[name] for part in self.parts]) for name in OF_A_CYCLE}
        cycles, legs = next(iter(values.values())).shape
        values |= {name: metric.compute(values) for name, metric in LEARNING.items()}
        memory = split_columns(pa.concat_tables(self.memory) if self.memory else None, cycles, legs)
        values |= {name: metric.compute(memory) for name, metric in MEMORY.items()}
        index = {
            "cycle": (CYCLE, np.repeat(np.arange(1, cycles + 1), legs)),
            "leg": (LEG, np.tile(np.arange(1, legs + 1), cycles)),
        }
        return to_table(index, values, METRICS)


def compute(trace: pa.Table, steps_per_cycle: int) -> pa.Table:
    """Metrics of a trace, one row per cycle and leg; undefined is NaN.

    Args:
        trace: as :func:`cmacexp.loop.trace.assemble` makes it; the last cycle may be short.
        steps_per_cycle: N.
    """
    scorer = Scorer(steps_per_cycle)
    scorer.add(trace)
    return scorer.table()
