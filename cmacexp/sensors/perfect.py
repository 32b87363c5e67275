"""Perfect sensors, and the lookup of the signals that sensors may alter."""

from collections.abc import Collection, Iterable

from cmacexp.config import ComponentConfig
from cmacexp.errors import BadInput
from cmacexp.planning.plan import Setup
from cmacexp.protocols import SIGNALS, TRAVEL, Altering, Measurement, Sensors, offers


class PerfectSensors:
    """Perfect sensors: the measurement is the true state."""

    Config = ComponentConfig
    alters: Collection[str] = ()

    def __init__(self, config: ComponentConfig):
        self.config = config

    def reset(self, setup: Setup) -> None:
        """Do nothing: perfect sensors have no state."""

    def measure(self, true: Measurement) -> Measurement:
        """Return the true state, unchanged."""
        return true


def find_altered(sensors: Sensors) -> frozenset[str]:
    """Return the names of the signals that ``sensors`` may alter: a subset of ``SIGNALS`` and TRAVEL.

    Sensors that do not list them may alter all ``SIGNALS``. Raises BadInput for an unknown name.
    """
    altered = sensors.alters if offers(sensors, Altering) else SIGNALS
    names = frozenset([altered] if isinstance(altered, str) or not isinstance(altered, Iterable) else altered)
    if unknown := sorted(map(str, names - {*SIGNALS, TRAVEL})):
        raise BadInput("sensors.alters", unknown[0], f"choose from {', '.join((*SIGNALS, TRAVEL))}, in a list")
    return names
