"""The interface of a controller."""

from typing import NamedTuple, Protocol

from cmacexp.feedforward.protocol import Feedforward
from cmacexp.planning.plan import Reference, Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class Drive(NamedTuple):
    """What drives with loops of their own are to do until the next command: torque + K (q - q_true) + D (...)."""

    q: Array
    """(L, J): angles, rad."""
    dq: Array
    """(L, J): velocities, rad/s."""
    stiffness: Array
    """(L, J): K, N m/rad."""
    damping: Array
    """(L, J): D, N m s/rad."""


class Action(NamedTuple):
    """Joint torques of feedback and feedforward, apart, so that the trace shows the share of each."""

    feedback: Array
    """(L, J), N m."""
    feedforward: Array
    """(L, J), N m."""
    reference: Array | None = None
    """(L, J): position that the controller used, m; None: those of the plan."""
    drive: Drive | None = None
    """What drives get from a controller with ``sends_drives``, beside its torques; None: torques alone."""
    learning_error: Array | None = None
    """(L, J): what teaches, for the guard of learning, N m; None: the feedback."""


class Controller(Protocol):
    """Computes joint torques from reference and measurement."""

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start a run."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Torques of one step, held over the sampling period."""
        ...
