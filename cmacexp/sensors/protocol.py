"""The protocol of sensors, and perfect sensors."""

from collections.abc import Collection, Iterable
from typing import Protocol

from cmacexp.config import ComponentConfig
from cmacexp.errors import BadInput
from cmacexp.planning.plan import Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import KernelParts

SIGNALS = ("force", "position", "velocity", "height", "tilt", "height_rate", "tilt_rate")
"""What can be altered: the first three of every leg, the rest of a body."""
TRAVEL = "travel"
"""Place and heading of a body that the plant moves: what an estimator, or external sensors, can alter besides."""


class Sensors(Protocol):
    """Measure the true state; the measurement is the input of the controller.

    Sensors may also have ``alters``, the names of the ``SIGNALS`` that they can change, and ``TRAVEL`` if they do;
    these get ``*_measured`` columns in the trace. Without it all signals do. A measurement without ``travel`` leaves
    place and heading as they are. ``learning.lead=auto`` counts ``feedback_delay(uses_velocity)``,
    samples, and ``feedback_lag(uses_velocity)``, s, of sensors that have them.
    """

    def reset(self, setup: Setup) -> None:
        """Start a run."""
        ...

    def measure(self, true: Measurement) -> Measurement:
        """The measurement of the state ``true``."""
        ...


class PerfectSensors:
    """Sensors that measure the true state."""

    Config = ComponentConfig
    alters: Collection[str] = ()

    def __init__(self, config: ComponentConfig):
        self.config = config

    def reset(self, setup: Setup) -> None:
        """Nothing to prepare."""

    def kernel_parts(self) -> KernelParts:
        """Nothing: the controller sees the arrays of the plant."""
        return {}

    def measure(self, true: Measurement) -> Measurement:
        """The true state, unchanged."""
        return true


def find_altered(sensors: Sensors) -> frozenset[str]:
    """The ``SIGNALS`` that ``sensors`` may change, and TRAVEL; raises BadInput of another name."""
    altered = getattr(sensors, "alters", SIGNALS)
    names = frozenset([altered] if isinstance(altered, str) or not isinstance(altered, Iterable) else altered)
    if unknown := sorted(map(str, names - {*SIGNALS, TRAVEL})):
        raise BadInput("sensors.alters", unknown[0], f"choose from {', '.join((*SIGNALS, TRAVEL))}, in a list")
    return names
