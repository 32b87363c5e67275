"""Adaptive control with the regressor of the desired motion.

``feedforward._target_=pipelines.benchmark.methods.adaptive.AdaptiveRegressor``
"""

from dataclasses import dataclass, replace

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.config.machine import RobotMachine
from cmacexp.feedforward.identified import list_by_joints
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.network import BuiltInFeedforward, regressor
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Setup
from cmacexp.planning.reference import Motion
from cmacexp.typing import Array, Weights


def rigid_torque(setup: Setup, still: bool) -> Array:
    """Torque (N, L, J) of masses and joints, with no load on the feet, N m; ``still``: at rest in each posture."""
    plan = setup.plan
    joints, sway = plan.joints, plan.sway
    if still:
        joints, sway = (Motion(each.position, *np.zeros((2, *each.position.shape))) for each in (joints, sway))
    if isinstance(setup.config.machine, RobotMachine):
        no_load = np.zeros_like(plan.force_desired)
        return planned_torques(setup.config, setup.mechanism, joints, sway, plan.force_desired, no_load)
    return planned_torque(setup.mechanism, *joints, np.zeros(plan.support.shape))


MODEL = np.array([1.0, 1.0, 1.0, 0.0])
"""Factors of the nominal model: inertia, gravity, contact, and what the controller already adds for contact."""
SMOOTH_SIGN = 0.1
"""Velocity over which the sign of a joint's velocity turns, over its root mean square."""
RIDGE = 1e-3
"""Is added to the correlations of the columns, whose inverse would amplify what hardly differs."""


def make_regressor(setup: Setup) -> Array:
    """Y (N, L, J, P) along the plan, N m per unit of each parameter.

    Four torques of the nominal model, see MODEL, shared by the joints of a leg; then for each joint its own velocity
    (viscous friction, N m s/rad), the smoothed sign of it (dry friction, N m) and acceleration (rotor, kg m^2).
    """
    gravity, rigid = (rigid_torque(setup, still) for still in (True, False))
    aware, dynamics = replace(setup.config, reference="aware"), InverseDynamics(InverseDynamics.Config(1.0, 1.0))
    # With force_feedforward the controller adds torque to press with a force.
    known, whole = (dynamics.compute_torque(replace(setup, config=each)) for each in (setup.config, aware))
    model = [rigid - gravity, gravity, known - rigid, whole - known]
    _, velocity, acceleration = list_by_joints(setup.plan.joints)
    size = np.sqrt(np.mean(velocity**2, axis=0))
    sign = np.tanh(np.divide(velocity, SMOOTH_SIGN * size, out=np.zeros_like(velocity), where=size > 0.0))
    own = (values[..., None] * np.eye(velocity.shape[2]) for values in (velocity, sign, acceleration))
    return np.concatenate([np.stack(model, axis=-1), *own], axis=-1)


def make_gains(regressor: Array) -> Array:
    """Gamma (L, P, P): inverse of the mean of Y^T Y over a cycle, so that a gain of 1 takes a cycle.

    Columns are divided by their root mean squares first; one that is zero has a gain of zero.
    """
    power = np.einsum("kijp,kijq->ipq", regressor, regressor) / len(regressor)
    size = np.sqrt(np.diagonal(power, axis1=1, axis2=2))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 1e-9)
    both = scale[:, :, None] * scale[:, None]
    return np.asarray(both * np.linalg.inv(both * power + RIDGE * np.eye(power.shape[1])))


class AdaptiveRegressor(BuiltInFeedforward):
    """torque = Y a, a += gain Gamma Y^T U / N in every sample: the desired-compensation law (Sadegh & Horowitz 1990).

    Y is the regressor of the planned motion (after Slotine & Li 1987, whose is that of the measured one), a the
    parameters of each leg, at first those of the nominal model, U the feedback, which trains the Y of the sample that
    caused it. Learnt parameters belong to no plan. What no column of Y explains, such as patches of ground, stays.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Speed of adaptation."""

        gain: float = number("", above=0, at_most=10, default=0.5, tuned=(0.05, 2.0))
        """Part of the error of the parameters that goes in a cycle."""

    def reset(self, setup: Setup) -> None:
        """Compute the regressor; start with the nominal model, or with parameters of an earlier run."""
        columns = make_regressor(setup)
        samples, legs, _, number = columns.shape
        steps = self.config.gain / samples * make_gains(columns) @ columns.swapaxes(2, 3)
        parameters = np.tile(np.pad(MODEL, (0, number - len(MODEL))), (legs, 1))
        if setup.learnt is not None:
            parameters[...] = setup.learnt["parameters"]
        self.params = regressor(setup, columns, steps, parameters)

    def learnt(self) -> Weights:
        """``parameters`` (L, P), in the order of :func:`make_regressor`."""
        return {"parameters": self.params.weights[..., 0].copy()}
