"""What methods have in common that play a torque for each sample, and learn once a cycle."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from cmacexp.feedforward.network import resample
from cmacexp.planning.setup import Reference, Setup
from cmacexp.typing import Array, Weights


class Acting:
    """A feedforward that acts, with a config."""

    acts = True

    def __init__(self, config: Any):
        self.config = config


class Playing(Acting):
    """A feedforward that plays a ``torque`` (N, L, J), N m, for each sample of the cycle."""

    def start(self, setup: Setup) -> None:
        """Start with no torque, or with that of an earlier run at the same phase."""
        self.torque: Array = np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1]))
        if setup.learnt is not None and "torque" in setup.learnt:
            self.torque[:] = resample(setup.learnt["torque"], len(self.torque))

    def learnt(self) -> Weights:
        """``torque`` (N, L, J), N m."""
        return {"torque": self.torque.copy()}


class OnceACycle(Playing, ABC):
    """``learn`` improves the torque after a cycle, from its ``feedback`` (N, L, J), N m."""

    lead = 0
    """Samples from a torque to the feedback that is stored for it."""

    def start(self, setup: Setup) -> None:
        """Start with what is known."""
        super().start(setup)
        self.feedback, self.steps = np.zeros_like(self.torque), 0

    @abstractmethod
    def learn(self) -> None:
        """Improve the torque."""

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Store the last step's feedback (L, J), N m; return this step's torque (L, J), N m."""
        self.feedback[(reference.sample - 1 - self.lead) % len(self.torque)] = learning_error
        if reference.sample == 0 and self.steps >= len(self.torque):
            self.learn()
        self.steps += 1
        return self.torque[reference.sample]
