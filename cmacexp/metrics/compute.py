"""From a trace to one row of metrics per cycle and leg."""

import numpy as np
import pyarrow as pa

from cmacexp.data.parquet import as_array, is_support
from cmacexp.metrics.block import Block, rhythm_of
from cmacexp.metrics.drift import Drift, DriftWatch
from cmacexp.metrics.learning import LEARNING
from cmacexp.metrics.memory import MEMORY, values_of
from cmacexp.metrics.metric import CYCLE, LEG, to_table
from cmacexp.metrics.registry import METRICS, OF_A_CYCLE
from cmacexp.typing import Array


def cut(trace: pa.Table, steps_per_cycle: int, before: Block | None = None) -> Block:
    """Cut a trace into cycles; the last may be short.

    Args:
        trace: of a run, or of a part of it.
        steps_per_cycle: N.
        before: the part before it, which tells the rhythm of the run; None: this one begins the run.
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
        before.rhythm if before else rhythm_of(time, progress, valid, support),
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
    """The metrics of a run whose trace comes part by part.

    Args:
        steps_per_cycle: N.
    """

    def __init__(self, steps_per_cycle: int):
        self.steps_per_cycle = steps_per_cycle
        self.block: Block | None = None
        self.parts: list[dict[str, Array]] = []
        self.memory: list[pa.Table] = []
        self.watch: DriftWatch | None = None
        self.drift: Drift | None = None
        """The first drift seen so far, as known when it was named."""

    def add_memory(self, memory: pa.Table) -> None:
        """Take what the weights were at the end of the next cycles (:func:`cmacexp.loop.trace.assemble_memory`)."""
        self.memory.append(memory)

    def add(self, trace: pa.Table) -> None:
        """Score the next cycles; only the last of the run may be short."""
        self.block = block = cut(trace, self.steps_per_cycle, self.block)
        part = {name: metric.of(block) for name, metric in OF_A_CYCLE.items()}
        self.parts.append(part)
        self._watch(part["feedback_rms"])

    def _watch(self, feedback: Array) -> None:
        """Look for a drift in the RMS feedback (cycles, L) of the next cycles."""
        self.watch = self.watch or DriftWatch(feedback.shape[1])
        done = self.watch.done
        growth, started = self.watch.add(feedback)
        if self.drift is None and len(seen := np.argwhere(~np.isnan(started))):
            cycle, leg = seen[0]
            told = int(started[cycle, leg]), int(leg) + 1, int(done + cycle) + 1
            self.drift = Drift(*told, float(growth[cycle, leg]))

    def table(self) -> pa.Table:
        """One row per cycle and leg; undefined is NaN."""
        values = {name: np.concatenate([part[name] for part in self.parts]) for name in OF_A_CYCLE}
        cycles, legs = next(iter(values.values())).shape
        values |= {name: metric.of(values) for name, metric in LEARNING.items()}
        kept = values_of(pa.concat_tables(self.memory) if self.memory else None, cycles, legs)
        values |= {name: metric.of(kept) for name, metric in MEMORY.items()}
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
