"""Random Fourier features of the planned joint motion, trained by the feedback.

``feedforward._target_=pipelines.benchmark.methods.fourier.RandomFourier +feedforward.features=200``
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.cmac.addressing import spanning
from cmacexp.cmac.network import MemoryUse
from cmacexp.config import FeedforwardConfig, number
from cmacexp.feedforward.network import BuiltInFeedforward, network, planned_inputs
from cmacexp.planning.plan import Setup
from cmacexp.typing import Weights

INPUTS = ("angle", "velocity")
"""Planned joint values that are the inputs of the network."""


class RandomFourier(BuiltInFeedforward):
    """Cosines of random waves over the planned joint motion, one network per leg (Rahimi & Recht 2007).

    The weights learn by normalised LMS, which is the paper's rule: beta a_j U / sum a_i^2. Half waves take the place
    of whole ones, which are their difference: with activations below 0, rules with a goal would drive weights away
    from it, and the guard that refines would take its kernel for smaller than it is. In worlds of one leg half waves
    left less error than whole ones, and than 1 + cos.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Number and length of the waves of one leg."""

        features: int = number("", at_least=1, at_most=2048, default=200, tuned=[50, 100, 200, 400])
        """Waves; each has two weights per joint."""
        width: float = number("", above=0, at_most=1e3, default=0.1, tuned=(0.03, 0.5))
        """Standard deviation of the Gaussian kernel that whole waves approximate, over the span of an input."""

    def reset(self, setup: Setup) -> None:
        """Draw the waves with the seed of the run; or take those of an earlier run, with its weights."""
        legs = len(setup.mechanism.legs)
        inputs = np.stack([planned_inputs(setup, i, INPUTS) for i in range(legs)])
        if setup.learnt is None:
            chance, number = np.random.default_rng(setup.config.seed), self.config.features
            self.basis: Weights = {
                "ranges": np.stack([np.stack(spanning(own, 1.0)) for own in inputs]),
                "waves": chance.normal(size=(legs, inputs.shape[2], number)) / self.config.width,
                "phases": chance.uniform(0.0, 2.0 * np.pi, (legs, number)),
            }
        else:
            self.basis = {name: own for name, own in setup.learnt.items() if name != "weights"}
        low, high = np.split(self.basis["ranges"], 2, axis=1)
        points = (inputs - low) / (high - low)
        wave = np.cos(points @ self.basis["waves"] + self.basis["phases"][:, None]).swapaxes(0, 1)  # W^T x + b
        rows = 2 * wave.shape[2]
        # One of the two half waves max(0, wave) and max(0, -wave) is zero; in order of rows sums keep their bits.
        cells = np.arange(wave.shape[2]) + wave.shape[2] * (wave < 0.0)
        activation = np.take_along_axis(np.abs(wave), np.argsort(cells, axis=2), axis=2)
        self.params = network(setup, np.sort(cells, axis=2), rows, activation)
        self.memory = [MemoryUse(rows, rows, rows, 0, 0)] * legs

    def learnt(self) -> Weights:
        """``weights`` (L, 2 features, J), N m; ``ranges`` (L, 2, n), ``waves`` (L, n, features), ``phases``."""
        return {"weights": self.params.weights.copy(), **self.basis}
