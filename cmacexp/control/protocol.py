"""The interface of a controller."""

from typing import NamedTuple, Protocol

from cmacexp.feedforward.protocol import Feedforward
from cmacexp.planning.setup import Reference, Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class Action(NamedTuple):
    """Joint torques of feedback and feedforward, apart, so that the trace shows the share of each."""

    feedback: Array
    """(L, J), N m."""
    feedforward: Array
    """(L, J), N m."""
    reference: Array | None = None
    """(L, J): position that the controller used, m; None: those of the plan."""


class Controller(Protocol):
    """Computes joint torques from reference and measurement."""

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start a run."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Torques of one step, held over the sampling period."""
        ...
