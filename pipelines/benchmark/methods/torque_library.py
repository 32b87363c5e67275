"""A library of torques: what the plant took in good cycles, by stroke and cycle time.

``feedforward._target_=pipelines.benchmark.methods.torque_library.TorqueLibrary``; it shows how to ``observe``.
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.feedforward.network import resample
from cmacexp.planning.columns import ACTING, FORCE_ADDED, JOINT_COLUMNS
from cmacexp.planning.setup import Reference, Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array, Weights
from pipelines.benchmark.methods.model_torques import added_torque
from pipelines.benchmark.methods.norm_optimal import low_pass

WORSE = 1.2
"""Error of a cycle, over that of the best one, from which on its torque is not used."""


class TorqueLibrary:
    """u += share (tau - u): the torque tau that the plant took in a cycle replaces that of the library step by step.

    Torque that corrects an error comes ``setup.lead`` samples late, and is stored so much earlier; what the
    controller adds to press with the desired force is left out. A cycle whose joints miss the plan by far more than
    in the best one teaches nothing: the torque of the best one is played again. A new plan starts with the torque of
    the nearest one known. Memories of torque go back to Raibert (1978).
    """

    @dataclass
    class Config(FeedforwardConfig):
        """How fast the library changes."""

        share: float = number("", above=0, at_most=1, default=0.4, tuned=(0.05, 1.0))
        """Of the way to the torque of the last cycle."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of a Gaussian low-pass of what is stored is 1/sqrt(2)."""

    acts = True

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup) -> None:
        """Look the plan up; without a library start with no torque."""
        samples, (legs, joints) = len(setup.plan.support), setup.mechanism.shape
        gait, known = setup.config.gait, setup.learnt or {"plans": np.zeros((0, 2))}
        self.plan, self.plans = np.array([gait.stroke, gait.cycle_time]), known["plans"]
        self.stored = [known[f"torque_{n}"] for n in range(len(self.plans))]
        self.angles, self.lead = JOINT_COLUMNS["angle"][:joints], setup.lead
        self.torque = np.zeros((samples, legs, joints))
        # Per newton, since the plan of a robot follows the load that its feet carry.
        force = setup.plan.reference[ACTING, :, :, FORCE_ADDED, None]
        self.lever = np.divide(added_torque(setup), force, out=np.zeros_like(self.torque), where=force > 0.0)
        self.added: Array = np.zeros((legs, joints))
        if len(self.plans):
            nearest = np.abs(np.log((self.plans + 1e-9) / (self.plan + 1e-9))).sum(axis=1).argmin()
            self.torque[:] = resample(self.stored[nearest], samples)
        self.low_pass = low_pass(self.config.cutoff, setup)
        self.taken = np.zeros_like(self.torque)
        self.best, self.least, self.error, self.seen, self.acted = self.torque.copy(), np.inf, 0.0, 0, False

    def learnt(self) -> Weights:
        """``plans`` (plans, 2), strokes in m and cycle times in s, and of each ``torque_n`` (N, L, J), N m."""
        others = [n for n, plan in enumerate(self.plans) if not np.array_equal(plan, self.plan)]
        torques = {f"torque_{k}": self.stored[n] for k, n in enumerate(others)}
        plans = np.concatenate([self.plans[others], self.plan[None]])
        return {"plans": plans, **torques, f"torque_{len(others)}": self.best.copy()}

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> None:
        """Note the torque of the last step, and how far the joints are from the plan."""
        self.taken[reference.sample - 1] = torque - self.added
        self.added = self.lever[reference.sample] * reference.values[:, FORCE_ADDED, None]
        if reference.sample == 0:
            self._end_cycle()
        off = (measurement.q - reference.joints[:, self.angles])[~reference.support]
        self.error += float(np.vdot(off, off))
        self.seen += 1

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """This step's torque (L, J), N m; it learns from what it observes."""
        self.acted = True
        return self.torque[reference.sample]

    def _end_cycle(self) -> None:
        """Learn from a whole cycle in which it acted, or return to the best one."""
        if self.acted and self.seen >= len(self.torque):
            if self.error < self.least:
                self.best, self.least = self.torque.copy(), self.error
            if self.error > WORSE**2 * self.least:
                self.torque = self.best.copy()
            else:
                feedback = self.taken - self.torque
                wanted = np.fft.rfft(self.torque + self.config.share * np.roll(feedback, -self.lead, axis=0), axis=0)
                self.torque = np.fft.irfft(self.low_pass * wanted, len(self.torque), axis=0)
        self.error, self.seen, self.acted = 0.0, 0, False
