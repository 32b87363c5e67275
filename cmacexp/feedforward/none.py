"""No feedforward: feedback alone."""

import numpy as np

from cmacexp.config import ComponentConfig
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.planning.plan import Setup


class NoFeedforward(BuiltInFeedforward):
    """Zero torque."""

    Config = ComponentConfig
    acts = False

    def reset(self, setup: Setup) -> None:
        """Set the torque to zero."""
        self.params = known_torque(setup, np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1])))
