"""Kernels that read and train the weights of a CMAC, and the rows assigned to its visited cells."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput
from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import Array, Cells, Mask

Positions = NDArray[np.uint64]
"""Numbers of cells in dense addressing."""


@kernel
def read(weights: Array, cells: Cells, output: Array) -> None:
    """Sum the active weights of both outputs: D_d = sum W_i (Lin & Song 1997, eq. 18).

    Fills ``output`` (2,) from the rows ``cells`` (C,) of ``weights`` (rows, 2), in their unit. Both sums are computed
    in one pass, which the processor executes in parallel.
    """
    first = second = 0.0
    for j in range(cells.shape[0]):
        first += weights[cells[j], 0]
        second += weights[cells[j], 1]
    output[0] = first
    output[1] = second


@kernel
def train(weights: Array, cells: Cells, error: Array, rate: float) -> None:
    """Add beta U / C to every active weight (Lin & Song 1997, eq. 19, 20): the paper's rule with activations of 1.

    Changes the rows ``cells`` (C,) of ``weights`` (rows, 2); ``error`` (2,) is U, the feedback torque, N m, and
    ``rate`` is beta. :func:`cmacexp.cmac.rules.train_by_rule` gives the same bits, but takes 150 ns instead of 50 ns
    with 32 layers.
    """
    layers = cells.shape[0]
    first, second = rate * error[0] / layers, rate * error[1] / layers
    for j in range(layers):
        weights[cells[j], 0] += first
        weights[cells[j], 1] += second


@kernel
def round_weights(weights: Array, cells: Cells, step: float, limit: float) -> None:
    """Round the active weights to multiples of ``step`` within ``limit``, as a board of few bits stores them.

    Changes the rows ``cells`` (C,) of ``weights`` (rows, outputs); ``step`` and ``limit`` are in their unit.
    """
    for j in range(cells.shape[0]):
        for o in range(weights.shape[1]):
            weight = math.floor(weights[cells[j], o] / step + 0.5) * step
            weights[cells[j], o] = min(max(weight, -limit), limit - step)


@kernel
def read_weighted(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """Sum the active weights times their ``activation`` (C,), for any number of outputs.

    Fills ``output`` (outputs,) from the rows ``cells`` (C,) of ``weights`` (rows, outputs), in their unit.
    """
    for o in range(output.shape[0]):
        total = 0.0
        for j in range(cells.shape[0]):
            total += activation[j] * weights[cells[j], o]
        output[o] = total


@program
def read_batch(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """Fill ``output`` (samples, outputs) for a batch, see :func:`read_weighted`.

    ``cells`` and ``activation`` are (samples, C).
    """
    for k in range(cells.shape[0]):
        read_weighted(weights, cells[k], activation[k], output[k])


def find_entered(cells: Cells | Positions) -> Mask:
    """Return a mask (samples, C) of active cells that differ from the cell of their layer at the previous sample.

    The mask includes the first occurrence of every distinct cell, so that only these few cells must be sorted to find
    the distinct ones.
    """
    entered = np.ones(cells.shape, dtype=bool)
    np.not_equal(cells[1:], cells[:-1], out=entered[1:])
    return entered


def find_distinct(cells: Cells) -> Cells:
    """Return the distinct values of ``cells`` (samples, C), in ascending order."""
    # Without counts np.unique hashes the values before it sorts them, which is slower here.
    distinct: Cells = np.unique(cells[find_entered(cells)], return_counts=True)[0]
    return distinct


@dataclass
class Visited:
    """Table of the cells visited so far: the n-th of them has row n of the memory.

    ``positions`` (cells,) holds their numbers in dense addressing. The memory has at most ``rows`` rows of
    ``row_bytes`` bytes.
    """

    rows: int
    row_bytes: int
    positions: Positions = field(default_factory=lambda: np.zeros(0, dtype=np.uint64))

    def assign_rows(self, positions: Positions) -> Cells:
        """Return the rows (samples, C) of cells at ``positions`` (samples, C); new cells get the next free rows.

        Raises BadInput if the memory has too few rows.
        """
        new, first = np.unique(positions[find_entered(positions)], return_index=True)
        fresh = ~np.isin(new, self.positions)
        visited = np.concatenate([self.positions, new[fresh][np.argsort(first[fresh])]])
        if len(visited) > self.rows:
            needed = len(visited) * self.row_bytes
            raise BadInput(
                "cmac.memory_bytes",
                self.rows * self.row_bytes,
                f"must be at least {needed} B for the {len(visited)} cells visited so far; or cmac.addressing=hashed",
            )
        self.positions = visited
        order = np.argsort(visited)
        rows: Cells = order[np.searchsorted(visited, positions, sorter=order)].astype(np.uint32)
        return rows
