"""No feedforward: feedback alone."""

from cmacexp.config import ComponentConfig
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.planning.setup import Setup


class NoFeedforward(BuiltInFeedforward):
    """No torque at all: feedback alone."""

    Config = ComponentConfig
    acts = False

    def reset(self, setup: Setup) -> None:
        """Prepare no torque."""
        self.params = known_torque(setup, None)
