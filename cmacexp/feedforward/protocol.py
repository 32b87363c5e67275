"""The interface of a feedforward."""

from typing import Protocol, runtime_checkable

from cmacexp.planning.plan import Reference, Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array, Weights


class Feedforward(Protocol):
    """Torque known from the plan, and improved by the feedback that is still needed."""

    acts: bool
    """False if its torque is always zero, so that references need not allow for it."""

    def reset(self, setup: Setup) -> None:
        """Start a run: forget everything, prepare for the plan."""
        ...

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, J), N m, then return this step's torque (L, J), N m."""
        ...


@runtime_checkable
class Observes(Protocol):
    """A feedforward that is shown every step of a run, before it predicts and also where it does not act."""

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> bool | None:
        """See what the sensors show, and the torque (L, J), N m, that the plant took in the last step.

        A cycle begins where ``reference.sample`` is 0. After False it is shown no more of this run.
        """
        ...


@runtime_checkable
class Plays(Protocol):
    """A feedforward that knows its torque some samples ahead: it is asked for that instead of :meth:`predict`."""

    block: int
    """Samples from one call to the next; the first block of a cycle begins with it."""

    def play(self, sample: int, feedback: Array) -> Array:
        """The torque (N, L, J), N m, of all samples of the cycle, of which those of this block are played.

        ``sample`` is the first one of the block; ``feedback`` (N, L, J), N m, that of the last N steps by sample, is
        read-only, and the loop goes on filling it.
        """
        ...


@runtime_checkable
class Learns(Protocol):
    """A feedforward whose weights can be saved, and started from: ``reset`` finds them in ``Setup.learnt``."""

    def learnt(self) -> Weights:
        """A copy of its weights, with all that defines which inputs they belong to."""
        ...
