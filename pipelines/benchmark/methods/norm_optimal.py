"""Norm-optimal iterative learning control, with the nominal closed loop as its model.

``feedforward._target_=pipelines.benchmark.methods.norm_optimal.NormOptimal``
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.feedforward.network import resample
from cmacexp.planning.setup import Setup
from cmacexp.typing import Array, Weights
from pipelines.benchmark.methods.frozen_loop import feedback_removed
from pipelines.benchmark.methods.once_a_cycle import OnceACycle


def low_pass(cutoff: float, setup: Setup) -> Array:
    """Gains (F, 1, 1) of a Gaussian low-pass at the frequencies of an FFT of a cycle, 1/sqrt(2) at ``cutoff`` Hz."""
    hertz: Any = np.fft.rfftfreq(len(setup.plan.support), setup.config.sampling_period)[:, None, None]
    gains: Array = 0.5 ** (0.5 * (hertz / cutoff) ** 2)
    return gains


class NormOptimal(OnceACycle):
    """u += gain (G^T G + r I)^-1 G^T U once a cycle, U the feedback of the last one (Amann, Owens & Rogers 1996).

    It minimises |U - G du|^2 + r |du|^2 for the model G of what a torque takes off the feedback. The model is
    periodic and of each leg by itself, frozen at the mean posture of its support and of its transfer. So G is
    block-circulant, and an FFT over the cycle inverts it; a sample takes the correction of the model of its phase. A
    low-pass of the torque bounds what the model errs in (Bristow, Tharayil & Alleyne 2006).
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Weights of the criterion."""

        gain: float = number("", above=0, at_most=2, default=0.7, tuned=(0.1, 1.0))
        """Part of the correction that is made."""
        penalty: float = number("", above=0, at_most=1e6, default=0.1, tuned=(0.003, 1.0))
        """r, of a change of the torque against the feedback that is left."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of a Gaussian low-pass of the torque is 1/sqrt(2)."""

    def reset(self, setup: Setup) -> None:
        """Invert the model; start with no torque, or with that of an earlier run."""
        self.start(setup)
        samples, legs = setup.plan.support.shape
        joints, angles = setup.mechanism.shape[1], setup.plan.joints.position
        self.support = setup.plan.support
        self.inverse = np.zeros((2, samples // 2 + 1, legs, joints, joints), complex)
        for phase in (0, 1):
            for i in range(legs):
                chosen = self.support[:, i] == phase
                if chosen.any():
                    model = feedback_removed(setup, i, angles[chosen, i].mean(axis=0), bool(phase))
                    self.inverse[phase, :, i] = self._invert(model)
        self.low_pass = low_pass(self.config.cutoff, setup)
        if setup.learnt is not None:
            self.torque[:] = resample(setup.learnt["torque"], samples)

    def _invert(self, model: Array) -> Array:
        """(F, J, J): gain (G^T G + r I)^-1 G^T."""
        adjoint = model.conj().swapaxes(1, 2)
        inverse: Any = np.linalg.solve(adjoint @ model + self.config.penalty * np.eye(model.shape[1]), adjoint)
        return self.config.gain * inverse

    def learnt(self) -> Weights:
        """``torque`` (N, L, J), N m."""
        return {"torque": self.torque.copy()}

    def learn(self) -> None:
        """Correct the torque, and filter it."""
        spectrum = np.fft.rfft(self.feedback, axis=0)[None, ..., None]
        change = np.fft.irfft((self.inverse @ spectrum)[..., 0], len(self.feedback), axis=1)
        wanted = np.fft.rfft(self.torque + np.where(self.support[..., None], change[1], change[0]), axis=0)
        self.torque[:] = np.fft.irfft(self.low_pass * wanted, len(self.torque), axis=0)
