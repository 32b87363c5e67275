"""A multilayer perceptron, of scikit-learn, that learns once a cycle.

``feedforward._target_=pipelines.perceptron.Perceptron``
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.errors import BadInput, CmacexpError, require_extra
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning.setup import Setup
from cmacexp.typing import Weights
from pipelines.benchmark.methods.once_a_cycle import OnceACycle

INPUTS = ("angle", "velocity")
"""Planned joint values that are the inputs of the network."""
WEIGHTS = ("hidden_weights", "output_weights", "hidden_bias", "output_bias")
"""Arrays of a network in the order of scikit-learn; saved with legs as first axis."""


class Perceptron(OnceACycle):
    """One perceptron with one hidden layer of tanh per leg, trained by the feedback (Kawato, Furukawa & Suzuki 1987).

    Feedback-error learning in batches: at the end of a cycle, the network is trained with its own output plus beta
    times the feedback, at every sample of the cycle. Inputs are standardised over the planned path, torques divided
    by the root mean square of the feedback in the first cycle of learning. The seed of the run determines initial
    weights and the order of samples.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Size and training of the network of one leg."""

        hidden: int = number("", at_least=1, at_most=4096, default=32, tuned=[16, 32, 64])
        """Neurons of the hidden layer."""
        passes: int = number("", at_least=1, at_most=1000, default=15, tuned=[5, 15])
        """Passes over the samples of a cycle, at its end."""
        batch: int = number("samples", at_least=1, at_most=2**24, default=100)
        """Samples of one gradient step."""
        step_size: float = number("", above=0, at_most=10, default=0.004, tuned=(0.001, 0.02))
        """Step size of Adam (Kingma & Ba 2015)."""

    def reset(self, setup: Setup) -> None:
        """Make the networks, whose output is zero until they learn.

        Raises:
            BadInput: scikit-learn is missing, or the learning rule is for networks linear in their weights.
        """
        try:
            require_extra("sklearn")
        except CmacexpError as error:
            raise BadInput("feedforward._target_", "pipelines.perceptron.Perceptron", str(error)) from error
        from sklearn.neural_network import MLPRegressor

        if (rule := setup.config.learning.rule) != "paper":
            allowed = "needs a network that is linear in its weights; a perceptron is not, use paper"
            raise BadInput("learning.rule", rule, allowed)
        self.start(setup)
        samples, legs = setup.plan.support.shape
        self.rate, self.lead = setup.rate, setup.lead
        paths = np.stack([planned_inputs(setup, i, INPUTS) for i in range(legs)])
        spread = paths.std(axis=1, keepdims=True)
        self.middle, self.spread = paths.mean(axis=1, keepdims=True), np.where(spread > 0.0, spread, 1.0)
        if setup.learnt is not None:
            self.middle, self.spread = setup.learnt["middle"], setup.learnt["spread"]
        self.paths = (paths - self.middle) / self.spread
        self.scale = np.zeros(legs)
        own = self.config
        options = {
            "hidden_layer_sizes": (own.hidden,),
            "activation": "tanh",
            "solver": "adam",
            "alpha": 0.0,
            "batch_size": min(own.batch, samples),
            "learning_rate_init": own.step_size,
        }
        self.networks = [MLPRegressor(**options, random_state=(setup.config.seed + i) % 2**32) for i in range(legs)]
        for i, one in enumerate(self.networks):
            one.partial_fit(self.paths[i], self.torque[:, i])  # makes its arrays
        if setup.learnt is not None:
            self._restore(setup.learnt)

    def _restore(self, learnt: Weights) -> None:
        self.scale[:] = learnt["scale"]
        for i, one in enumerate(self.networks):
            # In place: the optimiser keeps references to these arrays.
            for own, name in zip([*one.coefs_, *one.intercepts_], WEIGHTS, strict=True):
                own[:] = learnt[name][i]
            self.torque[:, i] = self.scale[i] * one.predict(self.paths[i])

    def learnt(self) -> Weights:
        """``middle`` and ``spread`` (L, 1, n) of the inputs, ``scale`` (L,) of the torques, N m, and the WEIGHTS."""
        arrays = zip(*([*one.coefs_, *one.intercepts_] for one in self.networks), strict=True)
        weights = {name: np.stack(own) for name, own in zip(WEIGHTS, arrays, strict=True)}
        return {"middle": self.middle, "spread": self.spread, "scale": self.scale.copy(), **weights}

    def learn(self) -> None:
        """Train the network of each leg with the feedback of the cycle."""
        for leg, network in enumerate(self.networks):
            learning_error = self.feedback[:, leg]
            if self.scale[leg] == 0.0:
                self.scale[leg] = np.sqrt(np.mean(learning_error**2)) or 1.0
            wanted = (self.torque[:, leg] + self.rate * learning_error) / self.scale[leg]
            for _ in range(self.config.passes):
                network.partial_fit(self.paths[leg], wanted)
            self.torque[:, leg] = self.scale[leg] * network.predict(self.paths[leg])
