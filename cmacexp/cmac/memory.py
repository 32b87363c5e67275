"""Reading and training the rows of a CMAC."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput
from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import Array, Cells, Mask

Positions = NDArray[np.uint64]


@kernel
def read(weights: Array, cells: Cells, output: Array) -> None:
    """Sum of the active weights: D_d = sum W_i (Lin & Song 1997, eq. 18).

    Fills ``output`` (2,) from the rows ``cells`` (C,) of ``weights`` (rows, 2), in their unit: both sums in one
    pass, which the processor computes in parallel.
    """
    first, second = 0.0, 0.0
    for j in range(cells.shape[0]):
        first += weights[cells[j], 0]
        second += weights[cells[j], 1]
    output[0], output[1] = first, second


@kernel
def train(weights: Array, cells: Cells, error: Array, rate: float) -> None:
    """Add beta U / C to every active weight (Lin & Song 1997, eq. 19, 20): the paper's rule with activations of 1.

    :func:`cmacexp.cmac.rules.train_by_rule` gives the same bits in 150 ns instead of 50 ns with 32 layers. Changes
    the rows ``cells`` (C,) of ``weights`` (rows, 2) by ``error`` (2,), U, the output of the feedback, N m.
    """
    layers = cells.shape[0]
    first, second = rate * error[0] / layers, rate * error[1] / layers
    for j in range(layers):
        weights[cells[j], 0] += first
        weights[cells[j], 1] += second


@kernel
def read_weighted(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """:func:`read` of ``weights`` (rows, outputs), each active one times its ``activation`` (C,), for any number."""
    for o in range(output.shape[0]):
        total = 0.0
        for j in range(cells.shape[0]):
            total += activation[j] * weights[cells[j], o]
        output[o] = total


@program
def read_batch(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """:func:`read_weighted` for a batch: ``cells`` and ``activation`` (samples, C), ``output`` (samples, outputs)."""
    for k in range(cells.shape[0]):
        read_weighted(weights, cells[k], activation[k], output[k])


def find_entered(cells: Cells | Positions) -> Mask:
    """Whether an active cell is new, (samples, C): none in its layer at the sample before.

    Every distinct cell is entered, and in the order of the array it is entered where it first occurs. So far fewer
    cells have to be sorted to find the distinct ones than are active.
    """
    entered = np.ones(cells.shape, dtype=bool)
    np.not_equal(cells[1:], cells[:-1], out=entered[1:])
    return entered


def find_distinct(cells: Cells) -> Cells:
    """The distinct ones of ``cells`` (samples, C), in ascending order."""
    found: Cells = np.unique(cells[find_entered(cells)], return_counts=True)[0]  # uncounted ones are not sorted first
    return found


@dataclass
class Visited:
    """The cells visited so far, by their ``positions`` (cells,) in dense memory; the n-th of them has row n.

    The rows of memory, of ``row_bytes`` each, limit their number.
    """

    rows: int
    row_bytes: int
    positions: Positions = field(default_factory=lambda: np.zeros(0, dtype=np.uint64))

    def assign_rows(self, positions: Positions) -> Cells:
        """Rows (samples, C) of cells (samples, C), new ones in their order; raises BadInput if there are too few."""
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
