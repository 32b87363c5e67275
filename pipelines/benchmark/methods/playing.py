"""Base class of methods that store a torque for each sample of the cycle; and repetitive control, one of them.

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
    """Feedforward that stores a ``torque`` (N, L, J), N m, for each sample of the cycle; it learns once per cycle."""

    acts = True
    lead = 0
    """Samples from a torque to the feedback that is attributed to it."""
    begun = False

    def __init__(self, config: Any):
        self.config = config

    def start(self, setup: Setup) -> None:
        """Set the torque to zero, or to that of an earlier run at the same phase."""
        self.torque: Array = np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1]))
        if setup.learnt is not None and "torque" in setup.learnt:
            self.torque[:] = resample(setup.learnt["torque"], len(self.torque))
        self.feedback = np.zeros_like(self.torque)
        self.block = len(self.torque)

    def learnt(self) -> Weights:
        """Return ``torque`` (N, L, J), N m."""
        return {"torque": self.torque.copy()}

    def learn(self, feedback: Array) -> None:
        """Improve the torque with the feedback that each of its samples caused, (N, L, J), N m."""

    def play(self, sample: int, feedback: Array) -> Array:
        """Learn from the ``feedback`` (N, L, J), N m, of a cycle, and return the next torque (N, L, J), N m.

        The first call only returns the torque.
        """
        if self.begun:
            self.learn(np.roll(feedback, -self.lead, axis=0))
        self.begun = True
        return self.torque

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Return the torque of a step (L, J), N m, for controllers that call it in each step; see :meth:`play`.

        ``learning_error`` (L, J), N m, is the feedback of the last step.
        """
        self.feedback[reference.sample - 1] = learning_error
        if reference.sample % self.block == 0:
            self.play(reference.sample, self.feedback)
        return self.torque[reference.sample]


class Repetitive(Playing):
    """Repetitive control: u(k) = Q(q) [u(k - N) + gain U(k - N + lead)] in every sample (Inoue 1990; Longman 2010).

    Q is a symmetric FIR filter without phase: a Gaussian low-pass over samples of the last period. The iterative
    learning control of the project (``feedforward=ilc``) is similar and also updates each sample immediately. But it
    filters all samples at the start of a cycle, when the last ones have not yet learnt from that cycle's feedback;
    here all samples are treated alike. The gain is a separate field, not ``learning.rate``.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Gain, and the low-pass filter Q."""

        gain: float = number("", above=0, at_most=2, default=0.5, tuned=(0.1, 1.0))
        """Fraction of the last period's feedback that is added."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of Q is 1/sqrt(2)."""

    def reset(self, setup: Setup) -> None:
        """Start with zero torque, or with that of an earlier run at the same phase.

        Raises:
            BadInput: Q is longer than half a cycle.
        """
        samples = len(setup.plan.support)
        taps = gaussian_taps(self.config.cutoff, setup.config.sampling_period, samples)
        require(
            4 * len(taps) <= samples,
            "feedforward.cutoff",
            self.config.cutoff,
            "must be higher: Q is longer than half a cycle",
        )
        self.taps = np.concatenate([taps[:0:-1], taps])
        self.lead = setup.lead
        self.reach = len(taps) - 1
        self.start(setup)
        # Q and the lead extend over half a cycle at most, so the torque of the other half is final.
        self.block = max(1, samples // 2 - self.lead)
        self.since = -1
        self.raw = self.torque.reshape(samples, -1).copy()

    def play(self, sample: int, feedback: Array) -> Array:
        """Update the torque (N, L, J) of the next period by the ``feedback`` (N, L, J), N m, of the last steps.

        These are the steps from the last call to the one before ``sample``.
        """
        self.feedback = feedback
        samples = len(feedback)
        flat = self.torque.reshape(self.raw.shape)  # a view
        count = 1 if self.since < 0 else (sample - self.since - 1) % samples + 1
        steps = np.arange(sample - count, sample)
        self.since = sample
        new = (steps - self.lead) % samples
        self.raw[new] = flat[new] + self.config.gain * feedback.reshape(flat.shape)[steps]
        around = self.raw[(np.arange(-2 * self.reach, count) + new[0]) % samples]
        for joint, values in enumerate(around.T):
            flat[new - self.reach, joint] = np.convolve(values, self.taps, "valid")
        return self.torque

    def learnt(self) -> Weights:
        """Return ``torque`` (N, L, J), N m, at the end of a cycle, whose last feedback is not known yet."""
        if 0 <= self.since < len(self.torque) - 1:
            self.play(len(self.torque) - 1, self.feedback)
        return super().learnt()
