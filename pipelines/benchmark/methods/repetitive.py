"""Repetitive control.

``feedforward._target_=pipelines.benchmark.methods.repetitive.Repetitive``
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.errors import BadInput
from cmacexp.feedforward.ilc import gaussian_taps
from cmacexp.planning.setup import Reference, Setup
from cmacexp.typing import Array
from pipelines.benchmark.methods.once_a_cycle import Playing


class Repetitive(Playing):
    """u(k) = Q(q) [u(k - N) + gain U(k - N + lead)] in every sample (Inoue 1990; Longman 2010).

    Q is a symmetric FIR, without phase: a Gaussian low-pass over samples of the last period. The iterative learning
    control of the project (``feedforward=ilc``) is close to this: it too updates each sample at once. But it filters
    all samples together at the start of a cycle, where the last ones have yet to learn from that cycle's feedback;
    here no moment of the cycle is special. The gain is a field of its own, not ``learning.rate``.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Gain, and the low-pass filter Q."""

        gain: float = number("", above=0, at_most=2, default=0.5, tuned=(0.1, 1.0))
        """Part of the feedback of the last period that is added."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of Q is 1/sqrt(2)."""

    def reset(self, setup: Setup) -> None:
        """Start with no torque, or with that of an earlier run at the same phase.

        Raises:
            BadInput: Q is wider than half a cycle.
        """
        samples, (legs, joints) = len(setup.plan.support), setup.mechanism.shape
        taps = gaussian_taps(self.config.cutoff, setup.config.sampling_period, samples)
        if 4 * len(taps) > samples:
            raise BadInput("feedforward.cutoff", self.config.cutoff, "must be higher: Q is longer than half a cycle")
        self.taps, self.lead = np.concatenate([taps[:0:-1], taps]), setup.lead
        self.reach, self.samples = len(taps) - 1, samples
        self.start(setup)
        self.flat = self.torque.reshape(samples, legs * joints)  # a view
        # Of the last 2 reach samples and of a cycle, so that the samples of Q are always one slice.
        self.raw = np.take(self.flat, np.arange(-2 * self.reach, samples), axis=0, mode="wrap")

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Update the torque of the next period; return this step's torque (L, J), N m."""
        new, ahead = (reference.sample - 1 - self.lead) % self.samples, 2 * self.reach
        if new == 0:
            self.raw[:ahead] = self.raw[self.samples :]
        self.raw[new + ahead] = self.flat[new] + self.config.gain * learning_error.ravel()
        # Its samples are of one period: none is played again before all are known.
        self.flat[new - self.reach] = self.taps @ self.raw[new : new + ahead + 1]
        return self.torque[reference.sample]
