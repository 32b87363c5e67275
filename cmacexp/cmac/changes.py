"""Where a path enters a cell: far fewer cells have to be sorted to find the distinct ones than are active."""

import numpy as np

from cmacexp.typing import Cells, Mask


def find_entered(cells: Cells) -> Mask:
    """Whether an active cell is new, (samples, C): none in its layer at the sample before.

    Every distinct cell is entered, and in the order of the array it is entered where it first occurs.

    Args:
        cells: (samples, C): active cells along a path, or their rows.
    """
    entered = np.ones(cells.shape, dtype=bool)
    np.not_equal(cells[1:], cells[:-1], out=entered[1:])
    return entered
