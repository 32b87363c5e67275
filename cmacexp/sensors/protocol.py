"""What sensors are to the loop, and those that alter nothing."""

from collections.abc import Collection
from typing import Protocol

from cmacexp.config import ComponentConfig
from cmacexp.planning.setup import Setup
from cmacexp.plants.protocol import Measurement

SIGNALS = ("force", "position", "velocity", "height", "tilt", "height_rate", "tilt_rate")
"""What can be altered: the first three of every leg, the rest of a body."""


class Sensors(Protocol):
    """From the true state to what the controller sees.

    A part may also have ``alters``, the names of the :data:`SIGNALS` that it can change, which get columns of their
    own in the trace; without it all do.
    """

    def reset(self, setup: Setup) -> None:
        """Start a run."""
        ...

    def measure(self, true: Measurement) -> Measurement:
        """What the controller sees of ``true``."""
        ...


class PerfectSensors:
    """The controller sees the true state."""

    Config = ComponentConfig
    alters: Collection[str] = ()

    def reset(self, setup: Setup) -> None:
        """Nothing to prepare."""

    def measure(self, true: Measurement) -> Measurement:
        """The true state, unchanged."""
        return true


def find_altered(sensors: Sensors) -> frozenset[str]:
    """The :data:`SIGNALS` that ``sensors`` may change."""
    return frozenset(getattr(sensors, "alters", SIGNALS))
