"""Addressing without collisions: every cell gets its own row when it is first visited."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput
from cmacexp.typing import Cells, Mask

Positions = NDArray[np.uint64]


def find_entered(cells: Cells | Positions) -> Mask:
    """Whether an active cell is new, (samples, C): none in its layer at the sample before.

    Every distinct cell is entered, and in the order of the array it is entered where it first occurs. So far fewer
    cells have to be sorted to find the distinct ones than are active.

    Args:
        cells: (samples, C): active cells along a path, or their rows.
    """
    entered = np.ones(cells.shape, dtype=bool)
    np.not_equal(cells[1:], cells[:-1], out=entered[1:])
    return entered


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
