"""Regression of the torque of a log on the model of its machine, by which faults and units of torque show."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.signals import Signals, low_pass
from cmacexp.typing import Array, Mask

CERTAIN = 0.1
"""Standard error of the factor of a torque in an unknown unit, over that factor, up to which it is used."""

DELAYS = (-0.012, 0.03)
"""Plausible delays of commands, s; delays from -0.06 to 0.06 s are tried."""
GRAVITY = (0.6, 1.7)
"""Plausible ratios of the torque of the rigid bodies to that of the model, as masses and gains are inexact."""
MOST_LEFT = 0.35
"""Largest part of the torque that the regression on model, friction, damping and inertia may leave, RMS over RMS."""
INDEPENDENT = 0.2
"""Time after which a row counts as independent of one before it, s."""
DIFFERS = 1.5
"""Part of the torque that is left with the rigid bodies of the model, over that with a factor of them, above which
that factor means something: one of bodies much lighter than friction does not."""
ALIKE = 0.02
"""Part of the torque of the rigid bodies that inertia, friction and an offset do not make, below which they are
alike, as those of a rotor or a vertical axis are, and no factor of them is known."""
NEGATIVE = -0.06
"""Viscous friction over the gain kd below which kd is wrong: friction cannot be negative."""


class Regression(NamedTuple):
    """Regression of the torque of J joints on rigid bodies, inertia, viscous friction, an offset and dry friction."""

    delay: float
    """Delay of the commands, s, at which the regression fits best."""
    rest: float
    """Torque that is left, root of the sum of the mean squares of the joints, N m."""
    rest_unfiltered: float
    """The same without the filter that both sides of the regression pass."""
    left: Array
    """(J,) part of the torque that is left, RMS over RMS."""
    left_as_modelled: Array
    """(J,) the same if the factor of the rigid bodies is 1."""
    weights: Array
    """(J, 5) factor of the torque of the rigid bodies, and parameters of the joint."""
    errors: Array
    """(J, 5) standard errors of the weights, for which one row in INDEPENDENT seconds counts as independent."""

    alone: Array
    """(2, J) factor of the rigid bodies and its standard error if joints have no rotor inertia, see ALIKE; the error
    is infinite where the rigid bodies are not like inertia."""

    @property
    def is_certain(self) -> Mask:
        """Mask (J,) of the joints in which the factor of the rigid bodies is known to 30 %."""
        return self.errors[:, 0] < 0.3 * np.abs(self.weights[:, 0])

    @property
    def differs(self) -> Mask:
        """Mask (J,) of the joints whose torque a certain factor of the rigid bodies explains better than 1."""
        return self.is_certain & (self.left_as_modelled > DIFFERS * self.left)

    def has_negative_friction(self, log: Log) -> Mask:
        """Return the mask (J,) of the joints whose viscous friction is negative even at its upper bound.

        A delay of the commands and viscous friction of kp times that delay look alike, and sticking friction looks
        like a delay, so that all of the delay may be friction.
        """
        bound = self.weights[:, 2] + 2.0 * self.errors[:, 2] + log.kp * max(self.delay, 0.0)
        return ~(bound >= NEGATIVE * log.kd)


def fit_model(problem: Problem) -> Regression:
    """Regress the torque on the model by least squares, with the delay of the commands that fits best.

    The best delay leaves the least torque; if the log has measured torques, it is the one at which the feedback law
    agrees best with them, since sticking friction looks like a delay.
    """
    log = problem.signals.log
    period = log.period
    rows = slice(20, len(log.time) - 20)
    terms = np.concatenate([problem.rigid[..., None], problem.make_regressors(1)[..., [0, 1, 2, 4]]], axis=-1)
    columns = low_pass(terms, period)[rows]
    inverse = np.linalg.pinv(columns.transpose(1, 0, 2), rcond=1e-10)
    without = np.linalg.pinv(columns[..., [0, 2, 3, 4]].transpose(1, 0, 2), rcond=1e-10)
    beside = np.linalg.pinv(columns[..., 1:].transpose(1, 0, 2), rcond=1e-10)
    independent = max(min(1.0, period / INDEPENDENT) * len(columns), 2.0 * columns.shape[2])
    most = round(0.06 / period)
    delays = range(-most, most + 1)

    def compute_torque(delay: int) -> Array:
        law = Signals(replace(log, torque=None), delay)
        return low_pass(law.torque, period)[rows]

    rigid = columns[..., 0]
    apart = rigid - np.einsum("kjp,jp->kj", columns[..., 1:], np.einsum("jpk,kj->jp", beside, rigid))
    is_alike = (apart**2).sum(axis=0) < ALIKE**2 * (rigid**2).sum(axis=0)

    def solve(torque: Array, delay: int) -> Regression:
        weights = np.einsum("jpk,kj->jp", inverse, torque)
        squares = ((torque - np.einsum("kjp,jp->kj", columns, weights)) ** 2).sum(axis=0)
        variance = (inverse**2).sum(axis=2) * squares[:, None] / independent
        whole = np.maximum((torque**2).sum(axis=0), 1e-12)
        left = np.sqrt(squares / whole)
        other = torque - columns[..., 0]
        other = other - np.einsum("kjp,jp->kj", columns[..., 1:], np.einsum("jpk,kj->jp", beside, other))
        as_modelled = np.sqrt((other**2).sum(axis=0) / whole)
        rest = float(np.sqrt((left**2 * (torque**2).mean(axis=0)).sum()))
        plain = 0.0
        if log.torque is not None:
            plain = float(((log.torque - np.einsum("kjp,jp->kj", terms, weights))[rows] ** 2).mean() ** 0.5)
        error = np.sqrt(np.maximum(variance, 1e-18))
        error[is_alike, 0] = np.inf
        factor = np.einsum("jpk,kj->jp", without, torque)[:, 0]
        variance = (without[:, 0] ** 2).sum(axis=1) * squares / independent
        alone = np.stack([factor, np.where(is_alike, np.sqrt(variance), np.inf)])
        return Regression(delay * period, rest, plain, left, as_modelled, weights, error, alone)

    if log.torque is None:
        return min((solve(compute_torque(delay), delay) for delay in delays), key=lambda fitted: fitted.rest)
    measured = low_pass(log.torque, period)[rows]
    if not log.has_drives:
        return solve(measured, 0)
    return solve(measured, min(delays, key=lambda delay: float(np.abs(measured - compute_torque(delay)).mean())))


def fit_gravity(problem: Problem) -> tuple[Array, float]:
    """Estimate gravity (3,) in the frame of the base, m/s^2, and the part of the torque that is left."""
    zero, *axes = (
        problem.machine.set_gravity(gravity).compute_torque(*problem.motion) for gravity in (np.zeros(3), *np.eye(3))
    )
    return _fit_shared(problem, zero, [torque - zero for torque in axes])


def fit_load(problem: Problem, joint: int) -> tuple[float, float]:
    """Estimate the factor of the mass of the link of a ``joint``, and the part of the torque that is left."""
    doubled = problem.machine.scale_masses({joint: 2.0}).compute_torque(
        *problem.motion, problem.signals.log.orientation
    )
    factor, left = _fit_shared(problem, problem.rigid, [doubled - problem.rigid])
    return 1.0 + float(factor[0]), left


def _fit_shared(problem: Problem, base: Array, columns: Sequence[Array]) -> tuple[Array, float]:
    """Estimate factors of torques ``columns`` (n, J) beside the torque ``base`` and the joints, N m.

    Returns also the part of the torque of all joints that is left, RMS over RMS.
    """
    signals = problem.signals
    period = signals.log.period
    rows = slice(20, len(signals.log.time) - 20)
    shared = low_pass(np.stack([*columns, signals.torque - base], axis=-1), period)[rows]
    own = low_pass(problem.make_regressors(1)[..., [0, 1, 2, 4]], period)[rows]
    left = [
        shared[:, j] - own[:, j] @ np.linalg.lstsq(own[:, j], shared[:, j], rcond=1e-10)[0]
        for j in range(shared.shape[1])
    ]
    stacked = np.concatenate(left)
    factors: Array = np.linalg.lstsq(stacked[:, :-1], stacked[:, -1], rcond=None)[0].astype(np.float64)
    rest = stacked[:, -1] - stacked[:, :-1] @ factors
    whole = low_pass(signals.torque, period)[rows]
    return factors, float(np.sqrt((rest**2).sum() / max(float((whole**2).sum()), 1e-12)))


def list_unexplained(problem: Problem, regression: Regression) -> set[int]:
    """Return the numbers of the joints whose torque drives and model do not explain with plausible parameters.

    The regression says so: too much is left, commands are shifted, rigid bodies have another sign or size, viscous
    friction is negative, or an offset is larger than all that changes.
    """
    log = problem.signals.log
    gravity = regression.weights[:, 0]
    offset = regression.weights[:, 3]
    plausible = (regression.left <= MOST_LEFT) & (DELAYS[0] <= regression.delay <= DELAYS[1])
    plausible &= ~regression.is_certain | ((gravity >= GRAVITY[0]) & (gravity <= GRAVITY[1]))
    plausible &= ~regression.has_negative_friction(log) & (np.abs(offset) <= problem.signals.torque.std(axis=0))
    return set(np.flatnonzero(~plausible).tolist())


def scale_torque(problem: Problem) -> Log:
    """Return a log whose torques are in N m, if that is possible; their unit in the log is unknown.

    Drives with known gains give the torque themselves. Otherwise a factor for each joint is that of the rigid bodies
    in a regression. The unit stays unknown if they are too light, or at rest, for one of the joints.
    """
    log = problem.signals.log
    if log.has_drives:
        return replace(log, torque=None, is_unit_known=True).note(
            "Torques in an unknown unit are not used: gains and commands give N m."
        )
    assert log.torque is not None
    regression = fit_model(problem)
    gravity, errors = regression.weights[:, 0], regression.errors[:, 0]
    is_inertia = np.isfinite(regression.alone[1])
    gravity, errors = np.where(is_inertia, regression.alone, np.stack([gravity, errors]))
    is_passive = ~log.torque.any(axis=0)
    gravity = np.where(is_passive, 1.0, gravity)
    is_certain = is_passive | (errors < CERTAIN * np.abs(gravity))
    unknown = [log.joints[j] for j in np.flatnonzero(~is_certain)]
    if unknown:
        cure = f" --leave-out {','.join(unknown)} keeps those of the others." if len(unknown) < len(gravity) else ""
        return log.note(
            f"Torques are in an unknown unit, and the rigid bodies of {', '.join(unknown)} are too light, move too "
            "little, or do not explain them, so that N m for each unit are not known: tables of the model and "
            f"identification are left out.{cure}"
        )
    driven = np.flatnonzero(~is_passive)
    listed = ", ".join(f"{log.joints[j]} {1.0 / gravity[j]:.4g}" for j in driven)
    turned = "; below 0, a unit counts against the joint" * bool((gravity < 0.0).any())
    errors = np.where(is_passive, 0.0, errors / np.abs(gravity))
    alone = [log.joints[j] for j in np.flatnonzero(is_inertia & ~is_passive)]
    said = f"; gravity does not show it of {', '.join(alone)}, whose rotors are taken to be in the model"
    return replace(log, torque=log.torque / gravity, is_unit_known=True, unit_error=errors).note(
        f"Torques are in an unknown unit: N m for each unit follow from the masses of the model ({listed}{turned}); "
        f"what is identified is in proportion to these masses, and has their error of {100.0 * errors.max():.2g} %"
        f"{said * bool(alone)}."
    )
