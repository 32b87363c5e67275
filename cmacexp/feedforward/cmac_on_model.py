"""One CMAC per leg that learns what a model of the machine lacks."""

from cmacexp.feedforward.cmac import CmacFeedforward
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.planning.plan import Setup


class CmacOnModel(CmacFeedforward):
    """Inverse dynamics with a model that may be wrong, plus a CMAC that learns what feedback is still needed.

    The torque of the model acts from the first step that the feedforward acts in.
    """

    Config = InverseDynamics.Config

    def __init__(self, config: InverseDynamics.Config):
        super().__init__(config)
        self.model = InverseDynamics(config)

    def reset(self, setup: Setup) -> None:
        """Compute the torque of the model; start with empty memories, or with those of an earlier run."""
        super().reset(setup)
        self.model_torque = self.model.compute_torque(setup)
        self.params = self.params._replace(torque=self.model_torque)
