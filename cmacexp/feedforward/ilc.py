"""Iterative learning control: a torque for every sample of the cycle, improved from cycle to cycle."""

import numpy as np

from cmacexp.cmac.use import MemoryUse
from cmacexp.errors import BadInput
from cmacexp.feedforward.network import BuiltInFeedforward, network
from cmacexp.planning.setup import Setup
from cmacexp.typing import Array, Weights

REACH = 4.0
"""Standard deviations of the Gaussian to which its taps go."""


def gaussian_taps(cutoff: float, sampling_period: float) -> Array:
    """Taps (K,) of a Gaussian low-pass, from the middle outwards; its gain at ``cutoff`` Hz is 1/sqrt(2).

    Above a fifth of the sampling rate, where a sample is wider than the Gaussian, it is larger. No tap is negative
    and all of them, both sides taken, sum up to 1: no frequency is amplified.
    """
    deviation = np.sqrt(np.log(2.0)) / (2.0 * np.pi * cutoff * sampling_period)
    taps = np.exp(-0.5 * (np.arange(1 + int(REACH * deviation)) / deviation) ** 2)
    return taps / (2.0 * taps.sum() - taps[0])


class IterativeLearning(BuiltInFeedforward):
    """u_{j+1}(k) = Q [u_j(k) + beta U_j(k + lead)], cycle j, sample k (Bristow, Tharayil & Alleyne 2006).

    One weight a sample and joint; Q is a low-pass without phase over the cycle, which it takes as a ring: each cycle
    goes on where the last one ended, as in repetitive control. Nothing is carried over to another path but by the
    sample's place in the cycle.

    Args:
        cutoff: of Q, Hz, where its gain is 1/sqrt(2); None: Q = 1.
    """

    def __init__(self, cutoff: float | None):
        super().__init__()
        self.cutoff = cutoff

    def reset(self, setup: Setup) -> None:
        """No torque at any sample, or that of an earlier run.

        Raises:
            BadInput: the earlier run has another number of samples in a cycle.
        """
        samples, legs = setup.plan.support.shape
        cells = np.broadcast_to(np.arange(samples, dtype=np.uint32)[:, None, None], (samples, legs, 1))
        taps = None if self.cutoff is None else gaussian_taps(self.cutoff, setup.config.sampling_period)
        self.params = network(setup, cells, samples, taps=taps)
        if setup.learnt is not None:
            learnt = setup.learnt["weights"]
            if learnt.shape != self.params.weights.shape:
                raise BadInput(
                    "learning.start_from",
                    setup.config.learning.start_from,
                    f"has weights for {learnt.shape[1]} samples, this cycle has {samples}; give cycle and sampling "
                    "period that were learnt",
                )
            self.params.weights[:] = learnt
        self.memory = [MemoryUse(samples, samples, samples, 0, 0)] * legs

    def learnt(self) -> Weights:
        """``weights`` (L, N, 2), N m."""
        return {"weights": self.params.weights.copy()}
