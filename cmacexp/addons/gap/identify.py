"""Identification of joints from a log: least squares on filtered signals, then by replaying the commands.

One block of joints at a time. The first step has a solution in closed form but is biased by the filter and by noise;
from there the second minimises the distance of the replayed from the measured angles (trust region, within bounds).
What a log does not excite has a prior and a large standard error, and is refused by name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cmacexp.addons.gap.machine import Expansion, Machine
from cmacexp.addons.gap.replay import Drive, JointParams, make_drive, replay
from cmacexp.addons.gap.signals import Signals, low_pass
from cmacexp.models.joint import OWN, SLOW, make_regressors
from cmacexp.typing import Array, Counts, Mask

KNOTS = 5
"""Knots of friction over the angle."""
NAMES = ("rotor_inertia", "viscous_friction", "offset", "spring")
"""Names of the parameters of a joint before its Coulomb friction."""
SIGNED = slice(2, OWN)
"""Those that may be negative: torques that help the drives."""
PRIOR = (1.0, 1.0, 0.3, 0.3, 1.0)
"""Standard deviations of the prior around zero, in the scales of a joint: they matter where a log says nothing."""
DELAY_PRIOR = (0.003, 0.01)
"""Mean and standard deviation of the prior of the delay, s."""
MASS_PRIOR, MASS_BOUND, TILT_PRIOR = 0.1, 0.5, math.radians(2.0)
"""Standard deviations of the factor of the mass of a link and of a tilt of the base, rad; most change of a mass."""
KNOWN = 0.3
"""Standard error over that of the prior up to which a log identifies a mass or a tilt."""
EVALUATIONS = 25
"""Most replays of a fit."""


@dataclass(frozen=True)
class Level:
    """How much a model of joints contains."""

    name: str
    own: int
    """How many of NAMES."""
    knots: int
    """1: one Coulomb friction; more: Coulomb friction over the angle."""
    masses: bool = False
    """Whether masses are identified, of the links whose mass the log excites."""

    @property
    def free(self) -> Mask:
        """(4 + K,) the parameters that are fitted, see :class:`cmacexp.addons.gap.replay.JointParams`."""
        return np.append(np.arange(OWN) < self.own, np.ones(self.knots, dtype=bool))

    @property
    def lowest(self) -> Array:
        """The bounds of these."""
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
"""Models of joints, each with all that those before it have."""


@dataclass(frozen=True)
class Fit:
    """Parameters of all joints, with what is known of their errors."""

    level: Level
    values: Array
    """(J, 4 + K), see :class:`cmacexp.addons.gap.replay.JointParams`."""
    deviation: Array
    """(J, 4 + K) standard errors; 0 where a parameter is not fitted."""
    delay: float
    """s"""
    delay_deviation: float
    delay_correlation: Array
    """(J,) of the delay with the rotor inertia of each joint."""
    masses: dict[int, tuple[float, float]]
    """Factors of the masses of links, by their joints, with standard errors."""
    covariances: tuple[Array, ...]
    """Covariance of each block: its free parameters joint by joint, the delay, its masses."""


@dataclass(frozen=True)
class Problem:
    """A log, a machine, and its equations along the measured motion."""

    signals: Signals
    machine: Machine

    def expand(self, angle: Array, velocity: Array) -> list[Expansion]:
        """The equations of each block along a motion (n, J) of all joints."""
        orientation = self.signals.log.orientation
        return [self.machine.expand(block, angle, velocity, orientation) for block in self.machine.blocks]

    @cached_property
    def expansions(self) -> list[Expansion]:
        """Those along the measured motion."""
        return self.expand(self.signals.log.angle, self.signals.velocity)

    @cached_property
    def ranges(self) -> Array:
        """(2, J) least and largest angles of the log, over which friction and springs are given, rad.

        That of a joint that does not move is a little larger.
        """
        low, high = self.signals.log.angle.min(axis=0), self.signals.log.angle.max(axis=0)
        return np.stack([low, np.maximum(high, low + 1e-3)])

    @cached_property
    def rigid(self) -> Array:
        """(n, J) torque of the rigid bodies along the measured motion, N m."""
        own = self.signals
        return self.machine.compute_torque(own.log.angle, own.velocity, own.acceleration, own.log.orientation)

    @cached_property
    def scales(self) -> Array:
        """(J, 3) RMS torque, acceleration and velocity: the scales of the parameters of each joint."""
        signals = (self.signals.torque, self.signals.acceleration, self.signals.velocity)
        return np.maximum(np.stack([np.sqrt((each**2).mean(axis=0)) for each in signals], axis=1), 1e-9)

    def scale(self, level: Level) -> Array:
        """(J, 4 + K) standard deviations of the prior of each parameter."""
        torque, acceleration, velocity = self.scales.T
        rows = [torque / acceleration, torque / velocity, torque, torque, *[torque] * level.knots]
        return np.stack(rows, axis=1) * np.array([*PRIOR[:OWN], *[PRIOR[OWN]] * level.knots])

    def make_regressors(self, knots: int, motion: tuple[Array, Array, Array] | None = None) -> Array:
        """(n, J, 4 + K): torque for each unit of the parameters along a motion, or along the measured one, N m."""
        own = self.signals
        motion = motion or (own.log.angle, own.velocity, own.acceleration)
        found = make_regressors(motion, self.ranges, knots, SLOW * self.scales[:, 2])
        found[..., SIGNED] *= -1.0
        return found

    def compute_joint_torque(self, values: Array, motion: tuple[Array, Array, Array] | None = None) -> Array:
        """(n, J) torque of joints with ``values`` (J, 4 + K) along a motion, or along the measured one, N m."""
        return np.einsum("kjp,jp->kj", self.make_regressors(values.shape[1] - OWN, motion), values)

    @cached_property
    def drive(self) -> Drive:
        """The drives of all joints in the log."""
        log = self.signals.log
        assert log.command is not None
        return make_drive(log.command, log.command_velocity, log.feedforward, log.kp, log.kd)

    @property
    def start(self) -> tuple[Array, Array]:
        """Angles and velocities in the first row."""
        return self.signals.log.angle[0], self.signals.velocity[0]

    def replay(
        self,
        values: Array,
        delay: float,
        expansions: Sequence[Expansion] | None = None,
        drive: Drive | None = None,
        start: tuple[Array, Array] | None = None,
    ) -> tuple[Array, Array]:
        """Angles and velocities (n, J) of joints with ``values`` (J, 4 + K) under their drives, by default as logged.

        ``expansions`` are by default those along the measured motion.
        """
        drive, first = drive or self.drive, np.array(start or self.start)
        angle, velocity = np.empty_like(drive.torque), np.empty_like(drive.torque)
        for block, expansion in zip(self.machine.blocks, expansions or self.expansions, strict=True):
            own = Drive(*(each[..., block] for each in drive))
            params = JointParams(values[block], self.ranges[:, block], delay)
            found = replay(expansion, own, params, self.signals.log.period, first[:, block])
            angle[:, block], velocity[:, block] = found.angle, found.velocity
        return angle, velocity

    def apply(self, fit: Fit) -> "Problem":
        """The problem with the masses of a fit; itself if it has none."""
        factors = {joint: factor for joint, (factor, _) in fit.masses.items()}
        return replace(self, machine=self.machine.scale_masses(factors)) if factors else self

    @cached_property
    def masses(self) -> dict[int, Array]:
        """(n, J) torque of the whole mass of links that this log identifies, by their joints, N m."""
        known = dict[int, Array]()
        for block in self.machine.blocks:
            doubled = [replace(self, machine=self.machine.scale_masses({joint: 2.0})) for joint in block.tolist()]
            own = [other.rigid - self.rigid for other in doubled]
            found = zip(block.tolist(), own, self._find_errors(block, own, MASS_PRIOR), strict=True)
            known |= {joint: torque for joint, torque, error in found if error < KNOWN * MASS_PRIOR}
        return known

    @cached_property
    def tilt_error(self) -> float:
        """Standard error of the tilt of the base beside all other parameters, rad; that of the prior: unknown."""
        turned = [replace(self, machine=self.machine.turn_base(*own)) for own in ((1e-3, 0.0), (0.0, 1e-3))]
        columns = [1e3 * (other.rigid - self.rigid) for other in turned]
        return float(self._find_errors(np.arange(len(self.machine.joints)), columns, TILT_PRIOR).max())

    def _find_errors(self, block: Counts, columns: Sequence[Array], prior: float) -> Array:
        """Standard errors of parameters that the joints of a block share beside those of each of them.

        Their torque for one unit is (n, J), in ``columns``.
        """
        level, period = LEVELS[-1], self.signals.log.period
        own = low_pass(self.make_regressors(level.knots), period)
        shared = low_pass(np.stack([*columns, self.signals.torque - self.rigid], axis=-1), period)
        information = np.eye(len(columns)) / prior**2
        for j in block:
            weighted = np.concatenate([own[:, j], 0.1 * np.diag(1.0 / self.scale(level)[j])])
            padded = np.concatenate([shared[:, j], np.zeros((own.shape[2], shared.shape[2]))])
            left = padded - weighted @ np.linalg.lstsq(weighted, padded, rcond=None)[0]
            rest = left[:, :-1]
            information += rest.T @ rest / measure_variance(left[: len(own), -1:])
        return np.sqrt(np.diag(np.linalg.inv(information)))


def regress(problem: Problem, level: Level, rows: Mask) -> Array:
    """(J, 4 + K) by least squares on filtered signals at ``rows``, within the bounds; priors keep it defined."""
    from scipy.optimize import lsq_linear

    period, scale, free = problem.signals.log.period, problem.scale(level), level.free
    columns = low_pass(problem.make_regressors(level.knots), period)[rows][..., free]
    torque = low_pass(problem.signals.torque - problem.rigid, period)[rows]
    values = np.zeros(scale.shape)
    for j in range(len(values)):
        a = np.concatenate([columns[:, j], np.diag(0.1 / scale[j, free])])
        b = np.concatenate([torque[:, j], np.zeros(free.sum())])
        values[j, free] = lsq_linear(a, b, (level.lowest, np.inf)).x
    return values


def fit(problem: Problem, level: Level, rows: Mask, start: Array | None = None) -> Fit:
    """Fit by replay to the measured angles at ``rows`` (n,).

    ``start`` (J, 4 + K) is where to begin; None: what :func:`regress` gives. The delay is one of all joints: that of
    each block by itself, weighted by its precision, with which the blocks are fitted again.
    """
    values = regress(problem, level, rows) if start is None else start.copy()
    blocks = [_BlockFit(problem, level, number, rows) for number in range(len(problem.machine.blocks))]
    for own in blocks:
        own.solve(values[own.block], None)
    precision = np.array([1.0 / own.covariance[own.own, own.own] for own in blocks])
    delay = float(precision @ [own.x[own.own] for own in blocks] / precision.sum())
    deviation, correlation, masses = np.zeros_like(values), np.zeros(len(values)), dict[int, tuple[float, float]]()
    for own in blocks:
        if len(blocks) > 1:
            own.solve(own.get_values(own.x), delay)
        error = np.sqrt(np.diag(own.covariance))
        values[own.block] = own.get_values(own.x)
        deviation[np.ix_(own.block, level.free)] = error[: own.own].reshape(len(own.block), -1)
        inertia = np.arange(len(own.block)) * int(level.free.sum())
        correlation[own.block] = own.covariance[inertia, own.own] / (error[inertia] * error[own.own])
        masses |= {joint: (1.0 + float(own.x[k]), float(error[k])) for k, joint in enumerate(own.masses, own.own + 1)}
    return Fit(
        level=level,
        values=values,
        deviation=deviation,
        delay=delay,
        delay_deviation=float(precision.sum()) ** -0.5,
        delay_correlation=correlation,
        masses=masses,
        covariances=tuple(own.covariance for own in blocks),
    )


class _BlockFit:
    """The fit of one block: x holds the free parameters of its joints in turn, the delay, and changes of masses."""

    def __init__(self, problem: Problem, level: Level, number: int, rows: Mask):
        self.problem, self.level, self.block = problem, level, problem.machine.blocks[number]
        end = int(np.flatnonzero(rows)[-1]) + 1
        self.used = np.flatnonzero(rows[:end])
        self.expansion = Expansion(*(each[:end] for each in problem.expansions[number]))
        drive = Drive(*(each[..., self.block] for each in problem.drive))
        self.drive = drive._replace(torque=drive.torque[:end])
        self.measured = problem.signals.log.angle[self.used][:, self.block]
        self.masses = [joint for joint in self.block.tolist() if level.masses and joint in problem.masses]
        forces = [-problem.masses[joint][:end, self.block] for joint in self.masses]
        self.forces = np.moveaxis(np.reshape(forces, (-1, end, len(self.block))), 0, -1)
        free, others = np.tile(level.free, len(self.block)), np.ones(1 + len(self.masses), dtype=bool)
        self.own, self.columns = int(free.sum()), np.flatnonzero(np.append(free, others))
        scale, delays = problem.scale(level)[self.block].ravel()[free], DELAY_PRIOR[1]
        self.scale = np.concatenate([scale, [delays], np.full(len(self.masses), MASS_PRIOR)])
        self.mean = np.zeros(len(self.scale))
        self.mean[self.own] = DELAY_PRIOR[0]
        least = [-4.0 * problem.signals.log.period, *[-MASS_BOUND] * len(self.masses)]
        self.low = np.concatenate([np.tile(level.lowest, len(self.block)), least])
        self.x, self.covariance = self.mean, np.diag(self.scale**2)
        self._compared: tuple[bytes, Array, Array] | None = None

    def get_values(self, x: Array) -> Array:
        """(B, 4 + K)"""
        values = np.zeros((len(self.block), OWN + self.level.knots))
        values[:, self.level.free] = x[: self.own].reshape(len(self.block), -1)
        return values

    def _compare(self, x: Array) -> tuple[Array, Array]:
        """Replayed less measured angles (rows, B), rad; their slopes (rows B, parameters) in units of the scales."""
        if self._compared is None or self._compared[0] != x.tobytes():
            params = JointParams(self.get_values(x), self.problem.ranges[:, self.block], x[self.own])
            start, period = np.array(self.problem.start)[:, self.block], self.problem.signals.log.period
            weights = x[self.own + 1 :]
            found = replay(self.expansion, self.drive, params, period, start, self.forces, weights, derive=True)
            slopes = found.angle_by[self.used][:, :, self.columns].reshape(-1, len(x)) * self.scale
            self._compared = x.tobytes(), found.angle[self.used] - self.measured, slopes
        return self._compared[1:]

    def solve(self, values: Array, delay: float | None) -> None:
        """Fit from ``values`` (B, 4 + K) on; ``delay`` fixes the delay."""
        x, fitted = self.x.copy(), np.ones(len(self.x), dtype=bool)
        x[: self.own] = values[:, self.level.free].ravel()
        if delay is not None:
            x[self.own], fitted[self.own] = delay, False
        x = np.maximum(x, self.low + 1e-6 * self.scale)
        for _ in range(2):  # the weight of the prior follows from the errors that remain
            x = self._improve(x, fitted)
        errors, slopes = self._compare(x)
        information = slopes.T @ slopes / measure_variance(errors) + np.eye(len(x))
        self.x, self.covariance = x, np.linalg.inv(information) * np.outer(self.scale, self.scale)

    def _improve(self, first: Array, fitted: Mask) -> Array:
        """Fit the parameters that are ``fitted`` with the weights that follow from the errors at ``first``."""
        from scipy.optimize import least_squares

        noise, scale = measure_variance(self._compare(first)[0]) ** 0.5, self.scale[fitted]

        def complete(y: Array) -> Array:
            x = first.copy()
            x[fitted] = y * scale
            return x

        def weigh(y: Array) -> Array:
            errors, _ = self._compare(complete(y))
            return np.concatenate([errors.ravel() / noise, y - self.mean[fitted] / scale])

        def slope(y: Array) -> Array:
            return np.concatenate([self._compare(complete(y))[1][:, fitted] / noise, np.eye(len(y))])

        bounds = (self.low[fitted] / scale, np.inf)
        return complete(
            least_squares(weigh, first[fitted] / scale, slope, bounds, max_nfev=EVALUATIONS, ftol=1e-4, xtol=1e-6).x
        )


def measure_variance(errors: Array) -> float:
    """Variance of ``errors`` (n, B) times the number of rows that say as much as one independent row.

    That number is the integral of their correlation.
    """
    centred = errors - errors.mean(axis=0)
    size = 2 ** math.ceil(math.log2(2 * len(errors)))
    power = np.abs(np.fft.rfft(centred, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[: len(errors) // 4].sum(axis=1)
    correlation /= correlation[0] or 1.0
    end = int(np.append(correlation < 0.05, True).argmax())
    correlated = max(1.0, 2.0 * float(correlation[:end].sum()) - 1.0)
    return float(max((errors**2).mean(), 1e-18)) * correlated
