"""A log with the model of its machine: equations along the log, models of joints, and their regression."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.replay import DriveTerms, Expansion, JointParams, make_drive, replay
from cmacexp.addons.gap.signals import Signals, low_pass
from cmacexp.models.joint import OWN, SLOW, make_regressors
from cmacexp.typing import Array, Counts, Mask

KNOTS = 5
"""Number of knots of Coulomb friction over the angle."""
NAMES = ("rotor_inertia", "viscous_friction", "offset", "spring")
"""Names of the parameters of a joint before its Coulomb friction."""
SIGNED = slice(2, OWN)
"""Offset and spring: they may be negative, and their sign is that of torques that help the drives."""
PRIOR = (1.0, 1.0, 0.3, 0.3, 1.0)
"""Standard deviations of the zero-mean prior in the scales of a joint: it matters for unexcited parameters only."""
OBSERVER = 2.0 * math.pi
"""Natural frequency of the observer that keeps a replay of measured torques at the measured angles, rad/s."""
MASS_PRIOR = 0.1
"""Standard deviation of the prior of the relative change of the mass of a link."""
TILT_PRIOR = math.radians(2.0)
"""Standard deviation of the prior of a tilt of the base, rad."""
KNOWN = 0.3
"""Standard error over that of the prior below which a mass or a tilt counts as identified."""


@dataclass(frozen=True)
class Level:
    """A model of joints: the parameters that are fitted."""

    name: str
    named: int
    """Number of parameters of NAMES that are fitted."""
    knots: int
    """Knots of Coulomb friction over the angle; 1: constant friction."""
    masses: bool = False
    """True: the masses of links that the log excites are fitted too."""

    @property
    def free(self) -> Mask:
        """Mask (4 + K,) of the fitted parameters of a joint, see :class:`cmacexp.addons.gap.replay.JointParams`."""
        return np.append(np.arange(OWN) < self.named, np.ones(self.knots, dtype=bool))

    @property
    def lowest(self) -> Array:
        """Lower bounds of the fitted parameters."""
        bounds = np.zeros(OWN + self.knots)
        bounds[SIGNED] = -np.inf
        return bounds[self.free]


LEVELS = (
    Level("rotor inertia, viscous and Coulomb friction", 2, 1),
    Level("and an offset", 3, 1),
    Level("and friction over the angle", 3, KNOTS),
    Level("and a spring over the angle", OWN, KNOTS),
    Level("and masses of links", OWN, KNOTS, masses=True),
)
"""Models of joints; each one adds parameters to the one before."""


@dataclass(frozen=True)
class Problem:
    """A log, the model of its machine, and the equations of motion along the log."""

    signals: Signals
    machine: Machine
    command_delay: float | None = None
    """Delay of the commands beside measured torques, s; None: it is fitted."""

    def expand(self, angle: Array, velocity: Array) -> list[Expansion]:
        """Expand the equations of motion of each block along a motion (n, J) of all joints, rad and rad/s."""
        base = self.signals.log.orientation
        return [self.machine.expand(block, angle, velocity, base) for block in self.machine.blocks]

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Measured angles, rad, and their velocities, rad/s, and accelerations, rad/s^2, (n, J) each."""
        return self.signals.log.angle, self.signals.velocity, self.signals.acceleration

    @cached_property
    def expansions(self) -> list[Expansion]:
        """Equations of motion of each block, expanded along the measured motion."""
        return self.expand(self.signals.log.angle, self.signals.velocity)

    @cached_property
    def ranges(self) -> Array:
        """Least and largest measured angles (2, J), rad: the ranges over which friction and springs are defined.

        The range of a joint that does not move is widened to 1 mrad.
        """
        angle = self.signals.log.angle
        low, high = angle.min(axis=0), angle.max(axis=0)
        return np.stack([low, np.maximum(high, low + 1e-3)])

    @cached_property
    def rigid(self) -> Array:
        """Torque of the rigid bodies along the measured motion (n, J), N m."""
        return self.machine.compute_torque(*self.motion, self.signals.log.orientation)

    @cached_property
    def scales(self) -> Array:
        """RMS torque, acceleration and velocity of each joint (J, 3): they scale its parameters."""
        signals = (self.signals.torque, self.signals.acceleration, self.signals.velocity)
        return np.maximum(np.stack([np.sqrt((signal**2).mean(axis=0)) for signal in signals], axis=1), 1e-9)

    def scale(self, level: Level) -> Array:
        """Return the standard deviations of the prior of each parameter (J, 4 + K) of a model of joints."""
        torque, acceleration, velocity = self.scales.T
        rows = [torque / acceleration, torque / velocity, torque, torque, *[torque] * level.knots]
        return np.stack(rows, axis=1) * np.array([*PRIOR[:OWN], *[PRIOR[OWN]] * level.knots])

    def make_regressors(self, knots: int, motion: tuple[Array, Array, Array] | None = None) -> Array:
        """Return the torque (n, J, 4 + K) per unit of each parameter along a motion, by default the measured one."""
        regressors = make_regressors(motion or self.motion, self.ranges, knots, SLOW * self.scales[:, 2])
        regressors[..., SIGNED] *= -1.0
        return regressors

    def compute_joint_torque(self, values: Array, motion: tuple[Array, Array, Array] | None = None) -> Array:
        """Compute the torque (n, J) of joints with parameters ``values`` (J, 4 + K), N m; motion as above."""
        return np.einsum("kjp,jp->kj", self.make_regressors(values.shape[1] - OWN, motion), values)

    @cached_property
    def drive(self) -> DriveTerms:
        """Drives of all joints as logged; the log must have commands."""
        log = self.signals.log
        assert log.command is not None
        return make_drive(log.command, log.command_velocity, log.feedforward, log.kp, log.kd)

    @cached_property
    def excitation(self) -> tuple[list[Expansion], DriveTerms]:
        """Equations of each block, and drives, of the replay that is fitted.

        Without measured torques they are those of the commands. Measured torques need neither commands nor gains: a
        critically damped observer, whose forces vanish where the replay follows the measured angles, stands in the
        equations, since an open loop would drift. Its angles and velocities are those in the middle of each row.
        """
        if not self.signals.is_measured:
            return self.expansions, self.drive
        log = self.signals.log
        steps = np.diff(log.angle, axis=0, append=log.angle[-1:])
        inertia = regress(self, LEVELS[0], np.ones(len(log.time), dtype=bool))[:, 0]
        for block, expansion in zip(self.machine.blocks, self.expansions, strict=True):
            inertia[block] += np.diagonal(expansion.mass, axis1=1, axis2=2).mean(axis=0)
        stiffness = OBSERVER**2 * inertia
        for block, expansion in zip(self.machine.blocks, self.expansions, strict=True):
            stiffness[block] += np.abs(expansion.gradient).sum(axis=2).max(axis=0)
        damping = 2.0 * np.sqrt(stiffness * inertia)
        force = 0.5 * stiffness * steps + damping * steps / log.period
        equations = [
            expansion._replace(
                bias=expansion.bias - force[:, block], gradient=expansion.gradient + np.diag(stiffness[block])
            )
            for block, expansion in zip(self.machine.blocks, self.expansions, strict=True)
        ]
        return equations, DriveTerms(self.signals.torque, np.zeros_like(damping), damping)

    @property
    def start(self) -> tuple[Array, Array]:
        """Angles, rad, and velocities, rad/s, in the first row, (J,) each."""
        return self.signals.log.angle[0], self.signals.velocity[0]

    def replay(
        self,
        values: Array,
        delay: float,
        expansions: Sequence[Expansion] | None = None,
        drive: DriveTerms | None = None,
        start: tuple[Array, Array] | None = None,
    ) -> tuple[Array, Array]:
        """Replay joints with parameters ``values`` (J, 4 + K) and return angles, rad, and velocities, rad/s, (n, J).

        ``delay`` is that of the commands, s. ``expansions`` are the equations of each block, by default along the
        measured motion; ``drive`` and ``start`` are by default as logged.
        """
        drive = drive or self.drive
        state = np.array(start or self.start)
        motion = np.empty((2, *drive.torque.shape))
        for block, expansion in zip(self.machine.blocks, expansions or self.expansions, strict=True):
            params = JointParams(values[block], self.ranges[:, block], delay)
            replayed = replay(expansion, drive.choose(block), params, self.signals.log.period, state[:, block])
            motion[:, :, block] = replayed[:2]
        return motion[0], motion[1]

    def follow(self, values: Array, delay: float) -> Array:
        """Return angles (n, J), rad, of joints with parameters ``values`` under what the fit replays.

        With measured torques the observer keeps them near the measured angles.
        """
        return self.replay(values, delay, *self.excitation)[0]

    def apply(self, masses: Mapping[int, tuple[float, float]]) -> "Problem":
        """Return the problem with fitted factors of masses of links, or the problem itself if there are none."""
        factors = {joint: factor for joint, (factor, _) in masses.items()}
        return replace(self, machine=self.machine.scale_masses(factors)) if factors else self

    @cached_property
    def masses(self) -> dict[int, Array]:
        """Torque (n, J) of the mass of each link that this log identifies, N m, by the number of its joint."""
        identified = dict[int, Array]()
        for block in self.machine.blocks:
            doubled = [replace(self, machine=self.machine.scale_masses({joint: 2.0})) for joint in block.tolist()]
            torques = [problem.rigid - self.rigid for problem in doubled]
            links = zip(block.tolist(), torques, self._find_errors(block, torques, MASS_PRIOR), strict=True)
            identified |= {joint: torque for joint, torque, error in links if error < KNOWN * MASS_PRIOR}
        return identified

    @cached_property
    def tilt_error(self) -> float:
        """Standard error of a tilt of the base, estimated with all other parameters, rad; at most TILT_PRIOR."""
        turned = [replace(self, machine=self.machine.turn_base(*tilt)) for tilt in ((1e-3, 0.0), (0.0, 1e-3))]
        columns = [1e3 * (problem.rigid - self.rigid) for problem in turned]
        return float(self._find_errors(np.arange(len(self.machine.joints)), columns, TILT_PRIOR).max())

    def _find_errors(self, block: Counts, columns: Sequence[Array], prior: float) -> Array:
        """Return the standard errors of parameters that the joints of a block share, beside the parameters of each.

        ``columns`` are the torques (n, J) for one unit of each shared parameter, N m, and ``prior`` is the standard
        deviation of its prior.
        """
        level = LEVELS[-1]
        period = self.signals.log.period
        regressors = low_pass(self.make_regressors(level.knots), period)
        shared = low_pass(np.stack([*columns, self.signals.torque - self.rigid], axis=-1), period)
        information = np.eye(len(columns)) / prior**2
        for j in block:
            weighted = np.concatenate([regressors[:, j], 0.1 * np.diag(1.0 / self.scale(level)[j])])
            padded = np.concatenate([shared[:, j], np.zeros((regressors.shape[2], shared.shape[2]))])
            left = padded - weighted @ np.linalg.lstsq(weighted, padded, rcond=None)[0]
            rest = left[:, :-1]
            information += rest.T @ rest / measure_variance(left[: len(regressors), -1:])[0]
        return np.sqrt(np.diag(np.linalg.inv(information)))


def regress(problem: Problem, level: Level, rows: Mask) -> Array:
    """Estimate the parameters (J, 4 + K) by bounded least squares on filtered signals at ``rows`` (n,), a mask.

    A weak prior makes parameters unique that the log does not excite.
    """
    from scipy.optimize import lsq_linear

    period = problem.signals.log.period
    scale = problem.scale(level)
    free = level.free
    columns = low_pass(problem.make_regressors(level.knots), period)[rows][..., free]
    torque = low_pass(problem.signals.torque - problem.rigid, period)[rows]
    values = np.zeros(scale.shape)
    for j in range(len(values)):
        a = np.concatenate([columns[:, j], np.diag(0.1 / scale[j, free])])
        b = np.concatenate([torque[:, j], np.zeros(free.sum())])
        values[j, free] = lsq_linear(a, b, (level.lowest, np.inf)).x
    return values


def measure_variance(errors: Array) -> Array:
    """Return the variance of ``errors`` (n, B), (B,), times the number of rows that carry the information of one.

    That number is the integral of their autocorrelation, 1 for independent rows.
    """
    centred = errors - errors.mean(axis=0)
    size = 2 ** math.ceil(math.log2(2 * len(errors)))
    power = np.abs(np.fft.rfft(centred, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[: len(errors) // 4]
    correlation /= np.where(correlation[0] > 0.0, correlation[0], 1.0)
    ended = np.logical_or.accumulate(correlation < 0.05, axis=0)
    correlated = np.maximum(1.0, 2.0 * np.where(ended, 0.0, correlation).sum(axis=0) - 1.0)
    return np.maximum((errors**2).mean(axis=0), 1e-18) * correlated
