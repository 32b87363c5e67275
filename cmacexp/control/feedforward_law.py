"""What acts before an error is felt: nothing, exact inverse dynamics, or a CMAC that learns; as compiled kernels."""

from typing import NamedTuple

from cmacexp.arrays import Array, Cells
from cmacexp.cmac.memory import read, train
from cmacexp.compile import kernel

NONE, TABLE, CMAC = range(3)


class FeedforwardLaw(NamedTuple):
    """A built-in feedforward over a cycle of N samples; what it does not use is empty."""

    kind: int
    """NONE, TABLE (torque known in advance) or CMAC."""
    torque: Array
    """(N, L, 2): torque of the table, N m."""
    cells: Cells
    """(N, L, C): active rows of the CMACs at the planned inputs."""
    weights: Array
    """(L, rows, 2): weights of the CMACs, one per leg."""
    rate: float
    """beta."""
    lead: int
    """U(k-1) trains the cells of step k-1-lead."""


@kernel
def feedforward_step(law: FeedforwardLaw, sample: int, taught: Array, output: Array) -> None:
    """Learn from the last step's feedback, then predict this step's torque (Lin & Song 1997, eq. 18, 20, 21).

    Args:
        law: the feedforward; the weights of a CMAC change in place.
        sample: this step's sample of the cycle, 0 to N - 1.
        taught: (L, 2): what the feedback gave in the last step, N m.
        output: (L, 2): is filled, N m.
    """
    for i in range(output.shape[0]):
        if law.kind == TABLE:
            output[i, 0], output[i, 1] = law.torque[sample, i, 0], law.torque[sample, i, 1]
        elif law.kind == CMAC:
            last = (sample - 1 - law.lead) % law.cells.shape[0]
            train(law.weights[i], law.cells[last, i], taught[i], law.rate)
            read(law.weights[i], law.cells[sample, i], output[i])
        else:
            output[i, 0], output[i, 1] = 0.0, 0.0
