"""From a trace to one row of metrics per cycle and leg."""

import numpy as np
import pyarrow as pa

from cmacexp.arrays import Array
from cmacexp.metrics.definitions import METRICS, Block
from cmacexp.table import arrow, as_array, is_support


def cut(trace: pa.Table, steps_per_cycle: int) -> Block:
    """Cut a trace into cycles; the last may be short."""
    legs = int(as_array(trace, "leg").max(initial=1))
    rows = trace.num_rows
    cycles = -(-rows // (steps_per_cycle * legs))

    def block(values: Array) -> Array:
        padded = np.full(cycles * steps_per_cycle * legs, np.nan)
        padded[:rows] = values
        return padded.reshape(cycles, steps_per_cycle, legs)

    def columns(name: str) -> Array:
        return block(as_array(trace, name))

    time = columns("time")
    return Block(
        ~np.isnan(time),
        block(is_support(trace).astype(float)) == 1.0,
        columns("progress"),
        time,
        columns("x") - columns("x_desired"),
        columns("y") - columns("y_desired"),
        columns("force"),
        columns("force_desired"),
        np.stack([columns("tau_feedback_1"), columns("tau_feedback_2")], axis=3),
        np.stack([columns("tau_feedforward_1"), columns("tau_feedforward_2")], axis=3),
    )


def compute(trace: pa.Table, steps_per_cycle: int) -> pa.Table:
    """Metrics of a trace, one row per cycle and leg; undefined is NaN.

    Args:
        trace: as :func:`cmacexp.trace.assemble` makes it; the last cycle may be short.
        steps_per_cycle: N.
    """
    block = cut(trace, steps_per_cycle)
    cycles, _, legs = block.valid.shape
    fields = [
        pa.field("cycle", pa.int32(), metadata={"unit": "", "meaning": "gait cycle, from 1"}),
        pa.field("leg", pa.int32(), metadata={"unit": "", "meaning": "as in the trace"}),
    ]
    arrays = [
        arrow(np.repeat(np.arange(1, cycles + 1), legs), pa.int32()),
        arrow(np.tile(np.arange(1, legs + 1), cycles), pa.int32()),
    ]
    for name, metric in METRICS.items():
        arrays.append(arrow(metric.of(block).ravel(), pa.float64()))
        fields.append(pa.field(name, pa.float64(), metadata={"unit": metric.unit, "meaning": metric.meaning}))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
