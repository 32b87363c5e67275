"""Identification of joints from a log: least squares on filtered signals, then by replaying the commands.

One block of joints at a time. The first step has a solution in closed form but is biased by the filter and by noise;
from there the second minimises the distance of the replayed from the measured angles (trust region, within bounds).
What a log does not excite has a prior and a large standard error, and is refused by name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cmacexp.gap.machine import Expansion, Machine
from cmacexp.gap.replay import OWN, Drive, JointParams, Replay
from cmacexp.gap.replay import replay as replay_block
from cmacexp.gap.signals import Signals, low_pass
from cmacexp.typing import Array, Counts, Mask

KNOTS = 5
"""Of friction over the angle."""
NAMES = ("rotor_inertia", "viscous_friction", "offset", "spring")
"""Of the parameters of a joint before its Coulomb friction."""
SIGNED = (2, 3)
"""Those that may be negative."""
SLOW = 0.05
"""Velocity over its RMS below which the regression takes dry friction as proportional to it."""
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
    knots: int
    """1: one Coulomb friction; more: Coulomb friction over the angle."""
    offset: bool = False
    spring: bool = False
    masses: bool = False
    """Of the links whose mass the log excites."""

    @property
    def free(self) -> Mask:
        """(4 + K,) the parameters that are fitted, see :class:`cmacexp.gap.replay.JointParams`."""
        return np.array([True, True, self.offset, self.spring, *[True] * self.knots])


LEVELS = (
    Level("rotor inertia, viscous and Coulomb friction", 1),
    Level("and an offset", 1, offset=True),
    Level("and friction over the angle", KNOTS, offset=True),
    Level("and a spring over the angle", KNOTS, offset=True, spring=True),
    Level("and masses of links", KNOTS, offset=True, spring=True, masses=True),
)
"""Models of joints, each with all that those before it have."""


@dataclass(frozen=True)
class Fit:
    """Parameters of all joints, with what is known of their errors."""

    level: Level
    values: Array
    """(J, 4 + K), see :class:`cmacexp.gap.replay.JointParams`."""
    deviation: Array
    """(J, 4 + K) standard errors; 0 where a parameter is not fitted."""
    delay: float = 0.0
    """s"""
    delay_deviation: float = 0.0
    delay_correlation: Array = field(default_factory=lambda: np.zeros(0))
    """(J,) of the delay with the rotor inertia of each joint."""
    masses: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Factors of the masses of links, by their joints, with standard errors."""
    covariances: tuple[Array, ...] = ()
    """Of each block: its free parameters joint by joint, the delay, its masses."""


@dataclass(frozen=True)
class Problem:
    """A log, a machine, and its equations along the measured motion."""

    signals: Signals
    machine: Machine

    @cached_property
    def expansions(self) -> list[Expansion]:
        """Of each block."""
        log = self.signals.log
        return [
            self.machine.expand(b, log.angle, self.signals.velocity, log.orientation) for b in self.machine.blocks
        ]

    @cached_property
    def low(self) -> Array:
        """(J,) least angle of the log, where the range begins over which friction and springs are given, rad."""
        return self.signals.log.angle.min(axis=0)

    @cached_property
    def high(self) -> Array:
        """(J,) largest angle of the log; of a joint that does not move a little above the least."""
        return np.maximum(self.signals.log.angle.max(axis=0), self.low + 1e-3)

    def compute_rigid(self, machine: Machine) -> Array:
        """(n, J) torque of the rigid bodies of a machine along the measured motion, N m."""
        own = self.signals
        return machine.compute_torque(own.log.angle, own.velocity, own.acceleration, own.log.orientation)

    @cached_property
    def rigid(self) -> Array:
        """(n, J) torque of the rigid bodies along the measured motion, N m."""
        return self.compute_rigid(self.machine)

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

    def make_params(self, block: Counts, values: Array, delay: float) -> JointParams:
        """The parameters of the joints of a block from ``values`` (J, 4 + K) of all."""
        return JointParams(np.ascontiguousarray(values[block]), self.low[block], self.high[block], delay)

    def drive(self, block: Counts) -> Drive:
        """The drives of a block in the log."""
        log = self.signals.log
        assert log.command is not None
        signals = (log.command[:, block], log.command_velocity[:, block], log.feedforward[:, block])
        return Drive(*signals, log.kp[block], log.kd[block])

    def start(self, block: Counts) -> tuple[Array, Array]:
        """Angles and velocities of a block in the first row."""
        return self.signals.log.angle[0, block], self.signals.velocity[0, block]

    def replay_all(self, values: Array, delay: float, rounds: int = 1) -> tuple[Array, Array]:
        """Angles and velocities (n, J) of the log's commands through joints with ``values`` (J, 4 + K).

        With 2 ``rounds`` the equations are expanded anew along the first replay, so that they hold to all orders.
        """
        log, expansions = self.signals.log, self.expansions
        angle, velocity = np.empty_like(log.angle), np.empty_like(log.angle)
        for count in range(rounds):
            if count:
                expansions = [self.machine.expand(b, angle, velocity, log.orientation) for b in self.machine.blocks]
            for block, expansion in zip(self.machine.blocks, expansions, strict=True):
                params = self.make_params(block, values, delay)
                found = replay_block(expansion, self.drive(block), params, log.period, self.start(block))
                angle[:, block], velocity[:, block] = found.angle, found.velocity
        return angle, velocity

    def apply(self, fit: Fit) -> "Problem":
        """The problem with the masses of a fit; itself if it has none."""
        factors = {joint: factor for joint, (factor, _) in fit.masses.items()}
        return replace(self, machine=self.machine.scale_masses(factors)) if factors else self

    @cached_property
    def masses(self) -> dict[int, Array]:
        """(n, J) torque of the whole mass of links that this log identifies, by their joints, N m."""
        own = {
            joint: self.compute_rigid(self.machine.scale_masses({joint: 2.0})) - self.rigid
            for joint in range(len(self.machine.joints))
        }
        known = dict[int, Array]()
        for block in self.machine.blocks:
            error = _measure_errors(self, block, [own[joint] for joint in block], MASS_PRIOR)
            known |= {
                int(joint): own[joint] for joint, each in zip(block, error, strict=True) if each < KNOWN * MASS_PRIOR
            }
        return known

    @cached_property
    def tilt_error(self) -> float:
        """Standard error of the tilt of the base beside all other parameters, rad; that of the prior: unknown."""
        turned = [self.compute_rigid(self.machine.turn_base(*own)) - self.rigid for own in ((1e-3, 0.0), (0.0, 1e-3))]
        columns = [1e3 * each for each in turned]
        return max(_measure_errors(self, np.arange(len(self.machine.joints)), columns, TILT_PRIOR))


def _measure_errors(problem: Problem, block: Counts, columns: Sequence[Array], prior: float) -> list[float]:
    """Standard errors of parameters that joints share, whose torque for one unit is (n, J), in a regression with all
    parameters of the joints."""
    level, period = LEVELS[-1], problem.signals.log.period
    own = low_pass(make_regressors(problem, level), period)
    shared = low_pass(np.stack(columns, axis=-1), period)
    torque = low_pass(problem.signals.torque - problem.rigid, period)
    information = np.eye(len(columns)) / prior**2
    for j in block:
        weighted = np.concatenate([own[:, j], 0.1 * np.diag(1.0 / problem.scale(level)[j])])
        padded = [
            np.concatenate([each, np.zeros((own.shape[2], *each.shape[1:]))]) for each in (shared[:, j], torque[:, j])
        ]
        rest, left = (each - weighted @ np.linalg.lstsq(weighted, each, rcond=None)[0] for each in padded)
        variance = _measure_variance(left[: len(own), None])
        information += rest.T @ rest / variance
    return [float(each) for each in np.sqrt(np.diag(np.linalg.inv(information)))]


def hats(unit: Array, knots: int) -> Array:
    """(..., K) shares of knots at places from 0 to 1, linear between two knots."""
    if knots == 1:
        return np.ones((*unit.shape, 1))
    place = np.clip(unit, 0.0, 1.0) * (knots - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[..., None] - np.arange(knots)))


def make_regressors(problem: Problem, level: Level, motion: tuple[Array, Array, Array] | None = None) -> Array:
    """(n, J, 4 + K): torque for each unit of the parameters along a motion, or along the measured one, N m."""
    own = problem.signals
    angle, velocity, acceleration = motion or (own.log.angle, own.velocity, own.acceleration)
    unit = (angle - problem.low) / (problem.high - problem.low)
    side = np.tanh(velocity / (SLOW * problem.scales[:, 2]))
    each = [acceleration, velocity, -np.ones_like(unit), 1.0 - 2.0 * unit]
    return np.concatenate([np.stack(each, axis=-1), side[..., None] * hats(unit, level.knots)], axis=-1)


def regress(problem: Problem, level: Level, rows: Mask) -> Array:
    """(J, 4 + K) by least squares on filtered signals at ``rows``, within the bounds; priors keep it defined."""
    from scipy.optimize import lsq_linear

    period, scale, free = problem.signals.log.period, problem.scale(level), level.free
    columns = low_pass(make_regressors(problem, level), period)[rows][..., free]
    torque = low_pass(problem.signals.torque - problem.rigid, period)[rows]
    values = np.zeros(scale.shape)
    low = np.where(np.isin(np.flatnonzero(free), SIGNED), -np.inf, 0.0)
    for j in range(len(values)):
        a = np.concatenate([columns[:, j], np.diag(0.1 / scale[j, free])])
        b = np.concatenate([torque[:, j], np.zeros(free.sum())])
        values[j, free] = lsq_linear(a, b, (low, np.inf)).x
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
            own.solve(own.values, delay)
        error = np.sqrt(np.diag(own.covariance))
        values[own.block] = own.values
        deviation[np.ix_(own.block, level.free)] = error[: own.own].reshape(len(own.block), -1)
        inertia = np.arange(len(own.block)) * int(level.free.sum())
        correlation[own.block] = own.covariance[inertia, own.own] / (error[inertia] * error[own.own])
        for k, joint in enumerate(own.masses, own.own + 1):
            masses[joint] = (1.0 + float(own.x[k]), float(error[k]))
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
        command, rate, torque, kp, kd = problem.drive(self.block)
        self.drive = Drive(command[:end], rate[:end], torque[:end], kp, kd)
        self.measured = problem.signals.log.angle[self.used][:, self.block]
        self.masses = [int(joint) for joint in self.block if level.masses and joint in problem.masses]
        forces = [-problem.masses[joint][:end, self.block] for joint in self.masses]
        self.forces = np.stack(forces, axis=-1) if forces else np.zeros((end, len(self.block), 0))
        free = np.tile(level.free, len(self.block))
        self.own = int(free.sum())
        others = 1 + len(self.masses)
        self.columns = np.append(np.flatnonzero(free), len(free) + np.arange(others))
        scale = problem.scale(level)[self.block].ravel()[free]
        self.scale = np.concatenate([scale, [DELAY_PRIOR[1]], np.full(len(self.masses), MASS_PRIOR)])
        self.mean = np.concatenate([np.zeros(self.own), [DELAY_PRIOR[0]], np.zeros(len(self.masses))])
        signed = np.isin(np.tile(np.flatnonzero(level.free), len(self.block)), SIGNED)
        least = [-4.0 * problem.signals.log.period, *[-MASS_BOUND] * len(self.masses)]
        self.low = np.concatenate([np.where(signed, -np.inf, 0.0), least])
        self.x, self.covariance = self.mean.copy(), np.diag(self.scale**2)
        self._last: tuple[bytes, Replay] | None = None

    @property
    def values(self) -> Array:
        """(B, 4 + K)"""
        values = np.zeros((len(self.block), OWN + self.level.knots))
        values[:, self.level.free] = self.x[: self.own].reshape(len(self.block), -1)
        return values

    def _replay(self, x: Array) -> Replay:
        if self._last is None or self._last[0] != x.tobytes():
            self.x, problem = x, self.problem
            params = JointParams(self.values, problem.low[self.block], problem.high[self.block], x[self.own])
            start, period = problem.start(self.block), problem.signals.log.period
            weights = x[self.own + 1 :]
            found = replay_block(self.expansion, self.drive, params, period, start, self.forces, weights, derive=True)
            self._last = (x.tobytes(), found)
        return self._last[1]

    def _errors(self, x: Array) -> Array:
        """(rows, B) replayed from measured angles, rad."""
        return self._replay(x).angle[self.used] - self.measured

    def _slopes(self, x: Array) -> Array:
        """(rows B, parameters) in units of their scales."""
        found: Array = self._replay(x).angle_by[self.used][:, :, self.columns].reshape(-1, len(x)) * self.scale
        return found

    def solve(self, values: Array, delay: float | None) -> None:
        """Fit from ``values`` (B, 4 + K) on; ``delay`` fixes the delay."""
        x, fitted = self.x.copy(), np.ones(len(self.x), dtype=bool)
        x[: self.own] = values[:, self.level.free].ravel()
        if delay is not None:
            x[self.own], fitted[self.own] = delay, False
        x = np.maximum(x, self.low + 1e-6 * self.scale)
        for _ in range(2):  # the weight of the prior follows from the errors that remain
            x = self._improve(x, fitted)
        slopes, errors = self._slopes(x), self._errors(x)
        information = slopes.T @ slopes / _measure_variance(errors) + np.eye(len(x))
        self.x, self.covariance = x, np.linalg.inv(information) * np.outer(self.scale, self.scale)

    def _improve(self, first: Array, fitted: Mask) -> Array:
        """Fit the parameters that are ``fitted`` with the weights that follow from the errors at ``first``."""
        from scipy.optimize import least_squares

        noise, scale = _measure_variance(self._errors(first)) ** 0.5, self.scale[fitted]

        def complete(y: Array) -> Array:
            x = first.copy()
            x[fitted] = y * scale
            return x

        def weigh(y: Array) -> Array:
            errors = self._errors(complete(y)).ravel() / noise
            return np.concatenate([errors, y - self.mean[fitted] / scale])

        def slope(y: Array) -> Array:
            return np.concatenate([self._slopes(complete(y))[:, fitted] / noise, np.eye(len(y))])

        bounds = (self.low[fitted] / scale, np.inf)
        rules = {"max_nfev": EVALUATIONS, "ftol": 1e-4, "xtol": 1e-6}
        return complete(least_squares(weigh, first[fitted] / scale, slope, bounds, **rules).x)


def _measure_variance(errors: Array) -> float:
    """Variance of ``errors`` (n, B) times the number of rows that say as much as one independent row."""
    return float(max((errors**2).mean(), 1e-18)) * count_correlated(errors)


def count_correlated(errors: Array) -> float:
    """Rows of ``errors`` (n, B) that say as much as one independent row: the integral of their correlation."""
    centred = errors - errors.mean(axis=0)
    size = 2 ** math.ceil(math.log2(2 * len(errors)))
    power = np.abs(np.fft.rfft(centred, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[: len(errors) // 4].sum(axis=1)
    correlation /= correlation[0] or 1.0
    small = np.flatnonzero(correlation < 0.05)
    end = int(small[0]) if small.size else len(correlation)
    return float(max(1.0, 2.0 * correlation[:end].sum() - 1.0))
