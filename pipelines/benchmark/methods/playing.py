"""What methods have in common that play a torque for each sample of the cycle; and repetitive control, one of them.

``feedforward._target_=pipelines.benchmark.methods.playing.Repetitive``
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.errors import require
from cmacexp.feedforward.ilc import gaussian_taps
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
