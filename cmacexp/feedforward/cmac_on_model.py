"""One CMAC per leg that learns what a model of the machine lacks."""

from dataclasses import dataclass

from cmacexp.config import number
from cmacexp.feedforward.cmac import CmacFeedforward
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.planning.setup import Setup


class CmacOnModel(CmacFeedforward):
    """Inverse dynamics with a model that may be wrong, plus a CMAC that learns what feedback is still needed.

    The torque of the model acts from the first step that the feedforward acts in.
    """

    @dataclass
    class Config(CmacFeedforward.Config):
        """Errors of the model, as of :class:`InverseDynamics`."""

        mass_factor: float = number("", above=0, at_most=1e3)
        """Masses of the model over the true ones."""
        length_factor: float = number("", above=0, at_most=1e3)
        """Lengths of the model's links over the true ones; joint angles are planned with the true ones."""

    def __init__(self, mass_factor: float = 1.0, length_factor: float = 1.0):
        self.model = InverseDynamics(mass_factor, length_factor)

    def reset(self, setup: Setup) -> None:
        """Compute the torque of the model; start with empty memories, or with those of an earlier run."""
        super().reset(setup)
        self.known = self.model.compute_torque(setup)
        self.params = self.params._replace(torque=self.known)
