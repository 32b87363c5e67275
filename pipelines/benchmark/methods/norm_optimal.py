"""Norm-optimal iterative learning control, with the nominal closed loop as its model.

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
"""Logarithm of the radius at which responses are computed."""


def leg_at(setup: Setup, i: int, q: Array) -> tuple[Array, Array]:
    """Inertia (J, J), kg m^2, and Jacobian (J, J), m/rad, of leg ``i`` at ``q`` (J,), rad, with the body held."""
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
    symmetric = [[0, 1], [1, 2]]  # places of M in its three different entries
    return np.array(inertia(leg, trig))[symmetric], np.reshape(jacobian(leg, trig), (2, 2))


def contact(setup: Setup, support: bool) -> tuple[Array, Array]:
    """Stiffness (N/m) and damping (N s/m) of what holds a foot, (2, J), and mass that moves with it (J,), kg.

    On a stand the assumed ground holds a supporting foot along y. Under a body the feet carry a weight, whatever a
    leg does: it lifts the hip instead, and moves its share of the body where that has inertia, as a robot's.
    """
    mechanism = setup.mechanism
    ground, moved = np.zeros((2, mechanism.shape[1])), np.zeros(mechanism.shape[1])
    if support and not has_body(mechanism):
        ground[:, 1] = setup.config.assumed_stiffness, setup.config.terrain.damping
    elif support and isinstance(setup.config.machine, RobotMachine):
        moved[:] = mechanism.weight / GRAVITY / len(mechanism.legs)
    return ground, moved


def foot_gains(setup: Setup, support: bool, ground: Array) -> Array:
    """Force of the feedback for an error of the foot, N/m, and for one of its velocity, N s/m: (2, J).

    In support the force control feeds the force of the ``ground`` (2, J) back as well, and posture control acts on
    the height of the hip.
    """
    config, own = setup.config, setup.config.force_control
    both = np.array(config.gains or (0.0, 0.0))
    gains = np.repeat(both[:, None], setup.mechanism.shape[1], axis=1)
    if support:
        method, pressed = METHODS[own.method], ground[:, 1]
        posture = np.array([config.posture.gain, config.posture.rate_gain]) if has_body(setup.mechanism) else 0.0
        uses = np.array([method != DAMPING, method != STIFFNESS])
        along_y = uses * both * (1.0 + posture) + (uses * both) @ (own.elasticity, own.admittance) * pressed
        gains[:, 1] = own.force_gain * pressed if method == EXPLICIT else along_y
    return gains


def feedback_removed(setup: Setup, i: int, q: Array, support: bool) -> Array:
    """G (F, J, J): what a torque of the joints takes off the feedback, at the F frequencies of a real FFT of a cycle.

    G = (I + L)^-1 L with the loop L of leg, ground where the foot is in support, LEAD, and all the delay beyond one
    sample that ``setup.lead`` counts. Gravity and gyroscopic terms are left out, they are small against the feedback.
    """
    config, (samples, joints) = setup.config, (len(setup.plan.support), setup.mechanism.shape[1])
    mass, foot = leg_at(setup, i, q)
    ground, moved = contact(setup, support)
    mass = mass + foot.T @ (moved[:, None] * foot)
    pull = [-np.linalg.solve(mass, foot.T @ (each[:, None] * foot)) for each in ground]
    whole = np.zeros((3 * joints, 3 * joints))
    whole[:joints, joints : 2 * joints] = np.eye(joints)
    whole[joints : 2 * joints] = np.hstack([*pull, np.linalg.inv(mass)])
    step = expm(config.sampling_period * whole)[: 2 * joints]  # torque held over a sample
    # A free foot integrates twice: on the unit circle itself its response at frequency 0 is infinite.
    z = np.exp(2j * np.pi * np.arange(samples // 2 + 1) / samples + NEAR_CIRCLE)[:, None, None]
    state = np.linalg.solve(z * np.eye(2 * joints) - step[:, : 2 * joints], step[:, 2 * joints :] + 0j * z)
    b0, b1, a1 = discretise(config.controller.lead_omega, config.controller.lead_alpha, config.sampling_period)
    fed_back = foot.T @ np.hstack([each[:, None] * foot for each in foot_gains(setup, support, ground)])
    lead = (b0 + b1 / z) / (1.0 + a1 / z) * z ** -max(0, setup.lead - 1)
    loop = lead * (fed_back @ state)
    return np.asarray(np.linalg.solve(np.eye(joints) + loop, loop))


def low_pass(cutoff: float, setup: Setup) -> Array:
    """Gains (F, 1, 1) of a Gaussian low-pass at the frequencies of an FFT of a cycle, 1/sqrt(2) at ``cutoff`` Hz."""
    hertz: Any = np.fft.rfftfreq(len(setup.plan.support), setup.config.sampling_period)[:, None, None]
    return np.asarray(0.5 ** (0.5 * (hertz / cutoff) ** 2))


class NormOptimal(Playing):
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
        for phase, i in np.ndindex(2, legs):
            chosen = self.support[:, i] == phase
            if chosen.any():
                model = feedback_removed(setup, i, angles[chosen, i].mean(axis=0), bool(phase))
                self.inverse[phase, :, i] = self._invert(model)
        self.low_pass = low_pass(self.config.cutoff, setup)

    def _invert(self, model: Array) -> Array:
        """(F, J, J): gain (G^T G + r I)^-1 G^T."""
        adjoint = model.conj().swapaxes(1, 2)
        inverse: Any = np.linalg.solve(adjoint @ model + self.config.penalty * np.eye(model.shape[1]), adjoint)
        return self.config.gain * inverse

    def learn(self, feedback: Array) -> None:
        """Correct the torque by the ``feedback`` (N, L, J), N m, and filter it."""
        spectrum = np.fft.rfft(feedback, axis=0)[None, ..., None]
        change = np.fft.irfft((self.inverse @ spectrum)[..., 0], len(feedback), axis=1)
        wanted = np.fft.rfft(self.torque + np.where(self.support[..., None], change[1], change[0]), axis=0)
        self.torque[:] = np.fft.irfft(self.low_pass * wanted, len(self.torque), axis=0)
