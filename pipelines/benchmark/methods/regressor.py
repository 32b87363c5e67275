"""A model that is linear in its parameters: adapted in every sample, or identified from some cycles and then fixed.

``feedforward._target_=pipelines.benchmark.methods.regressor.AdaptiveRegressor``, or ``.Identified``
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.config.machine import RobotMachine
from cmacexp.feedforward.identified import list_by_joints
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.network import BuiltInFeedforward, regressor
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Reference, Setup
from cmacexp.planning.reference import Motion, Y
from cmacexp.protocols import Measurement
from cmacexp.typing import Array, Weights
from pipelines.benchmark.methods.norm_optimal import low_pass
from pipelines.benchmark.methods.playing import Playing


def rigid_torque(setup: Setup, still: bool) -> Array:
    """Compute the planned torque (N, L, J), N m, without load on the feet; ``still``: at rest in each posture."""
    plan = setup.plan
    motions = [plan.joints, plan.sway]
    if still:
        motions = [Motion(motion.position, *np.zeros((2, *motion.position.shape))) for motion in motions]
    if isinstance(setup.config.machine, RobotMachine):
        joints, sway = motions
        no_load = np.zeros_like(plan.force_desired)
        return planned_torques(setup.config, setup.mechanism, joints, sway, plan.force_desired, no_load)
    return planned_torque(setup.mechanism, *motions[0], np.zeros(plan.support.shape))


MODEL = np.array([1.0, 1.0, 1.0, 0.0])
"""Parameters of the nominal model: inertia, gravity, contact, and contact torque that the controller already adds."""
SMOOTH_SIGN = 0.1
"""Velocity scale of the smoothed sign of a joint's velocity, relative to the root mean square of that velocity."""
RIDGE = 1e-3
"""Ridge added to the correlation matrix of the columns, whose inverse would amplify nearly collinear columns."""


def make_regressor(setup: Setup) -> Array:
    """Compute the regressor Y (N, L, J, P) along the plan, N m per unit of each parameter.

    The first four parameters are those of MODEL, shared by the joints of a leg. Then follow three for each joint:
    viscous friction, N m s/rad, with the joint velocity as column; dry friction, N m, with its smoothed sign; rotor
    inertia, kg m^2, with the joint acceleration.
    """
    gravity, rigid = (rigid_torque(setup, still) for still in (True, False))
    dynamics = InverseDynamics(InverseDynamics.Config(1.0, 1.0))
    configs = (setup.config, replace(setup.config, reference="aware"))
    # With reference=force_feedforward the controller itself adds torque for the desired force.
    nominal, whole = (dynamics.compute_torque(replace(setup, config=config)) for config in configs)
    model = [rigid - gravity, gravity, nominal - rigid, whole - nominal]
    _, velocity, acceleration = list_by_joints(setup.plan.joints)
    size = np.sqrt(np.mean(velocity**2, axis=0))
    sign = np.tanh(np.divide(velocity, SMOOTH_SIGN * size, out=np.zeros_like(velocity), where=size > 0.0))
    per_joint = (values[..., None] * np.eye(velocity.shape[2]) for values in (velocity, sign, acceleration))
    return np.concatenate([np.stack(model, axis=-1), *per_joint], axis=-1)


def make_gains(regressor: Array) -> Array:
    """Compute Gamma (L, P, P), the inverse of the mean of Y^T Y over a cycle: a gain of 1 adapts within a cycle.

    Columns are first divided by their root mean squares; a zero column gets a gain of zero.
    """
    power = np.einsum("kijp,kijq->ipq", regressor, regressor) / len(regressor)
    size = np.sqrt(np.diagonal(power, axis1=1, axis2=2))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 1e-9)
    both = scale[:, :, None] * scale[:, None]
    return np.asarray(both * np.linalg.inv(both * power + RIDGE * np.eye(power.shape[1])))


class AdaptiveRegressor(BuiltInFeedforward):
    """Desired-compensation law: torque = Y a, a += gain Gamma Y^T U / N in every sample (Sadegh & Horowitz 1990).

    Y is the regressor of the planned motion (Slotine & Li 1987 use the measured motion). The parameters a of each leg
    start with those of the nominal model. The feedback U is combined with the Y of the sample that caused it. Learnt
    parameters are valid for any plan. Errors that no column of Y explains, such as patches of ground, remain.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Speed of adaptation."""

        gain: float = number("", above=0, at_most=10, default=0.5, tuned=(0.05, 2.0))
        """Fraction of the parameter error that is corrected in a cycle."""

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
        """Return ``parameters`` (L, P), in the order of :func:`make_regressor`."""
        return {"parameters": self.params.weights[..., 0].copy()}


CONTACT, ADDED = 2, 3
"""Columns of the regressor: torque of the contact force, and the part that the controller adds."""
LEAST = 1e-6
"""Lower bound of a measured contact force, N: the load is shared in proportion to the forces."""


def make_whole(regressor: Array) -> Array:
    """Return the regressor of the total joint torque: the controller's part is added to that of the contact force."""
    whole = np.delete(regressor, ADDED, axis=-1)
    whole[..., CONTACT] += regressor[..., ADDED]
    return whole


class Identified(Playing):
    """Identified model: torque = Y a with a from least squares, as in Gautier & Khalil 1992.

    Y is the regressor of the adaptive law: inertia, gravity and contact of each leg relative to the nominal model,
    viscous and dry friction and rotor inertia of each joint. The fit uses measured angles, forces and total torques,
    as means over ``cycles`` cycles after the first one; in a first run these have feedback only. Angles and torque
    are low-pass filtered, and an FFT over the cycle differentiates the angles. Parameters that the data do not
    determine stay nominal. After the fit a is constant. The plan is filtered by the same low-pass, so a jump of its
    velocity gives an impulse of torque. After a change of the task the previous model acts until a is identified
    again.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Data, filter and prior of the identification."""

        cycles: int = number("", at_least=1, at_most=1000, default=2)
        """Number of measured cycles."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of a Gaussian low-pass of angles and torque is 1/sqrt(2)."""
        prior: float = number("", above=0, at_most=1e6, default=1.0, tuned=(0.01, 10.0))
        """Weight of the nominal parameters relative to the data, for a column of Y orthogonal to all others."""

    def reset(self, setup: Setup) -> None:
        """Compute the regressor of the plan; start with zero torque, or with the parameters of an earlier run."""
        self.start(setup)
        self.setup = setup
        samples, legs = setup.plan.support.shape
        self.gains = low_pass(self.config.cutoff, setup)
        self.omega = 2.0 * np.pi * np.fft.rfftfreq(samples, setup.config.sampling_period)[:, None, None]
        self.planned = self.regress(setup.plan.joints.position)
        self.parameters = np.zeros((legs, self.planned.shape[-1] - 1))
        self.measured: list[tuple[Array, Array, Array]] = []  # angles, forces and torques of each step
        if setup.learnt is not None and setup.learnt["parameters"].any():
            self.use(setup.learnt["parameters"])

    def learnt(self) -> Weights:
        """Return ``parameters`` (L, P): inertia, gravity, contact factors; friction; rotor; 0 if not identified."""
        return {"parameters": self.parameters.copy()}

    def use(self, parameters: Array) -> None:
        """Set the parameters (L, P), and compute the torque of every sample from them."""
        self.parameters = parameters.copy()
        whole = np.einsum("kijp,ip->kij", make_whole(self.planned), parameters)
        self.torque = whole - self.planned[..., ADDED]

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> bool:
        """Record angles and forces, and the torque (L, J), N m, of the last step; identify after the last cycle.

        Returns:
            True if further steps are to be recorded.
        """
        self.measured.append((measurement.q, measurement.force, torque))
        if len(self.measured) <= (1 + self.config.cycles) * len(self.torque):
            return True
        self.use(self.identify())
        return False

    def regress(self, angles: Array, force: Array | None = None) -> Array:
        """Compute the regressor along ``angles`` (N, L, J), rad, of a cycle.

        ``force`` (N, L), N, is the contact force; None takes the planned one.
        """
        plan = self.setup.plan
        spectrum: Any = self.gains * np.fft.rfft(angles, axis=0)
        derivatives = (spectrum * (1j * self.omega) ** power for power in range(3))
        joints = Motion(*(np.fft.irfft(derivative, len(angles), axis=0) for derivative in derivatives))
        foot = plan.desired.position.copy()
        if force is None:
            force = plan.force_desired
        else:
            foot[..., Y] = self.setup.mechanism.hip_height + force / self.setup.config.assumed_stiffness
        plan = plan._replace(joints=joints, desired=plan.desired._replace(position=foot), force_desired=force)
        return make_regressor(replace(self.setup, plan=plan))

    def identify(self) -> Array:
        """Fit the parameters (L, P) by least squares, with a small penalty on differences from the nominal ones."""
        cycles, samples = self.config.cycles, len(self.torque)
        angles, force, later = map(np.array, zip(*self.measured[samples:], strict=True))
        angles, force, torque = (
            (values.reshape(cycles, samples, *values.shape[1:]) / cycles).sum(axis=0)
            for values in (angles[:-1], force[:-1], later[1:])
        )
        regressor = make_whole(self.regress(angles, np.fmax(force, LEAST)))
        # The torque of a sample acts until the next one, so its mean time is half a sample after that of the angles.
        half: Any = self.gains * np.exp(-0.5j * self.omega * self.setup.config.sampling_period)
        torque = np.fft.irfft(half * np.fft.rfft(torque, axis=0), samples, axis=0)
        nominal = np.pad(MODEL[:ADDED], (0, regressor.shape[-1] - ADDED))
        parameters = np.empty((regressor.shape[1], len(nominal)))
        for i, leg_parameters in enumerate(parameters):
            rows = regressor[:, i].reshape(-1, len(nominal))
            size = np.sqrt(np.mean(rows**2, axis=0))
            scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 1e-9)
            scaled = rows * scale
            power = scaled.T @ scaled + self.config.prior * len(rows) * np.eye(len(nominal))
            correlation = scaled.T @ (torque[:, i].ravel() - rows @ nominal)
            leg_parameters[:] = nominal + scale * np.linalg.solve(power, correlation)
        return parameters
