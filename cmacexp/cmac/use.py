"""Use of the memory of a CMAC along a path, and collisions of its cells by hashing."""

from typing import NamedTuple

import numpy as np

from cmacexp.cmac.addressing import address_batch, count_outside
from cmacexp.cmac.memory import find_entered
from cmacexp.cmac.network import Cmac
from cmacexp.config.cmac import MOST_POSITIONS
from cmacexp.typing import Array, Cells


class MemoryUse(NamedTuple):
    """Use of memory by the inputs of a path."""

    rows: int
    """Rows of memory."""
    rows_used: int
    """Rows that the path reads and trains."""
    cells_visited: int | None
    """Cells of the CMAC before hashing, over all layers; None if their positions do not fit into 64 bits."""
    cells_colliding: int | None
    """Visited cells that share their row with another one."""
    clipped: int
    """Inputs of the path outside their range."""


def memory_use(cmac: Cmac, inputs: Array, cells: Cells) -> MemoryUse:
    """Use of the memory of ``cmac`` by a path of inputs (samples, n), whose rows are ``cells`` (samples, C)."""
    params = cmac.address
    clipped = count_outside(params.ranges, inputs)
    if cmac.layers * params.resolution_elements ** inputs.shape[1] > MOST_POSITIONS:
        used = np.unique(cells[find_entered(cells)])
        return MemoryUse(params.rows, len(used), None, None, clipped)
    positions = np.empty((len(inputs), cmac.layers), dtype=np.uint64)
    address_batch(params._replace(hashed=False), inputs, positions)
    entered = find_entered(positions)
    visited, first = np.unique(positions[entered], return_index=True)
    used, sharing = np.unique(cells[entered][first], return_counts=True)
    return MemoryUse(params.rows, len(used), len(visited), int(sharing[sharing > 1].sum()), clipped)
