"""What acts before an error is felt: nothing, a known torque, or a network that learns; as compiled kernels."""

from typing import NamedTuple

from cmacexp.arrays import Array, Cells
from cmacexp.cmac.memory import read, read_weighted, train, train_weighted
from cmacexp.compile import kernel

NONE, TABLE, CMAC, WEIGHTED = range(4)


class LearningLaw(NamedTuple):
    """How the weights of a network learn from the feedback."""

    rate: float
    """beta."""
    lead: int
    """U(k-1) trains the cells of step k-1-lead."""


class FeedforwardLaw(NamedTuple):
    """A built-in feedforward over a cycle of N samples; what it does not use is empty.

    A network is linear in its weights: at every sample C of them are active, which ones and how much the plan fixes.
    """

    kind: int
    """NONE, TABLE (torque known in advance), CMAC (active weights count fully) or WEIGHTED (by their activation)."""
    torque: Array
    """(N, L, 2): torque of the table, N m."""
    cells: Cells
    """(N, L, C): active rows of the networks at the planned inputs."""
    activation: Array
    """(N, L, C): how much each of them counts; of WEIGHTED alone."""
    weights: Array
    """(L, rows, 2): weights of the networks, one per leg."""
    learning: LearningLaw


@kernel
def learn(law: FeedforwardLaw, i: int, sample: int, taught: Array) -> None:
    """Train the network of leg ``i`` at ``sample`` with ``taught`` (2,), N m (Lin & Song 1997, eq. 20, 21)."""
    weights, cells, rate = law.weights[i], law.cells[sample, i], law.learning.rate
    if law.kind == CMAC:
        train(weights, cells, taught, rate)
    else:
        train_weighted(weights, cells, law.activation[sample, i], taught, rate)


@kernel
def feedforward_step(law: FeedforwardLaw, step: int, sample: int, taught: Array, output: Array) -> None:
    """Learn from the last step's feedback, then predict this step's torque (Lin & Song 1997, eq. 18, 20, 21).

    Args:
        law: the feedforward; the weights of a network change in place.
        step: counts from 0 over the whole run.
        sample: this step's sample of the cycle, 0 to N - 1.
        taught: (L, 2): what the feedback gave in the last step, N m.
        output: (L, 2): is filled, N m.
    """
    for i in range(output.shape[0]):
        if law.kind == TABLE:
            output[i, 0], output[i, 1] = law.torque[sample, i, 0], law.torque[sample, i, 1]
        elif law.kind == NONE:
            output[i, 0], output[i, 1] = 0.0, 0.0
        else:
            learn(law, i, (sample - 1 - law.learning.lead) % law.cells.shape[0], taught[i])
            if law.kind == CMAC:
                read(law.weights[i], law.cells[sample, i], output[i])
            else:
                read_weighted(law.weights[i], law.cells[sample, i], law.activation[sample, i], output[i])
