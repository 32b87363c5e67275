"""What controller and feedforward are to the loop."""

from typing import NamedTuple, Protocol

from cmacexp.feedforward.protocol import Feedforward
from cmacexp.planning.setup import Reference, Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class Action(NamedTuple):
    """Joint torques with their parts kept apart, so that the trace shows who did the work."""

    feedback: Array
    """(L, 2), N m."""
    feedforward: Array
    """(L, 2), N m."""
    reference: Array | None = None
    """(L, 2): x and y that the controller went by, m, if they are not those of the plan."""


class Controller(Protocol):
    """From what should be and what is to joint torques."""

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start a run."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Torques of one step, held over the sampling period."""
        ...
