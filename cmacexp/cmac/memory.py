"""Reading and training the rows of a CMAC."""

from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import Array, Cells


@kernel
def read(weights: Array, cells: Cells, output: Array) -> None:
    """Sum of the active weights: D_d = sum W_i (Lin & Song 1997, eq. 18).

    Args:
        weights: (rows, 2).
        cells: (C,): active rows.
        output: (2,): filled; both sums in one pass, which the processor computes in parallel.
    """
    first, second = 0.0, 0.0
    for j in range(cells.shape[0]):
        first += weights[cells[j], 0]
        second += weights[cells[j], 1]
    output[0], output[1] = first, second


@kernel
def train(weights: Array, cells: Cells, error: Array, rate: float) -> None:
    """Add beta U / C to every active weight (Lin & Song 1997, eq. 19, 20): the paper's rule with activations of 1.

    :func:`cmacexp.cmac.rules.train_by_rule` gives the same bits in 150 ns instead of 50 ns with 32 layers.

    Args:
        weights: (rows, 2): changed in place.
        cells: (C,): active rows.
        error: (2,): U, the output of the feedback controller.
        rate: beta.
    """
    layers = cells.shape[0]
    first, second = rate * error[0] / layers, rate * error[1] / layers
    for j in range(layers):
        weights[cells[j], 0] += first
        weights[cells[j], 1] += second


@kernel
def read_weighted(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """:func:`read` with every active weight times its ``activation`` (C,)."""
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
