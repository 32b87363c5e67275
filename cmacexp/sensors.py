"""What lies between the plant and the controller's knowledge of it."""

from typing import Protocol

from cmacexp.planning.setup import Setup
from cmacexp.plants.protocol import Measurement


class Sensors(Protocol):
    """From the true state to what the controller sees."""

    def reset(self, setup: Setup) -> None:
        """Start a run."""
        ...

    def measure(self, true: Measurement) -> Measurement:
        """What the controller sees of ``true``."""
        ...


class PerfectSensors:
    """The controller sees the true state."""

    def reset(self, setup: Setup) -> None:
        """Nothing to prepare."""

    def measure(self, true: Measurement) -> Measurement:
        """The true state, unchanged."""
        return true
