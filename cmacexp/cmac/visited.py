"""Addressing without collisions: every cell gets its own row when it is first visited."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cmacexp.cmac.changes import find_entered
from cmacexp.errors import BadInput
from cmacexp.typing import Cells

Positions = NDArray[np.uint64]


@dataclass
class Visited:
    """The cells visited so far; the n-th of them has row n.

    Args:
        rows: of memory, which limits the number of cells.
        row_bytes: of one row.
        positions: (cells,): the cells that have a row, by their positions in dense memory.
    """

    rows: int
    row_bytes: int
    positions: Positions = field(default_factory=lambda: np.zeros(0, dtype=np.uint64))

    def assign_rows(self, positions: Positions) -> Cells:
        """Rows (samples, C) of cells (samples, C); new cells get the next rows, in the order of this array.

        Raises:
            BadInput: there are more cells than rows; no row is assigned.
        """
        new, first = np.unique(positions[find_entered(positions)], return_index=True)
        fresh = ~np.isin(new, self.positions)
        known = np.concatenate([self.positions, new[fresh][np.argsort(first[fresh])]])
        if len(known) > self.rows:
            needed = len(known) * self.row_bytes
            raise BadInput(
                "cmac.memory_bytes",
                self.rows * self.row_bytes,
                f"must be at least {needed} B for the {len(known)} cells visited so far; or cmac.addressing=hashed",
            )
        self.positions = known
        order = np.argsort(known)
        rows: Cells = order[np.searchsorted(known, positions, sorter=order)].astype(np.uint32)
        return rows
