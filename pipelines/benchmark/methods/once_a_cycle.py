"""What methods have in common that play a torque for each sample, and learn once a cycle."""

from typing import Any

import numpy as np

from cmacexp.feedforward.network import resample
from cmacexp.planning.plan import Reference, Setup
from cmacexp.typing import Array, Weights


class Playing:
    """A feedforward that plays a ``torque`` (N, L, J), N m, for each sample of the cycle, and learns once a cycle."""

    acts = True
    lead = 0
    """Samples from a torque to the feedback that is taken for its."""
    begun = False

    def __init__(self, config: Any):
        self.config = config

    def start(self, setup: Setup) -> None:
        """Start with no torque, or with that of an earlier run at the same phase."""
        self.torque: Array = np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1]))
        if setup.learnt is not None and "torque" in setup.learnt:
            self.torque[:] = resample(setup.learnt["torque"], len(self.torque))
        self.feedback, self.block = np.zeros_like(self.torque), len(self.torque)

    def learnt(self) -> Weights:
        """``torque`` (N, L, J), N m."""
        return {"torque": self.torque.copy()}

    def learn(self, feedback: Array) -> None:
        """Improve the torque, from what each of its samples caused, (N, L, J), N m."""

    def play(self, sample: int, feedback: Array) -> Array:
        """The torque (N, L, J), improved after the first cycle by its ``feedback`` (N, L, J), N m."""
        if self.begun:
            self.learn(np.roll(feedback, -self.lead, axis=0))
        self.begun = True
        return self.torque

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """:meth:`play` step by step, for controllers that call it with the last step's feedback (L, J), N m."""
        self.feedback[reference.sample - 1] = learning_error
        if reference.sample % self.block == 0:
            self.play(reference.sample, self.feedback)
        return self.torque[reference.sample]
