"""Identification of joints from a log: least squares on filtered signals, then by replaying the commands.

One block of joints at a time. The first step has a solution in closed form but is biased by the filter and by noise;
from there the second minimises the distance of the replayed from the measured angles (trust region, within bounds).
A parameter that the log does not excite keeps its prior, has a large standard error, and is refused by name.
"""

import math
from collections.abc import Sequence
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
DELAY_PRIOR = (0.003, 0.01)
"""Mean and standard deviation of the prior of the delay of commands, s."""
MASS_PRIOR = 0.1
"""Standard deviation of the prior of the relative change of the mass of a link."""
MASS_BOUND = 0.5
"""Largest relative reduction of the mass of a link."""
TILT_PRIOR = math.radians(2.0)
"""Standard deviation of the prior of a tilt of the base, rad."""
KNOWN = 0.3
"""Standard error over that of the prior below which a mass or a tilt counts as identified."""
EVALUATIONS = 25
"""Largest number of replays in one optimisation."""


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
class Fit:
    """Fitted parameters of all joints, with their standard errors."""

    level: Level
    values: Array
    """(J, 4 + K), see :class:`cmacexp.addons.gap.replay.JointParams`."""
    deviation: Array
    """(J, 4 + K) standard errors; 0 where a parameter is not fitted."""
    delay: float
    """Delay of the commands of all joints, s."""
    delay_deviation: float
    """Its standard error, s."""
    delay_correlation: Array
    """(J,) correlation of the delay with the rotor inertia of each joint."""
    masses: dict[int, tuple[float, float]]
    """Factors of the masses of links, with standard errors, by the numbers of their joints."""
    covariances: tuple[Array, ...]
    """Covariance matrix of each block: its fitted parameters joint by joint, the delay, its masses."""


@dataclass(frozen=True)
class Problem:
    """A log, the model of its machine, and the equations of motion along the log."""

    signals: Signals
    machine: Machine

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

    def apply(self, fit: Fit) -> "Problem":
        """Return the problem with the masses of a fit, or the problem itself if no masses were fitted."""
        factors = {joint: factor for joint, (factor, _) in fit.masses.items()}
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
            information += rest.T @ rest / measure_variance(left[: len(regressors), -1:])
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


def fit(problem: Problem, level: Level, rows: Mask, start: Array | None = None) -> Fit:
    """Fit a model of joints by replay to the measured angles at ``rows`` (n,), a mask.

    ``start`` (J, 4 + K) are initial parameters; None: those of :func:`regress`. All joints have the same delay: the
    mean over blocks, fitted one by one, weighted by precision. With it the blocks are fitted again.
    """
    values = regress(problem, level, rows) if start is None else start.copy()
    blocks = [_BlockFit(problem, level, number, rows) for number in range(len(problem.machine.blocks))]
    for block in blocks:
        block.solve(values[block.joints], None)
    precision = np.array([1.0 / block.covariance[block.delay, block.delay] for block in blocks])
    delay = float(precision @ [block.x[block.delay] for block in blocks] / precision.sum())
    deviation = np.zeros_like(values)
    correlation = np.zeros(len(values))
    masses = dict[int, tuple[float, float]]()
    for block in blocks:
        if len(blocks) > 1:
            block.solve(block.get_values(block.x), delay)
        error = np.sqrt(np.diag(block.covariance))
        values[block.joints] = block.get_values(block.x)
        deviation[np.ix_(block.joints, level.free)] = error[: block.delay].reshape(len(block.joints), -1)
        inertia = np.arange(len(block.joints)) * int(level.free.sum())
        correlation[block.joints] = block.covariance[inertia, block.delay] / (error[inertia] * error[block.delay])
        masses |= {
            joint: (1.0 + float(block.x[k]), float(error[k])) for k, joint in enumerate(block.masses, block.delay + 1)
        }
    return Fit(
        level=level,
        values=values,
        deviation=deviation,
        delay=delay,
        delay_deviation=float(precision.sum()) ** -0.5,
        delay_correlation=correlation,
        masses=masses,
        covariances=tuple(block.covariance for block in blocks),
    )


class _BlockFit:
    """The fit of one block of B joints, with the numbers ``joints``.

    ``x`` holds the fitted parameters of these joints in turn, the delay, at the index ``delay``, and the relative
    changes of the masses of the links of the joints ``masses``; ``covariance`` is its covariance matrix.
    """

    def __init__(self, problem: Problem, level: Level, number: int, rows: Mask):
        self.problem = problem
        self.level = level
        self.joints = problem.machine.blocks[number]
        end = int(np.flatnonzero(rows)[-1]) + 1
        self.used = np.flatnonzero(rows[:end])
        self.expansion = Expansion(*(values[:end] for values in problem.expansions[number]))
        drive = problem.drive.choose(self.joints)
        self.drive = drive._replace(torque=drive.torque[:end])
        self.measured = problem.signals.log.angle[self.used][:, self.joints]
        self.masses = [joint for joint in self.joints.tolist() if level.masses and joint in problem.masses]
        forces = [-problem.masses[joint][:end, self.joints] for joint in self.masses]
        self.forces = np.moveaxis(np.reshape(forces, (-1, end, len(self.joints))), 0, -1)
        free = np.tile(level.free, len(self.joints))
        self.delay = int(free.sum())
        self.columns = np.flatnonzero(np.append(free, np.ones(1 + len(self.masses), dtype=bool)))
        scale = problem.scale(level)[self.joints].ravel()[free]
        self.scale = np.concatenate([scale, [DELAY_PRIOR[1]], np.full(len(self.masses), MASS_PRIOR)])
        self.mean = np.zeros(len(self.scale))
        self.mean[self.delay] = DELAY_PRIOR[0]
        least = [-4.0 * problem.signals.log.period, *[-MASS_BOUND] * len(self.masses)]
        self.low = np.concatenate([np.tile(level.lowest, len(self.joints)), least])
        self.x, self.covariance = self.mean, np.diag(self.scale**2)
        self._compared: tuple[bytes, Array, Array] | None = None

    def get_values(self, x: Array) -> Array:
        """Return the parameters of the joints (B, 4 + K) in ``x``; 0 where they are not fitted."""
        values = np.zeros((len(self.joints), OWN + self.level.knots))
        values[:, self.level.free] = x[: self.delay].reshape(len(self.joints), -1)
        return values

    def _compare(self, x: Array) -> tuple[Array, Array]:
        """Return replayed less measured angles (rows, B), rad, and the derivatives (rows B, X) over ``x / scale``."""
        if self._compared is None or self._compared[0] != x.tobytes():
            params = JointParams(self.get_values(x), self.problem.ranges[:, self.joints], x[self.delay])
            start = np.array(self.problem.start)[:, self.joints]
            period = self.problem.signals.log.period
            forces = (self.forces, x[self.delay + 1 :])
            replayed = replay(self.expansion, self.drive, params, period, start, *forces, derive=True)
            slopes = replayed.angle_by[self.used][:, :, self.columns].reshape(-1, len(x)) * self.scale
            self._compared = x.tobytes(), replayed.angle[self.used] - self.measured, slopes
        return self._compared[1:]

    def solve(self, values: Array, delay: float | None) -> None:
        """Fit ``x`` and ``covariance``, from the parameters ``values`` (B, 4 + K) on.

        A ``delay``, s, is kept fixed; None: it is fitted too.
        """
        x = self.x.copy()
        x[: self.delay] = values[:, self.level.free].ravel()
        fitted = np.ones(len(x), dtype=bool)
        if delay is not None:
            x[self.delay] = delay
            fitted[self.delay] = False
        x = np.maximum(x, self.low + 1e-6 * self.scale)
        for _ in range(2):  # the weight of the prior follows from the errors that remain
            x = self._improve(x, fitted)
        errors, slopes = self._compare(x)
        information = slopes.T @ slopes / measure_variance(errors) + np.eye(len(x))
        self.x, self.covariance = x, np.linalg.inv(information) * np.outer(self.scale, self.scale)

    def _improve(self, first: Array, fitted: Mask) -> Array:
        """Return ``first`` with the parameters ``fitted`` (a mask) optimised; errors at ``first`` weigh the prior."""
        from scipy.optimize import least_squares

        noise = measure_variance(self._compare(first)[0]) ** 0.5
        scale = self.scale[fitted]

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
    """Return the variance of ``errors`` (n, B) times the number of rows that carry the information of one.

    That number is the integral of their autocorrelation, 1 for independent rows.
    """
    centred = errors - errors.mean(axis=0)
    size = 2 ** math.ceil(math.log2(2 * len(errors)))
    power = np.abs(np.fft.rfft(centred, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[: len(errors) // 4].sum(axis=1)
    correlation /= correlation[0] or 1.0
    end = int(np.append(correlation < 0.05, True).argmax())
    correlated = max(1.0, 2.0 * float(correlation[:end].sum()) - 1.0)
    return float(max((errors**2).mean(), 1e-18)) * correlated
