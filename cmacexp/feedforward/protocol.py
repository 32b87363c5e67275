"""What a feedforward is to controller and loop."""

from typing import Protocol, runtime_checkable

from cmacexp.planning.setup import Reference, Setup
from cmacexp.typing import Array, Weights


class Feedforward(Protocol):
    """Torque known from the plan, and improved by what the feedback had to add."""

    acts: bool
    """False if it never gives a torque, so that references need not make room for it."""

    def reset(self, setup: Setup) -> None:
        """Forget everything; look at the plan."""
        ...

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, 2), N m, then give this step's torque (L, 2), N m."""
        ...


@runtime_checkable
class Learns(Protocol):
    """A feedforward whose weights can be kept, and started from: ``reset`` finds them in ``Setup.learnt``."""

    def learnt(self) -> Weights:
        """What it has learnt, and all that tells which inputs the weights belong to; a copy."""
        ...
