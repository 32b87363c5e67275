"""The memory of a run: what the weights of its networks were at the end of each cycle."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from cmacexp.arrays import Array
from cmacexp.control.weight_log import LOGGED
from cmacexp.table import arrow
from cmacexp.trace import Column, schema_of

MEMORY_COLUMNS = (
    Column("cycle", "", "gait cycle, from 1", pa.int32()),
    Column("leg", "", "as in the trace", pa.int32()),
    Column("weight_norm", "N m", "Euclidean norm of all weights of the network at the end of the cycle"),
    Column("weight_largest", "N m", "largest absolute weight at the end of the cycle"),
    Column("rows_used", "", "rows of memory with a weight other than 0 at the end of the cycle"),
    Column("rows", "", "rows of memory that the network has"),
    Column("cells_colliding", "", "cells of the planned path that share their row with another; NaN if not counted"),
)


def assemble_memory(weights: Array, rows: int, colliding: Sequence[float], first_cycle: int) -> pa.Table:
    """The memory of the networks of L legs over a run, or a part of it, one row per cycle and leg.

    Args:
        weights: (cycles, L, 3): as :data:`cmacexp.control.weight_log.LOGGED`.
        rows: of the memory of one network.
        colliding: (L,): cells that share their row with another; NaN if not counted.
        first_cycle: number of the first of these cycles.
    """
    cycles, legs = weights.shape[:2]
    columns = {
        "cycle": np.repeat(np.arange(first_cycle, first_cycle + cycles), legs),
        "leg": np.tile(np.arange(1, legs + 1), cycles),
        **{name: weights[:, :, k].ravel() for k, name in enumerate(LOGGED)},
        "rows": np.full(cycles * legs, float(rows)),
        "cells_colliding": np.tile(np.asarray(colliding, dtype=float), cycles),
    }
    arrays = [arrow(columns[c.name], c.type) for c in MEMORY_COLUMNS]
    return pa.Table.from_arrays(arrays, schema=schema_of(MEMORY_COLUMNS))
