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

    The weights learn by normalised LMS, which is the paper's rule: beta a_j U / sum a_i^2. Each wave is split into
    two half waves, max(0, wave) and max(0, -wave), because activations must not be negative: rules with a goal would
    drive weights away from it, and the refining guard would underestimate its kernel. In worlds of one leg, errors
    were smaller with half waves than with whole waves or with 1 + cos.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Number and length of the waves of one leg."""

        features: int = number("", at_least=1, at_most=2048, default=200, tuned=[50, 100, 200, 400])
        """Number of waves; each has two weights per joint."""
        width: float = number("", above=0, at_most=1e3, default=0.1, tuned=(0.03, 0.5))
        """Standard deviation of the Gaussian kernel that whole waves approximate, relative to an input's span."""

    def reset(self, setup: Setup) -> None:
        """Draw the waves with the seed of the run, or take waves and weights of an earlier run."""
        legs = len(setup.mechanism.legs)
        inputs = np.stack([planned_inputs(setup, i, INPUTS) for i in range(legs)])
        if setup.learnt is None:
            generator = np.random.default_rng(setup.config.seed)
            size = (legs, inputs.shape[2], self.config.features)
            self.basis: Weights = {
                "ranges": np.stack([np.stack(spanning(path, 1.0)) for path in inputs]),
                "waves": generator.normal(size=size) / self.config.width,
                "phases": generator.uniform(0.0, 2.0 * np.pi, (legs, self.config.features)),
            }
        else:
            self.basis = {name: array for name, array in setup.learnt.items() if name != "weights"}
        low, high = np.split(self.basis["ranges"], 2, axis=1)
        points = (inputs - low) / (high - low)
        wave = np.cos(points @ self.basis["waves"] + self.basis["phases"][:, None]).swapaxes(0, 1)  # W^T x + b
        rows = 2 * wave.shape[2]
        # One of the two half waves is zero. Rows are sorted, since the order of a sum changes its bits.
        cells = np.arange(wave.shape[2]) + wave.shape[2] * (wave < 0.0)
        activation = np.take_along_axis(np.abs(wave), np.argsort(cells, axis=2), axis=2)
        self.params = network(setup, np.sort(cells, axis=2), rows, activation)
        self.memory = [MemoryUse(rows, rows, rows, 0, 0)] * legs

    def learnt(self) -> Weights:
        """Return the learnt arrays by name.

        ``weights`` (L, 2 features, J), N m; ``ranges`` (L, 2, n) of the inputs; ``waves`` (L, n, features);
        ``phases`` (L, features), rad.
        """
        return {"weights": self.params.weights.copy(), **self.basis}
