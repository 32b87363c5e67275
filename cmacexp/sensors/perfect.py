"""Perfect sensors, and what sensors say that they alter."""

from collections.abc import Collection, Iterable

from cmacexp.config import ComponentConfig
from cmacexp.errors import BadInput
from cmacexp.planning.plan import Setup
from cmacexp.protocols import SIGNALS, TRAVEL, Altering, Measurement, Sensors, offers
from cmacexp.typing import KernelParts


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
    """Find the ``SIGNALS`` that ``sensors`` may change, and TRAVEL; raises BadInput of another name."""
    altered = sensors.alters if offers(sensors, Altering) else SIGNALS
    names = frozenset([altered] if isinstance(altered, str) or not isinstance(altered, Iterable) else altered)
    if unknown := sorted(map(str, names - {*SIGNALS, TRAVEL})):
        raise BadInput("sensors.alters", unknown[0], f"choose from {', '.join((*SIGNALS, TRAVEL))}, in a list")
    return names
