"""Iterative learning control: one torque per sample of the cycle, updated from cycle to cycle."""

import math
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.cmac.network import MemoryUse
from cmacexp.config import FeedforwardConfig, number
from cmacexp.feedforward.network import BuiltInFeedforward, exponential, network, resample
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights

REACH = 4.0
"""Half-width of the taps in standard deviations of the Gaussian."""
WIDEST = 2.0
"""Standard deviation in cycles above which a periodic Gaussian is replaced by the mean over the cycle.

The gain of the first harmonic is 1e-34 there.
"""


def gaussian_taps(cutoff: float, sampling_period: float, samples: int) -> Array:
    """Compute the taps (K,) of a symmetric Gaussian low-pass filter, from the centre outwards.

    Its gain is 1/sqrt(2) at ``cutoff``, Hz; above a fifth of the sampling rate, where the Gaussian is narrower than a
    sample, the gain there is larger.
    No tap is negative, and the taps of both sides sum to 1, so no frequency is amplified. The filter is applied
    periodically to a cycle of ``samples``; if it is much wider than the cycle, it is the mean over the cycle.
    ``sampling_period`` is in s.
    """
    deviation = math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff * sampling_period)
    if deviation > WIDEST * samples:
        mean = np.full(samples // 2 + 1, 1.0 / samples)
        if samples % 2 == 0:
            mean[-1] /= 2.0  # both sides reach the opposite sample
        return mean
    taps: Array = exponential(-0.5 * (np.arange(1 + int(REACH * deviation)) / deviation) ** 2)
    return taps / (2.0 * math.fsum(taps) - taps[0])


class IterativeLearning(BuiltInFeedforward):
    """u_{j+1}(k) = Q [u_j(k) + beta U_j(k + lead)], cycle j, sample k (Bristow, Tharayil & Alleyne 2006).

    One weight per sample and joint. Q is a zero-phase low-pass filter, periodic over the cycle: each cycle continues
    where the last one ended, as in repetitive control. The weights belong to samples of the cycle and do not transfer
    to another path.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Low-pass filter Q."""

        cutoff: float | None = number("Hz", above=0, at_most=1e6, tuned=(3.0, 40.0))
        """Cutoff frequency of Q, where its gain is 1/sqrt(2); null: Q = 1."""

    config: Config

    def reset(self, setup: Setup) -> None:
        """Start with zero torque, or with the torque of an earlier run, resampled at equal phases of the cycle."""
        samples, legs = setup.plan.support.shape
        if setup.learnt is not None:
            setup = replace(setup, learnt={"weights": resample(setup.learnt["weights"], samples, axis=1)})
        cells = np.broadcast_to(np.arange(samples, dtype=np.uint32)[:, None, None], (samples, legs, 1))
        cutoff = self.config.cutoff
        taps = None if cutoff is None else gaussian_taps(cutoff, setup.config.sampling_period, samples)
        self.params = network(setup, cells, samples, taps=taps)
        self.memory = [MemoryUse(samples, samples, samples, 0, 0)] * legs

    def learnt(self) -> Weights:
        """Return ``weights`` (L, N, J), the torque of every sample, N m."""
        return {"weights": self.params.weights.copy()}
