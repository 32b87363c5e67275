"""Identification of joints from a log: least squares on filtered signals, then by replaying commands or torques.

One block of joints at a time. The first step has a solution in closed form but is biased by the filter and by noise;
from there the second minimises the distance of the replayed from the measured angles (trust region, within bounds).
A parameter that the log does not excite keeps its prior, has a large standard error, and is refused by name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.addons.gap.problem import LEVELS, MASS_PRIOR, SIGNED, Level, Problem, measure_variance, regress
from cmacexp.addons.gap.replay import Expansion, JointParams, replay
from cmacexp.models.joint import OWN
from cmacexp.typing import Array, Mask

__all__ = ["LEVELS", "Fit", "Level", "Problem", "fit", "regress", "replay_fit"]

DELAY_PRIOR = (0.003, 0.01)
"""Mean and standard deviation of the prior of the delay of commands, s."""
MASS_BOUND = 0.5
"""Largest relative reduction of the mass of a link."""
STRUCTURE = 0.005
"""Standard error that a fit of measured torques has at least, over the size of its term: what the models of joints
lack, such as backlash, is no noise. Of an inertia the size is that of all the joint moves, of an offset at least its
friction."""
SHAPE = 0.1
"""Standard error that dry friction has at least, over its size: friction of a joint also depends on its speed. At the
RMS speed viscous friction takes as much. In MuJoCo's joints, which creep, dry friction comes out 5 to 19 % low
(``examples/10_policy_log.py``; chosen after seeing that)."""
BETWEEN_ROWS = 0.25
"""Standard error of an inertia over kd times the period of the log, and of viscous friction over kp times it: whether
a drive computes once a row or between rows too, which changes them by half of that, is not known."""
MOST_ROWS = 5_000
"""Largest number of rows that are compared; of a longer log every second, third, ... row is, evenly spread."""
EVALUATIONS = 25
"""Largest number of replays in one optimisation."""


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


def replay_fit(problem: Problem, fitted: Fit, expansions: Sequence[Expansion] | None = None) -> Array:
    """Return angles (n, J), rad, of fitted joints under the commands, or under torques in a log without drives."""
    if not problem.signals.log.has_drives:
        return problem.follow(fitted.values, fitted.delay)
    delay = fitted.delay if problem.command_delay is None else problem.command_delay
    return problem.replay(fitted.values, delay, expansions)[0]


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
        used = np.flatnonzero(rows[:end])
        self.used = used[:: math.ceil(len(used) / MOST_ROWS)]
        expansions, drives = problem.excitation
        self.expansion = Expansion(*(values[:end] for values in expansions[number]))
        drive = drives.choose(self.joints)
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
        self.mean[self.delay] = 0.0 if problem.signals.is_measured else DELAY_PRIOR[0]
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
        slopes = slopes / self._repeat(measure_variance(errors) ** 0.5)[:, None]
        information = slopes.T @ slopes + np.eye(len(x))
        self.x, self.covariance = x, np.linalg.inv(information) * np.outer(self.scale, self.scale)
        log = self.problem.signals.log
        values = self.get_values(x)
        floor = np.zeros_like(values)
        floor[:, OWN:] = SHAPE * values[:, OWN:]
        if log.has_drives:
            gains = np.column_stack([log.kd, log.kp])[self.joints]
            floor[:, :2] = BETWEEN_ROWS * log.period * gains  # rotor inertia and viscous friction
        bent = floor[:, OWN:].mean(axis=1) / self.problem.scales[self.joints, 2]
        floor[:, 1] = np.hypot(floor[:, 1], bent)
        if self.problem.signals.is_measured:
            size = np.abs(values)
            size[:, 0] += np.diagonal(self.expansion.mass, axis1=1, axis2=2).mean(axis=0)
            size[:, SIGNED] = np.maximum(size[:, SIGNED], values[:, OWN:].mean(axis=1, keepdims=True))
            floor = np.hypot(floor, STRUCTURE * size)
        if log.unit_error is not None:
            floor = np.hypot(floor, log.unit_error[self.joints, None] * np.abs(values))
        self.covariance[np.arange(self.delay), np.arange(self.delay)] += floor[:, self.level.free].ravel() ** 2

    def _repeat(self, noise: Array) -> Array:
        """Return the noise of each joint (B,) for each of its compared angles (rows B,), as they are flattened."""
        return np.tile(noise, len(self.used))

    def _improve(self, first: Array, fitted: Mask) -> Array:
        """Return ``first`` with the parameters ``fitted`` (a mask) optimised; errors at ``first`` weigh the prior."""
        from scipy.optimize import least_squares

        noise = self._repeat(measure_variance(self._compare(first)[0]) ** 0.5)
        scale = self.scale[fitted]

        def complete(y: Array) -> Array:
            x = first.copy()
            x[fitted] = y * scale
            return x

        def weigh(y: Array) -> Array:
            errors, _ = self._compare(complete(y))
            return np.concatenate([errors.ravel() / noise, y - self.mean[fitted] / scale])

        def slope(y: Array) -> Array:
            return np.concatenate([self._compare(complete(y))[1][:, fitted] / noise[:, None], np.eye(len(y))])

        bounds = (self.low[fitted] / scale, np.inf)
        return complete(
            least_squares(weigh, first[fitted] / scale, slope, bounds, max_nfev=EVALUATIONS, ftol=1e-4, xtol=1e-6).x
        )
