"""Feedforward by inverse dynamics whose joint parameters are identified online from the feedback."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import number
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.network import play_earlier
from cmacexp.models.joint import OWN, SLOW, make_regressors
from cmacexp.planning.plan import Reference, Setup
from cmacexp.planning.reference import Motion
from cmacexp.typing import Array, Weights


def list_by_joints(motion: Motion) -> Array:
    """Stack position, rad, velocity, rad/s, and acceleration, rad/s^2, of a ``motion`` into one array (3, N, L, J).

    Its memory layout is joint by joint, which fixes the order of summation over samples.
    """
    return np.moveaxis(np.moveaxis(np.array(motion), -1, 1).copy(), 1, -1)


def make_features(joints: Motion, knots: int, ranges: Array) -> Array:
    """Compute the regressors (N, L, J, 4 + knots) of the motion of ``joints``: torque, N m, per unit of a parameter.

    See :func:`cmacexp.models.joint.make_regressors`; ``ranges`` (2, L, J) are the smallest and largest angles, rad.
    """
    angle, velocity, acceleration = list_by_joints(joints)
    slow = SLOW * np.sqrt((velocity**2).mean(axis=0)) + 1e-12
    return make_regressors((angle, velocity, acceleration), ranges, knots, slow)


class IdentifiedModel:
    """Inverse dynamics along the desired path, plus joint parameters identified from the feedback.

    After every cycle, recursive least squares with forgetting fits the parameters of each joint to the sum of
    feedforward and feedback minus the torque of the model: rotor inertia, viscous friction, an offset, a spring, and
    Coulomb friction as a function of the angle. The parameters belong to the joints and stay valid at other speeds.
    """

    @dataclass
    class Config(InverseDynamics.Config):
        """Errors of the model, and parameters of the identification."""

        knots: int = number("", at_least=1, at_most=50, tuned=[1, 3, 5, 9])
        """Number of angles per joint between which Coulomb friction is interpolated."""
        forgetting: float = number("", above=0, at_most=1, tuned=(0.5, 1.0))
        """Forgetting factor: weight of a cycle relative to the next one; 1: no forgetting."""
        prior: float = number("", above=0, at_most=1e6, tuned=(1e-3, 1.0))
        """Weight, in cycles of data, of the prior that parameters equal those of the model or of an earlier run."""

    acts = True

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup) -> None:
        """Compute model torque and regressors; start with zero parameters, or with those of an earlier run."""
        model = InverseDynamics(self.config)
        self.model_torque = model.compute_torque(setup)
        angles = setup.plan.joints.position
        self.ranges: Array = np.stack([angles.min(axis=0), angles.max(axis=0)])
        self.weights: Array = np.zeros((*setup.mechanism.shape, OWN + self.config.knots))
        if setup.learnt is not None:
            self.weights[:] = setup.learnt["weights"]
            self.ranges = setup.learnt["ranges"]
        features = make_features(setup.plan.joints, self.config.knots, self.ranges)
        self.features = play_earlier(features, model.count_advance(setup))
        self.start = self.weights
        self.lead = setup.lead
        power = np.maximum((self.features**2).sum(axis=0), 1e-9)
        self.prior = self.config.prior * power[..., None] * np.eye(power.shape[-1])
        self.information = np.zeros_like(self.prior)
        self.moment = np.zeros_like(power)
        self.applied = self.model_torque.copy()
        self.wanted = self.model_torque.copy()
        self.torque = self._compute_torque()

    def _compute_torque(self) -> Array:
        return np.asarray(self.model_torque + np.einsum("kljf,ljf->klj", self.features, self.weights))

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the feedback of the last step (L, J), N m; return the torque of this step (L, J), N m."""
        samples = len(self.torque)
        caused = (reference.sample - 1 - self.lead) % samples
        self.wanted[caused] = self.applied[caused] + learning_error
        if caused == samples - 1 and reference.step >= samples:
            self._identify()
        torque: Array = self.torque[reference.sample].copy()
        self.applied[reference.sample] = torque
        return torque

    def _identify(self) -> None:
        """Fit the joint parameters to all cycles so far, with exponential forgetting, and update the torque."""
        wanted = self.wanted - self.model_torque
        self.information *= self.config.forgetting
        self.moment *= self.config.forgetting
        self.information += np.einsum("kljf,kljg->ljfg", self.features, self.features, optimize=True)
        self.moment += np.einsum("kljf,klj->ljf", self.features, wanted)
        moment = self.moment + np.einsum("ljfg,ljg->ljf", self.prior, self.start)
        self.weights = np.linalg.solve(self.information + self.prior, moment[..., None])[..., 0]
        self.torque = self._compute_torque()

    def learnt(self) -> Weights:
        """Return joint parameters, ``weights`` (L, J, 4 + knots), and ``ranges`` (2, L, J) of the angles, rad.

        Their units follow from :func:`make_features`.
        """
        return {"weights": self.weights.copy(), "ranges": self.ranges}
