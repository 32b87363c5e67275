"""A model of the machine whose joints are identified from the feedback while it moves."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import number
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.models.joint import OWN, SLOW, make_regressors
from cmacexp.planning.plan import Reference, Setup
from cmacexp.planning.reference import Motion
from cmacexp.typing import Array, Weights


def list_by_joints(motion: Motion) -> Array:
    """Position, velocity and acceleration (3, N, L, J), joint by joint in memory: the order in which sums add up.

    They are in rad, rad/s and rad/s^2.
    """
    return np.moveaxis(np.moveaxis(np.array(motion), -1, 1).copy(), 1, -1)


def make_features(joints: Motion, knots: int, ranges: Array) -> Array:
    """Features (N, L, J, 4 + knots) of the motion of ``joints``: torque for each parameter's unit.

    See :func:`cmacexp.models.joint.make_regressors`; ``ranges`` (2, L, J) are of the angles, rad.
    """
    angle, velocity, acceleration = list_by_joints(joints)
    slow = SLOW * np.sqrt((velocity**2).mean(axis=0)) + 1e-12
    return make_regressors((angle, velocity, acceleration), ranges, knots, slow)


class IdentifiedModel:
    """Inverse dynamics along the desired path, plus joints whose parameters are learnt from the feedback.

    After every cycle least squares with forgetting fit, joint by joint, what feedforward and feedback supplied
    together beside the torque of the model: rotor inertia, viscous friction, an offset, a spring, and Coulomb
    friction over the angle. What is learnt belongs to the joints, whatever the speed.
    """

    @dataclass
    class Config(InverseDynamics.Config):
        """Errors of the model, and how its joints are identified."""

        knots: int = number("", at_least=1, at_most=50, tuned=[1, 3, 5, 9])
        """Angles at which a joint has a Coulomb friction of its own."""
        forgetting: float = number("", above=0, at_most=1, tuned=(0.5, 1.0))
        """Weight of a cycle over that of the one after it."""
        prior: float = number("", above=0, at_most=1e6, tuned=(1e-3, 1.0))
        """Cycles of evidence that no parameter differs from the model, or from an earlier run."""

    acts = True

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup) -> None:
        """Compute the torque of the model and the features; start with no difference, or that of an earlier run."""
        self.model_torque = InverseDynamics(self.config).compute_torque(setup)
        angles = setup.plan.joints.position
        self.ranges: Array = np.stack([angles.min(axis=0), angles.max(axis=0)])
        self.weights: Array = np.zeros((*setup.mechanism.shape, OWN + self.config.knots))
        if setup.learnt is not None:
            self.weights[:], self.ranges = setup.learnt["weights"], setup.learnt["ranges"]
        self.features = make_features(setup.plan.joints, self.config.knots, self.ranges)
        self.start, self.lead = self.weights, setup.lead
        power = np.maximum((self.features**2).sum(axis=0), 1e-9)
        self.prior = self.config.prior * power[..., None] * np.eye(power.shape[-1])
        self.information, self.moment = np.zeros_like(self.prior), np.zeros_like(power)
        self.given, self.wanted = self.model_torque.copy(), self.model_torque.copy()
        self.torque = self._compute_torque()

    def _compute_torque(self) -> Array:
        return np.asarray(self.model_torque + np.einsum("kljf,ljf->klj", self.features, self.weights))

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, J), N m, then give this step's torque (L, J), N m."""
        samples = len(self.torque)
        caused = (reference.sample - 1 - self.lead) % samples
        self.wanted[caused] = self.given[caused] + learning_error
        if caused == samples - 1 and reference.step >= samples:
            self._identify()
        torque: Array = self.torque[reference.sample].copy()
        self.given[reference.sample] = torque
        return torque

    def _identify(self) -> None:
        """Fit the joints to the cycles so far, the last ones with the largest weights."""
        wanted = self.wanted - self.model_torque
        self.information *= self.config.forgetting
        self.moment *= self.config.forgetting
        self.information += np.einsum("kljf,kljg->ljfg", self.features, self.features, optimize=True)
        self.moment += np.einsum("kljf,klj->ljf", self.features, wanted)
        known = self.moment + np.einsum("ljfg,ljg->ljf", self.prior, self.start)
        self.weights = np.linalg.solve(self.information + self.prior, known[..., None])[..., 0]
        self.torque = self._compute_torque()

    def learnt(self) -> Weights:
        """``weights`` (L, J, 4 + knots), see :func:`make_features`; ``ranges`` (2, L, J) of their angles, rad."""
        return {"weights": self.weights.copy(), "ranges": self.ranges}
