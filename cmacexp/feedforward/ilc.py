"""Iterative learning control: a torque for every sample of the cycle, improved from cycle to cycle."""

import math
from dataclasses import dataclass, replace

import numpy as np

from cmacexp.cmac.network import MemoryUse
from cmacexp.config import FeedforwardConfig, number
from cmacexp.feedforward.network import BuiltInFeedforward, exponential, network, resample
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights

REACH = 4.0
"""Standard deviations of the Gaussian that its taps cover."""
WIDEST = 2.0
"""Cycles of standard deviation above which a Gaussian over a ring is a mean: 1e-34 is left of the first harmonic."""


def gaussian_taps(cutoff: float, sampling_period: float, samples: int) -> Array:
    """Taps (K,) of a Gaussian low-pass, from the middle outwards; its gain at ``cutoff`` Hz is 1/sqrt(2).

    Above a fifth of the sampling rate, where a sample is wider than the Gaussian, it is larger. No tap is negative
    and all of them, both sides taken, sum up to 1: no frequency is amplified. Much wider than a cycle of ``samples``,
    which it filters as a ring, it is the mean over the cycle.
    """
    deviation = math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff * sampling_period)
    if deviation > WIDEST * samples:
        mean = np.full(samples // 2 + 1, 1.0 / samples)
        if samples % 2 == 0:
            mean[-1] /= 2.0  # the sample opposite, which both sides reach
        return mean
    taps: Array = exponential(-0.5 * (np.arange(1 + int(REACH * deviation)) / deviation) ** 2)
    return taps / (2.0 * math.fsum(taps) - taps[0])


class IterativeLearning(BuiltInFeedforward):
    """u_{j+1}(k) = Q [u_j(k) + beta U_j(k + lead)], cycle j, sample k (Bristow, Tharayil & Alleyne 2006).

    One weight per sample and joint; Q is a zero-phase low-pass filter over the cycle as a ring: each cycle continues
    where the last one ended, as in repetitive control. What is learnt belongs to a sample of the cycle, whatever the
    path there.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """The low-pass filter Q."""

        cutoff: float | None = number("Hz", above=0, at_most=1e6, tuned=(3.0, 40.0))
        """Frequency at which the gain of Q is 1/sqrt(2); null: Q = 1."""

    config: Config

    def reset(self, setup: Setup) -> None:
        """Start with no torque at any sample, or with that of an earlier run at the same phase of its cycle."""
        samples, legs = setup.plan.support.shape
        if setup.learnt is not None:
            setup = replace(setup, learnt={"weights": resample(setup.learnt["weights"], samples, axis=1)})
        cells = np.broadcast_to(np.arange(samples, dtype=np.uint32)[:, None, None], (samples, legs, 1))
        cutoff = self.config.cutoff
        taps = None if cutoff is None else gaussian_taps(cutoff, setup.config.sampling_period, samples)
        self.params = network(setup, cells, samples, taps=taps)
        self.memory = [MemoryUse(samples, samples, samples, 0, 0)] * legs

    def learnt(self) -> Weights:
        """``weights`` (L, N, J), N m."""
        return {"weights": self.params.weights.copy()}
