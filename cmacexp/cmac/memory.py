"""Reading and training the rows of a CMAC."""

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Cells


@kernel
def read(weights: Array, cells: Cells, output: Array) -> None:
    """Sum of the active weights: D_d = sum W_i (Lin & Song 1997, eq. 18).

    Args:
        weights: (rows, outputs).
        cells: (C,): active rows.
        output: (outputs,): is filled.
    """
    for o in range(output.shape[0]):
        total = 0.0
        for j in range(cells.shape[0]):
            total += weights[cells[j], o]
        output[o] = total


@kernel
def train(weights: Array, cells: Cells, error: Array, rate: float) -> None:
    """Add beta U / C to every active weight (Lin & Song 1997, eq. 19, 20).

    Args:
        weights: (rows, outputs): changed in place.
        cells: (C,): active rows.
        error: (outputs,): U, the output of the feedback controller.
        rate: beta.
    """
    layers = cells.shape[0]
    for o in range(error.shape[0]):
        share = rate * error[o] / layers
        for j in range(layers):
            weights[cells[j], o] += share


@kernel
def read_weighted(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """:func:`read` where the active weights count by their ``activation`` (C,)."""
    for o in range(output.shape[0]):
        total = 0.0
        for j in range(cells.shape[0]):
            total += activation[j] * weights[cells[j], o]
        output[o] = total


@kernel
def train_weighted(weights: Array, cells: Cells, activation: Array, error: Array, rate: float) -> None:
    """:func:`train` where the active weights count by their ``activation`` (C,): add beta U a_j / sum a_i^2.

    It changes the output at these cells by beta U, as :func:`train` does, to which it comes down where all are one.
    """
    power = 0.0
    for j in range(cells.shape[0]):
        power += activation[j] * activation[j]
    if power > 0.0:
        for o in range(error.shape[0]):
            share = rate * error[o] / power
            for j in range(cells.shape[0]):
                weights[cells[j], o] += share * activation[j]


@kernel
def read_batch(weights: Array, cells: Cells, output: Array) -> None:
    """:func:`read` for a batch: ``cells`` (samples, C), ``output`` (samples, outputs)."""
    for k in range(cells.shape[0]):
        read(weights, cells[k], output[k])


@kernel
def train_batch(weights: Array, cells: Cells, error: Array, rate: float) -> None:
    """:func:`train` for a batch, one sample after the other: ``cells`` (samples, C), ``error`` (samples, outputs)."""
    for k in range(cells.shape[0]):
        train(weights, cells[k], error[k], rate)


@kernel
def read_weighted_batch(weights: Array, cells: Cells, activation: Array, output: Array) -> None:
    """:func:`read_batch` with an ``activation`` (samples, C)."""
    for k in range(cells.shape[0]):
        read_weighted(weights, cells[k], activation[k], output[k])


@kernel
def train_weighted_batch(weights: Array, cells: Cells, activation: Array, error: Array, rate: float) -> None:
    """:func:`train_batch` with an ``activation`` (samples, C)."""
    for k in range(cells.shape[0]):
        train_weighted(weights, cells[k], activation[k], error[k], rate)
