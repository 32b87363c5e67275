"""A multilayer perceptron that learns once per cycle.

``feedforward._target_=pipelines.perceptron.Perceptron``
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.errors import require
from cmacexp.feedforward.network import planned_inputs
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights
from pipelines.benchmark.methods.playing import Playing

INPUTS = ("angle", "velocity")
"""Planned joint values that are the inputs of the network."""
MEMORY, LONG_MEMORY = 0.9, 0.999
"""Decay rates of the optimiser's mean gradient and mean squared gradient (beta_1 and beta_2 of Adam)."""


class Perceptron(Playing):
    """One perceptron with one hidden layer of tanh per leg, trained by the feedback (Kawato, Furukawa & Suzuki 1987).

    Feedback-error learning in batches: at the end of a cycle, the network is trained at every sample of the cycle;
    targets are its own output plus beta times the feedback. Inputs are standardised over the planned path, torques
    divided by the root mean square of the feedback in the first cycle of learning. The seed of the run determines
    initial weights and the order of samples. Results equal ``partial_fit`` of scikit-learn within rounding, in a
    seventh of the time. A compiled kernel would be slower: a gradient step with 100 samples takes 24 us, 3 us of them
    for tanh, for which the C library takes 27 us.
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
        """Create the networks, whose output is zero until they learn, or take learnt ones from ``setup``.

        Raises:
            BadInput: the learning rule needs a network that is linear in its weights.
        """
        require(
            setup.config.learning.rule == "paper",
            "learning.rule",
            setup.config.learning.rule,
            "needs a network that is linear in its weights; a perceptron is not, use paper",
        )
        self.start(setup)
        samples, legs, joints = self.torque.shape
        self.rate = setup.rate
        self.lead = setup.lead
        paths = np.stack([planned_inputs(setup, i, INPUTS) for i in range(legs)])
        spread = paths.std(axis=1, keepdims=True)
        self.middle, self.spread = paths.mean(axis=1, keepdims=True), np.where(spread > 0.0, spread, 1.0)
        if setup.learnt is not None:
            self.middle, self.spread = setup.learnt["middle"], setup.learnt["spread"]
        self.scale = np.zeros((legs, 1, 1))
        scaled = (paths - self.middle) / self.spread
        self.paths = np.concatenate([scaled, np.ones((legs, samples, 1))], axis=2)
        generators, restarted = (
            [np.random.RandomState((setup.config.seed + i) % 2**32) for i in range(legs)] for _ in range(2)
        )
        inputs = self.paths.shape[2]
        hidden = self.config.hidden
        first = inputs * hidden
        self.parameters, self.slope, self.mean, self.square = flat = np.zeros(
            (4, legs, first + (hidden + 1) * joints)
        )
        layers = [flat[:2, :, :first].reshape(2, legs, inputs, -1), flat[:2, :, first:].reshape(2, legs, -1, joints)]
        self.weights, self.slopes = zip(*layers, strict=True)
        for weights in self.weights:
            bound = np.sqrt(6.0 / (weights.shape[1] - 1 + weights.shape[2]))  # Glorot & Bengio 2010
            weights[:] = [generator.uniform(-bound, bound, weights.shape[1:]) for generator in generators]
        self.values = np.ones((legs, samples, hidden + 1))
        self.steps = 0
        # Only this first pass, whose targets are zero, has its own order of samples; all later passes share one.
        order = np.stack([generator.permutation(samples) for generator in generators])
        self.order = np.stack([generator.permutation(samples) for generator in restarted])
        self._train(order, np.zeros((legs, samples, joints)), passes=1)
        if setup.learnt is not None:
            self.scale[:] = setup.learnt["scale"]
            self.parameters[:] = setup.learnt["parameters"]
            self.torque[:] = (self.scale * self._compute(self.paths)[1]).swapaxes(0, 1)

    def _compute(self, paths: Array) -> tuple[Array, Array]:
        """Compute hidden values and outputs (L, n, J) for inputs with a 1 appended (L, n, inputs).

        Hidden values have a 1 appended, (L, n, hidden + 1); the next call overwrites them.
        """
        hidden, output = self.weights
        values = self.values[:, : paths.shape[1]]
        np.tanh(paths @ hidden, out=values[..., :-1])
        return values, values @ output

    def _train(self, order: Any, wanted: Array, passes: int) -> None:
        """Train with the target outputs ``wanted`` (L, N, J), in batches of samples in the ``order`` (L, N)."""
        paths, wanted = (np.take_along_axis(values, order[..., None], axis=1) for values in (self.paths, wanted))
        batches = [slice(first, first + self.config.batch) for first in range(0, order.shape[1], self.config.batch)]
        for batch in passes * batches:
            self._step(paths[:, batch], wanted[:, batch])

    def _step(self, paths: Array, wanted: Array) -> None:
        """Take a step of Adam for half the mean squared error.

        ``paths`` are inputs with a 1 appended (L, n, inputs), ``wanted`` the target outputs (L, n, J).
        """
        values, output = self._compute(paths)
        wrong = (output - wanted) / paths.shape[1]
        back = (wrong @ self.weights[1][:, :-1].swapaxes(1, 2)) * (1.0 - values[..., :-1] ** 2)
        np.matmul(paths.swapaxes(1, 2), back, out=self.slopes[0])
        np.matmul(values.swapaxes(1, 2), wrong, out=self.slopes[1])
        self.steps += 1
        rate = self.config.step_size * math.sqrt(1.0 - LONG_MEMORY**self.steps) / (1.0 - MEMORY**self.steps)
        self.mean += (1.0 - MEMORY) * (self.slope - self.mean)
        self.square += (1.0 - LONG_MEMORY) * (self.slope**2 - self.square)
        self.parameters -= rate * self.mean / (np.sqrt(self.square) + 1e-8)

    def learnt(self) -> Weights:
        """Return the learnt arrays by name.

        ``middle`` and ``spread`` (L, 1, n) standardise the inputs; ``scale`` (L, 1, 1), N m, multiplies the outputs.
        ``parameters`` (L, size) are the weights of the hidden layer, then of the output layer, each row by row, with
        the biases last.
        """
        return {
            "middle": self.middle, "spread": self.spread, "scale": self.scale.copy(),
            "parameters": self.parameters.copy(),
        }  # fmt: skip

    def learn(self, feedback: Array) -> None:
        """Train the network of each leg with the ``feedback`` (N, L, J), N m, of the cycle."""
        if not self.scale.any():
            self.scale[:, 0, 0] = np.sqrt((feedback**2).mean(axis=(0, 2)))
            self.scale[self.scale == 0.0] = 1.0
        wanted = (self.torque + self.rate * feedback).swapaxes(0, 1) / self.scale
        self._train(self.order, wanted, self.config.passes)
        self.torque[:] = (self.scale * self._compute(self.paths)[1]).swapaxes(0, 1)
