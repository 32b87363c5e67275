"""Regression of the torque of a log on the model of its machine, by which faults and units of torque show."""

from dataclasses import replace

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.signals import Signals, low_pass
from cmacexp.typing import Array

CERTAIN = 0.1
"""Standard error of the factor of a torque in an unknown unit, over that factor, up to which it is used."""

DELAYS = (-0.012, 0.03)
"""Plausible delays of commands, s; delays from -0.06 to 0.06 s are tried."""
GRAVITY = (0.6, 1.7)
"""Plausible ratios of the torque of the rigid bodies to that of the model, as masses and gains are inexact."""
MOST_LEFT = 0.35
"""Largest part of the torque that the regression on model, friction, damping and inertia may leave, RMS over RMS."""
NEGATIVE = -0.06
"""Viscous friction over the gain kd below which kd is wrong: friction cannot be negative."""


def fit_model(problem: Problem) -> tuple[Array, Array, Array, float]:
    """Regress the torque on the model for each delay of the commands; return the best regression and its delay, s.

    The regression is that of :func:`_solve`. The best delay leaves the least torque; if the log has measured torques,
    it is the one at which the feedback law agrees best with them, since sticking friction looks like a delay.
    """
    log = problem.signals.log
    period = log.period
    rows = slice(20, len(log.time) - 20)
    columns = np.concatenate([problem.rigid[..., None], problem.make_regressors(1)[..., [0, 1, 2, 4]]], axis=-1)
    filtered = low_pass(columns, period)[rows]
    measured = None if log.torque is None else low_pass(log.torque, period)[rows]
    most = round(0.06 / period) if log.has_drives else 0

    def fit(delay: int) -> tuple[float, Array, Array, Array, float]:
        signals = Signals(log, delay)
        if measured is not None and log.has_drives:
            torque = low_pass(signals.compute_torque(log.angle) + log.feedforward, period)[rows]
            return float(np.abs(measured - torque).mean()), *_solve(filtered, measured), delay * period
        torque = low_pass(signals.torque, period)[rows]
        left, weights, errors = _solve(filtered, torque)
        return float(np.sqrt((left**2 * (torque**2).mean(axis=0)).sum())), left, weights, errors, delay * period

    return min(map(fit, range(-most, most + 1)), key=lambda fitted: fitted[0])[1:]


def _solve(columns: Array, torque: Array) -> tuple[Array, Array, Array]:
    """Fit the torque (n, J) of each joint by its ``columns`` (n, J, P), by least squares.

    Returns the part of the torque that is left (J,), RMS over RMS, the weights (J, P), and their standard errors, for
    which one row in 40 counts as independent.
    """
    inverse = np.linalg.pinv(columns.transpose(1, 0, 2), rcond=1e-10)
    weights = np.einsum("jpk,kj->jp", inverse, torque)
    rest = torque - np.einsum("kjp,jp->kj", columns, weights)
    independent = max(len(torque) / 40.0, 2.0 * columns.shape[2])
    variance = (inverse**2).sum(axis=2) * (rest**2).sum(axis=0)[:, None] / independent
    left = (rest**2).sum(axis=0) / np.maximum((torque**2).sum(axis=0), 1e-12)
    return np.sqrt(left), weights, np.sqrt(np.maximum(variance, 1e-18))


def list_unexplained(problem: Problem, left: Array, weights: Array, errors: Array, late: float) -> set[int]:
    """Return the numbers of the joints whose torque drives and model do not explain with plausible parameters.

    The results of :func:`fit_model` say so: too much is left, commands are shifted, rigid bodies have another sign or
    size, viscous friction is negative, or an offset is larger than all that changes.
    """
    log = problem.signals.log
    gravity, offset = weights[:, 0], weights[:, 3]
    viscous = bound_friction(log, weights, errors, late)
    certain = errors[:, 0] < 0.3 * np.abs(gravity)
    plausible = (left <= MOST_LEFT) & (DELAYS[0] <= late <= DELAYS[1]) & log.has_drives
    plausible &= ~certain | ((gravity >= GRAVITY[0]) & (gravity <= GRAVITY[1]))
    plausible &= (viscous >= NEGATIVE * log.kd) & (np.abs(offset) <= problem.signals.torque.std(axis=0))
    return set(np.flatnonzero(~plausible).tolist())


def bound_friction(log: Log, weights: Array, errors: Array, late: float) -> Array:
    """Return upper bounds of viscous friction (J,), N m s/rad, from the results of :func:`fit_model`.

    A delay of the commands and viscous friction of kp times that delay look alike, and sticking friction looks like a
    delay, so that all of the delay may be friction.
    """
    bounds: Array = weights[:, 2] + 2.0 * errors[:, 2] + log.kp * max(late, 0.0)
    return bounds


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
    _, weights, errors, _ = fit_model(problem)
    gravity = weights[:, 0]
    unknown = [log.joints[j] for j in np.flatnonzero(~(errors[:, 0] < CERTAIN * np.abs(gravity)))]
    if unknown:
        return log.note(
            f"Torques are in an unknown unit, and the rigid bodies of {', '.join(unknown)} are too light, or move "
            "too little, to estimate N m for each unit: tables of the model and identification are left out."
        )
    listed = ", ".join(f"{joint} {1.0 / factor:.4g}" for joint, factor in zip(log.joints, gravity, strict=True))
    return replace(log, torque=log.torque / gravity, is_unit_known=True).note(
        f"Torques are in an unknown unit: N m for each unit follow from the masses of the model ({listed}); what is "
        "identified is in proportion to these masses."
    )
