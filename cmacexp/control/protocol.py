"""What controller and feedforward are to the loop."""

from typing import NamedTuple, Protocol, runtime_checkable

from cmacexp.arrays import Array, Mask
from cmacexp.planning.setup import Setup, Weights
from cmacexp.plants.protocol import Measurement


class Reference(NamedTuple):
    """What the plan says of one step; L is the number of legs."""

    step: int
    """Counts from 0 over the whole run."""
    sample: int
    """Counts from 0 within the cycle."""
    acting: bool
    """Whether the feedforward learns and acts in this step."""
    support: Mask
    """(L,): planned phase, true in support."""
    values: Array
    """(L, 7): x, y (m), vx, vy (m/s), reference force, force to add, desired force (N): of ``Plan.reference``."""
    desired: Array
    """(L, 6): desired foot position, velocity and acceleration."""
    joints: Array
    """(L, 6): desired joint angles, velocities and accelerations."""
    force_desired: Array
    """(L,): N."""


class Action(NamedTuple):
    """Joint torques with their parts kept apart, so that the trace shows who did the work."""

    feedback: Array
    """(L, 2), N m."""
    feedforward: Array
    """(L, 2), N m."""
    reference: Array | None = None
    """(L, 2): x and y that the controller went by, m, if they are not those of the plan."""


class Feedforward(Protocol):
    """Torque known from the plan, and improved by what the feedback had to add."""

    acts: bool
    """False if it never gives a torque, so that references need not make room for it."""

    def reset(self, setup: Setup) -> None:
        """Forget everything; look at the plan."""
        ...

    def predict(self, reference: Reference, taught: Array) -> Array:
        """Learn from ``taught`` (L, 2), the last step's feedback in N m, then give this step's torque (L, 2)."""
        ...


@runtime_checkable
class Learns(Protocol):
    """A feedforward whose weights can be kept, and started from: ``reset`` finds them in ``Setup.learnt``."""

    def learnt(self) -> Weights:
        """What it has learnt, and all that tells which inputs the weights belong to; a copy."""
        ...


class Controller(Protocol):
    """From what should be and what is to joint torques."""

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start a run."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Torques of one step, held over the sampling period."""
        ...
