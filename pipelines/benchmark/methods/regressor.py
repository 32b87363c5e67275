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


CONTACT, ADDED = 2, 3
"""Columns of the regressor: torque of the contact force, and what the controller adds to it."""
LEAST = 1e-6
"""Measured contact force that a foot presses with at least, N: feet share the load in proportion."""


def make_whole(regressor: Array) -> Array:
    """The regressor of all torque that a joint takes: the part of the controller belongs to the contact force."""
    whole = np.delete(regressor, ADDED, axis=-1)
    whole[..., CONTACT] += regressor[..., ADDED]
    return whole


class Identified(Playing):
    """torque = Y a, with the a that explains best what the joints took: least squares, as in Gautier & Khalil 1992.

    Y is the regressor of the adaptive law: inertia, gravity and contact of each leg over those of the nominal model,
    viscous and dry friction and rotor inertia of each joint. It is computed along measured angles and forces, means
    of ``cycles`` cycles after the first one; in the first run these are of feedback only. Angles and torque pass a
    low-pass, and an FFT over the cycle differentiates them. What the data do not decide stays nominal. Then a is
    fixed. The plan passes the same low-pass: where its velocity jumps, the torque has the impulse that this takes.
    After a change the known model acts while it is identified anew.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """How much is measured."""

        cycles: int = number("", at_least=1, at_most=1000, default=2)
        """Cycles that are measured."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of a Gaussian low-pass of angles and torque is 1/sqrt(2)."""
        prior: float = number("", above=0, at_most=1e6, default=1.0, tuned=(0.01, 10.0))
        """Weight of the nominal parameters, over that of the data on a column of Y that is unlike all others."""

    def reset(self, setup: Setup) -> None:
        """Compute the regressor of the plan; start with no torque, or with the parameters of an earlier run."""
        self.start(setup)
        self.setup, (samples, legs) = setup, setup.plan.support.shape
        self.gains = low_pass(self.config.cutoff, setup)
        self.omega = 2.0 * np.pi * np.fft.rfftfreq(samples, setup.config.sampling_period)[:, None, None]
        self.planned = self.regress(setup.plan.joints.position)
        self.parameters = np.zeros((legs, self.planned.shape[-1] - 1))
        self.shown: list[tuple[Array, Array, Array]] = []  # angles, forces and torques, from the first step on
        if setup.learnt is not None and setup.learnt["parameters"].any():
            self.use(setup.learnt["parameters"])

    def learnt(self) -> Weights:
        """``parameters`` (L, P): factors of inertia, gravity and contact; friction and rotor; 0 if not identified."""
        return {"parameters": self.parameters.copy()}

    def use(self, parameters: Array) -> None:
        """Compute the torque of every sample from parameters (L, P)."""
        self.parameters = parameters.copy()
        whole = np.einsum("kijp,ip->kij", make_whole(self.planned), parameters)
        self.torque = whole - self.planned[..., ADDED]

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> bool:
        """Measure angles, forces, and the torque (L, J), N m, of the last step; whether there is more to measure."""
        self.shown.append((measurement.q, measurement.force, torque))
        if len(self.shown) <= (1 + self.config.cycles) * len(self.torque):
            return True
        self.use(self.identify())
        return False

    def regress(self, angles: Array, force: Array | None = None) -> Array:
        """The regressor along ``angles`` (N, L, J), rad, of a cycle; with ``force`` (N, L), N, or the planned one."""
        setup, plan = self.setup, self.setup.plan
        spectrum: Any = self.gains * np.fft.rfft(angles, axis=0)
        derivatives = (spectrum * (1j * self.omega) ** power for power in range(3))
        joints = Motion(*(np.fft.irfft(each, len(angles), axis=0) for each in derivatives))
        foot = plan.desired.position.copy()
        if force is None:
            force = plan.force_desired
        else:
            foot[..., Y] = setup.mechanism.hip_height + force / setup.config.assumed_stiffness
        plan = plan._replace(joints=joints, desired=plan.desired._replace(position=foot), force_desired=force)
        return make_regressor(replace(setup, plan=plan))

    def identify(self) -> Array:
        """Parameters (L, P) by least squares, with a small penalty on what differs from the nominal ones."""
        cycles, samples = self.config.cycles, len(self.torque)
        angles, force, later = map(np.array, zip(*self.shown[samples:], strict=True))
        angles, force, taken = (
            (own.reshape(cycles, samples, *own.shape[1:]) / cycles).sum(axis=0)
            for own in (angles[:-1], force[:-1], later[1:])
        )
        regressor = make_whole(self.regress(angles, np.fmax(force, LEAST)))
        # The torque of a sample acts until the next one: at its middle, half a sample later than the angles.
        half: Any = self.gains * np.exp(-0.5j * self.omega * self.setup.config.sampling_period)
        taken = np.fft.irfft(half * np.fft.rfft(taken, axis=0), samples, axis=0)
        nominal = np.pad(MODEL[:ADDED], (0, regressor.shape[-1] - ADDED))
        found = np.empty((regressor.shape[1], len(nominal)))
        for i, own in enumerate(found):
            rows = regressor[:, i].reshape(-1, len(nominal))
            size = np.sqrt(np.mean(rows**2, axis=0))
            scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 1e-9)
            scaled, left = rows * scale, taken[:, i].ravel() - rows @ nominal
            power = scaled.T @ scaled + self.config.prior * len(rows) * np.eye(len(nominal))
            own[:] = nominal + scale * np.linalg.solve(power, scaled.T @ left)
        return found
