"""No feedforward: feedback alone."""

from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.planning.setup import Setup


class NoFeedforward(BuiltInFeedforward):
    """Feedback alone."""

    acts = False

    def reset(self, setup: Setup) -> None:
        """Nothing to work out."""
        self.params = known_torque(setup, None)
