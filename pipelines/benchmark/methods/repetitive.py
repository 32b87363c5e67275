"""Repetitive control.

``feedforward._target_=pipelines.benchmark.methods.repetitive.Repetitive``
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.errors import require
from cmacexp.feedforward.ilc import gaussian_taps
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array, Weights
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
        too_low = "must be higher: Q is longer than half a cycle"
        require(4 * len(taps) <= samples, "feedforward.cutoff", self.config.cutoff, too_low)
        self.taps, self.lead, self.reach = np.concatenate([taps[:0:-1], taps]), setup.lead, len(taps) - 1
        self.start(setup)
        # Q and the lead need half a cycle at most: what is played in the other half is known.
        self.block, self.since = max(1, samples // 2 - self.lead), -1
        self.raw = self.torque.reshape(samples, legs * joints).copy()

    def play(self, sample: int, feedback: Array) -> Array:
        """Update the torque (N, L, J) of the next period by the ``feedback`` (N, L, J), N m, of the last steps.

        These are the steps from the last call to the one before ``sample``.
        """
        self.feedback, samples = feedback, len(feedback)
        flat = self.torque.reshape(self.raw.shape)  # a view
        count = 1 if self.since < 0 else (sample - self.since - 1) % samples + 1
        steps, self.since = np.arange(sample - count, sample), sample
        new = (steps - self.lead) % samples
        self.raw[new] = flat[new] + self.config.gain * feedback.reshape(flat.shape)[steps]
        around = self.raw[(np.arange(-2 * self.reach, count) + new[0]) % samples]
        for joint, values in enumerate(around.T):
            flat[new - self.reach, joint] = np.convolve(values, self.taps, "valid")
        return self.torque

    def learnt(self) -> Weights:
        """``torque`` (N, L, J), N m, at the end of a cycle, whose last feedback is not known yet."""
        if 0 <= self.since < len(self.torque) - 1:
            self.play(len(self.torque) - 1, self.feedback)
        return super().learnt()
