"""Norm-optimal iterative learning control with the nominal closed loop as its model.

``feedforward._target_=pipelines.benchmark.methods.norm_optimal.NormOptimal``
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from cmacexp.config import FeedforwardConfig, number
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.control.hybrid_kernels import DAMPING, EXPLICIT, METHODS, STIFFNESS
from cmacexp.models.chain import batch_kinematics
from cmacexp.models.lead import discretise
from cmacexp.models.leg import GRAVITY, inertia, jacobian, trigonometry
from cmacexp.models.mechanism import POINT_MASS, get_leg, has_body
from cmacexp.models.robot_gains import list_jacobians
from cmacexp.planning.plan import Setup
from cmacexp.typing import Array
from pipelines.benchmark.methods.playing import Playing

NEAR_CIRCLE = 1e-8
"""Logarithm of the radius in the z-plane at which frequency responses are computed."""


def leg_at(setup: Setup, i: int, q: Array) -> tuple[Array, Array]:
    """Compute inertia (J, J), kg m^2, and Jacobian (J, J), m/rad, of leg ``i`` at ``q`` (J,), rad; fixed body."""
    mechanism = setup.mechanism
    if isinstance(setup.config.machine, RobotMachine):
        assert mechanism.chains is not None
        robot = read_model(setup.config.machine)
        posture = robot.home.copy()
        posture[i] = q
        return list_jacobians(robot, posture)[i][0], batch_kinematics(mechanism.chains[i], q[None])[1][0]
    leg = get_leg(mechanism, i)
    if mechanism.kind == POINT_MASS:
        return leg.mass_2 * np.eye(2), np.eye(2)
    trig = trigonometry(*q)
    symmetric = [[0, 1], [1, 2]]  # inertia() returns M_11, M_12, M_22
    return np.array(inertia(leg, trig))[symmetric], np.reshape(jacobian(leg, trig), (2, 2))


def contact(setup: Setup, support: bool) -> tuple[Array, Array]:
    """Return stiffness, N/m, and damping, N s/m, of the ground at a foot (2, J), and the mass that it moves (J,), kg.

    On a stand the assumed ground acts on a supporting foot along y. Under a body the feet carry a constant weight: a
    supporting leg lifts the hip instead, and for a robot moves its share of the body's mass.
    """
    mechanism = setup.mechanism
    ground, moved = np.zeros((2, mechanism.shape[1])), np.zeros(mechanism.shape[1])
    if support and not has_body(mechanism):
        ground[:, 1] = setup.config.assumed_stiffness, setup.config.terrain.damping
    elif support and isinstance(setup.config.machine, RobotMachine):
        moved[:] = mechanism.weight / GRAVITY / len(mechanism.legs)
    return ground, moved


def foot_gains(setup: Setup, support: bool, ground: Array) -> Array:
    """Compute the feedback force per error of foot position, N/m, and of foot velocity, N s/m: (2, J).

    In support, force control also feeds back the force of the ``ground`` (2, J), and posture control acts on the
    height of the hip.
    """
    control = setup.config.force_control
    both = np.array(setup.config.gains or (0.0, 0.0))
    gains = np.repeat(both[:, None], setup.mechanism.shape[1], axis=1)
    if support:
        method = METHODS[control.method]
        posture = (
            np.array([setup.config.posture.gain, setup.config.posture.rate_gain])
            if has_body(setup.mechanism)
            else 0.0
        )
        uses = np.array([method != DAMPING, method != STIFFNESS])
        along_y = (
            uses * both * (1.0 + posture) + (uses * both) @ (control.elasticity, control.admittance) * ground[:, 1]
        )
        gains[:, 1] = control.force_gain * ground[:, 1] if method == EXPLICIT else along_y
    return gains


def feedback_removed(setup: Setup, i: int, q: Array, support: bool) -> Array:
    """Compute G (F, J, J), the reduction of the feedback per joint torque, at the F frequencies of a cycle's FFT.

    G = (I + L)^-1 L with the loop L of leg, ground (if in ``support``), LEAD, and the delay that ``setup.lead``
    counts beyond one sample. Gravity and gyroscopic terms are neglected: they are small compared with the feedback.
    """
    config = setup.config
    samples, joints = len(setup.plan.support), setup.mechanism.shape[1]
    mass, foot = leg_at(setup, i, q)
    ground, moved = contact(setup, support)
    mass = mass + foot.T @ (moved[:, None] * foot)
    pull = [-np.linalg.solve(mass, foot.T @ (coefficients[:, None] * foot)) for coefficients in ground]
    whole = np.zeros((3 * joints, 3 * joints))
    whole[:joints, joints : 2 * joints] = np.eye(joints)
    whole[joints : 2 * joints] = np.hstack([*pull, np.linalg.inv(mass)])
    step = expm(config.sampling_period * whole)[: 2 * joints]  # torque held over a sample
    # A free foot is a double integrator: on the unit circle itself its response at frequency 0 is infinite.
    z = np.exp(2j * np.pi * np.arange(samples // 2 + 1) / samples + NEAR_CIRCLE)[:, None, None]
    state = np.linalg.solve(z * np.eye(2 * joints) - step[:, : 2 * joints], step[:, 2 * joints :] + 0j * z)
    b0, b1, a1 = discretise(config.controller.lead_omega, config.controller.lead_alpha, config.sampling_period)
    fed_back = foot.T @ np.hstack([gains[:, None] * foot for gains in foot_gains(setup, support, ground)])
    lead = (b0 + b1 / z) / (1.0 + a1 / z) * z ** -max(0, setup.lead - 1)
    loop = lead * (fed_back @ state)
    return np.asarray(np.linalg.solve(np.eye(joints) + loop, loop))


def low_pass(cutoff: float, setup: Setup) -> Array:
    """Compute gains (F, 1, 1) of a Gaussian low-pass at a cycle's FFT frequencies, 1/sqrt(2) at ``cutoff``, Hz."""
    hertz: Any = np.fft.rfftfreq(len(setup.plan.support), setup.config.sampling_period)[:, None, None]
    return np.asarray(0.5 ** (0.5 * (hertz / cutoff) ** 2))


class NormOptimal(Playing):
    """Norm-optimal learning: u += gain (G^T G + r I)^-1 G^T U after each cycle (Amann, Owens & Rogers 1996).

    U is the feedback of the last cycle. The step minimises |U - G du|^2 + r |du|^2, where G models the reduction of
    the feedback by a torque. The model is periodic, treats each leg separately, and is frozen at the mean posture of
    its support and of its transfer. So G is block-circulant, and an FFT over the cycle inverts it; a sample takes the
    correction of the model of its phase. A low-pass of the torque limits the effect of model errors (Bristow,
    Tharayil & Alleyne 2006).
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Weights of the criterion, and the low-pass filter."""

        gain: float = number("", above=0, at_most=2, default=0.7, tuned=(0.1, 1.0))
        """Fraction of the correction that is applied."""
        penalty: float = number("", above=0, at_most=1e6, default=0.1, tuned=(0.003, 1.0))
        """Weight r of a change of the torque relative to the remaining feedback."""
        cutoff: float = number("Hz", above=0, at_most=1e6, default=15.0, tuned=(3.0, 40.0))
        """Frequency at which the gain of a Gaussian low-pass of the torque is 1/sqrt(2)."""

    def reset(self, setup: Setup) -> None:
        """Invert the model; start with zero torque, or with that of an earlier run."""
        self.start(setup)
        samples, legs = setup.plan.support.shape
        joints = setup.mechanism.shape[1]
        self.support = setup.plan.support
        self.inverse = np.zeros((2, samples // 2 + 1, legs, joints, joints), complex)
        for phase, i in np.ndindex(2, legs):
            chosen = self.support[:, i] == phase
            if chosen.any():
                posture = setup.plan.joints.position[chosen, i].mean(axis=0)
                self.inverse[phase, :, i] = self._invert(feedback_removed(setup, i, posture, bool(phase)))
        self.low_pass = low_pass(self.config.cutoff, setup)

    def _invert(self, model: Array) -> Array:
        """Compute gain (G^T G + r I)^-1 G^T, (F, J, J)."""
        adjoint = model.conj().swapaxes(1, 2)
        inverse: Any = np.linalg.solve(adjoint @ model + self.config.penalty * np.eye(model.shape[1]), adjoint)
        return self.config.gain * inverse

    def learn(self, feedback: Array) -> None:
        """Correct the torque by the ``feedback`` (N, L, J), N m, of the cycle, and filter it."""
        spectrum = np.fft.rfft(feedback, axis=0)[None, ..., None]
        change = np.fft.irfft((self.inverse @ spectrum)[..., 0], len(feedback), axis=1)
        wanted = np.fft.rfft(self.torque + np.where(self.support[..., None], change[1], change[0]), axis=0)
        self.torque[:] = np.fft.irfft(self.low_pass * wanted, len(self.torque), axis=0)
