"""Checks of a log before anything is computed from it: each fault is one line that names column and row.

Faults of the log itself come first. Then the log is compared with the model: wrong units, signs, order, gains and
shifts in time show in a regression of the torque, long before they would show as plausible but wrong parameters.
"""

from collections.abc import Iterator

import numpy as np

from cmacexp.addons.gap.identify import Problem
from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.errors import BadInput, require
from cmacexp.typing import Array

LEAST_ROWS = 200
"""Least number of rows of a log."""
LARGEST = 1e100
"""Bound of all values of a log, in any unit: the square of a larger one could overflow."""
RATES = (20.0, 20_000.0)
"""Least and largest sampling rate of a log, Hz."""
NORM_ERROR = 0.01
"""Tolerance of the norm of an orientation, a unit quaternion."""
GAP = 1.6
"""Spacing of two rows, relative to the median, above which rows are missing."""
LEAST_RANGE = 0.02
"""Least range of the motion of a joint that identifies anything of it, rad."""
LEAST_TURNS = 4
"""Least number of reversals of that motion."""
BEYOND = 0.1
"""Tolerance of the limits of the joints in the model, rad."""
SLOPES = (0.5, 1.4)
"""Least and largest slope of the measured over the commanded angle."""
MOST_APART = (0.1, 0.3)
"""Tolerance of the median of measured less commanded angle, since joints sag: rad, and relative to the range."""
NEARER, MUCH_NEARER = 0.5, 0.3
"""Distance of a measured angle to the command of another joint, over that to the command of its own joint, below
which columns are exchanged: for both joints, and for only one of them."""
ADVANCE = 3.0
"""Motion between two rows, over speed times spacing, above which rows were lost and times were renumbered."""
SPIKE = 25.0
"""Second difference, over the 99th percentile of the joint, above which a value is an outlier."""
FROZEN = (0.15, 0.3)
"""Limits of a frozen encoder: time at exactly one angle, s, and motion of the command meanwhile over its range."""
CLIPPED = (3, 3, 0.15)
"""Limits of a clipped angle: number of stops of a moving joint at exactly its extreme angle, rows of each stop, and
speed just before it over the RMS speed: joints that stick by friction come to rest slowly."""
DELAYS = (-0.012, 0.03)
"""Plausible delays of commands, s; delays from -0.06 to 0.06 s are tried."""
GRAVITY = (0.6, 1.7)
"""Plausible ratios of the torque of the rigid bodies to that of the model, as masses and gains are inexact."""
MOST_LEFT = 0.35
"""Largest part of the torque that the regression on model, friction, damping and inertia may leave, RMS over RMS."""
NEGATIVE = -0.06
"""Viscous friction over the gain kd below which kd is wrong: friction cannot be negative."""
ON_LATTICE = 0.6
"""Share of small steps that are multiples of the smallest one, above which the angles are those of an encoder."""


def check_log(log: Log, machine: Machine) -> None:
    """Check a log by itself and against the joint limits of a model; raise BadInput for the first fault."""
    rows = len(log.time)
    require(
        rows >= LEAST_ROWS, KEY, log.path, f"has {rows} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    )
    for quantity in ("time", "orientation", "angle", "command", "command_velocity", "torque", "feedforward"):
        values = vars(log)[quantity]
        for index in () if values is None else map(tuple, np.argwhere(~(np.abs(values) < LARGEST)).tolist()):
            name = quantity if quantity in ("time", "orientation") else log.column(quantity, index[1])
            raise refuse(log, f"column {name} is {values[index]} in row {index[0]}: fill or cut such rows")
    if log.orientation is not None:
        norms = np.linalg.norm(log.orientation, axis=1)
        for row in np.flatnonzero(np.abs(norms - 1.0) > NORM_ERROR):
            raise refuse(log, f"orientation has the norm {norms[row]:.3g} in row {row}: must be 1")
    _check_time(log)
    if log.command is not None:
        _check_pairs(log, log.command)
    for j in range(len(log.joints)):
        _check_angle(log, machine, j)
    _check_lost_rows(log)
    if log.torque is not None and log.command is not None and np.isfinite(log.kp).all():
        _check_torque(log, log.torque)


def refuse(log: Log, fault: str) -> BadInput:
    """Return the error that reports a ``fault`` of a log."""
    return BadInput(KEY, log.path, fault)


def _check_time(log: Log) -> None:
    """Check that time grows, that no rows are missing, and that the sampling rate is plausible; raise BadInput."""
    steps = np.diff(log.time)
    period = log.period
    for before in np.flatnonzero(steps <= 0.0):
        raise refuse(
            log, f"row {before + 1} is not later than the row before it: sort rows, remove those written twice"
        )
    require(
        RATES[0] <= 1.0 / period <= RATES[1],
        KEY,
        log.path,
        f"has {1.0 / period:.3g} rows a second, which robots do not have: say the unit of time, --units time=ms",
    )
    for before in np.flatnonzero(steps > GAP * period):
        raise refuse(
            log,
            f"lacks rows before row {before + 1} (t = {log.time[before + 1]:.3f} s): "
            f"{1e3 * steps[before]:.1f} ms instead of {1e3 * period:.1f} ms; cut the log there",
        )


def _check_pairs(log: Log, command: Array) -> None:
    """Check units, signs, zeros and order of the measured angles against the commands (n, J), rad; raise BadInput."""
    span = np.ptp(command, axis=0)
    centred = command - command.mean(axis=0)
    angles, commands = ([log.column(quantity, j) for j in range(len(span))] for quantity in ("angle", "command"))
    require(
        np.sqrt(((log.angle - command) ** 2).mean()) >= 1e-4 * max(span.max(), 1e-9),
        KEY,
        log.path,
        f"column {angles[0]} and others hold the commands, not measured angles",
    )
    products = (centred * log.angle).sum(axis=0)
    slopes = np.divide(products, (centred**2).sum(axis=0), out=np.ones_like(span), where=span > LEAST_RANGE)
    for j in np.flatnonzero((slopes < SLOPES[0]) | (slopes > SLOPES[1])):
        raise refuse(
            log,
            f"column {angles[j]} moves {slopes[j]:.3g} times as far as {commands[j]}: one of them is in degrees "
            "(57.3 or 0.0175: --units), its sign or joint is another (below 0), or its encoder is frozen (near 0)",
        )
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in np.flatnonzero(apart > np.maximum(MOST_APART[0], MOST_APART[1] * span)):
        raise refuse(
            log,
            f"column {angles[j]} is {apart[j]:.2g} rad apart from {commands[j]} in the median: their zeros differ",
        )
    distance = np.sqrt(((log.angle[:, :, None] - command[:, None, :]) ** 2).mean(axis=0))
    for a, b in enumerate(distance.argmin(axis=1)):
        both_nearer = distance[a, b] < NEARER * distance[a, a] and distance[b, a] < NEARER * distance[b, b]
        require(
            not both_nearer and distance[a, b] >= MUCH_NEARER * distance[a, a],
            KEY,
            log.path,
            f"column {angles[a]} follows {commands[b]} and not {commands[a]}: are columns exchanged?",
        )


def _check_angle(log: Log, machine: Machine, j: int) -> None:
    """Check the measured angle of joint ``j``: unit, zero, stops, jumps and amount of motion; raise BadInput."""
    joint = log.joints[j]
    name = log.column("angle", j)
    values = log.angle[:, j]
    low, high = machine.ranges[j]
    speed = differentiate(values[:, None], log.period)[:, 0]
    moving = speed[np.abs(speed) > 0.1 * np.sqrt((speed**2).mean())]
    span = np.ptp(values)
    turns = np.count_nonzero(np.diff(np.sign(moving)))
    require(
        low - BEYOND <= values.min() and values.max() <= high + BEYOND,
        KEY,
        log.path,
        f"column {name} reaches from {values.min():.3g} to {values.max():.3g} rad, "
        f"{machine.joints[j]} of the model from {low:.3g} to {high:.3g}: check its unit (degrees: --units "
        "angle=deg,command=deg), zero and joint",
    )
    _check_stops(log, j)
    bend = np.abs(np.diff(values, 2))
    row = int(bend.argmax()) + 1
    require(
        bend.max() <= max(SPIKE * np.percentile(bend, 99.0), 0.02 * span, 1e-6),
        KEY,
        log.path,
        f"column {name} jumps at row {row} (t = {log.time[row]:.3f} s): an outlier, or the log was joined there",
    )
    require(
        span >= LEAST_RANGE and turns >= LEAST_TURNS,
        KEY,
        log.path,
        f"joint {joint} moves {span:.2g} rad and turns {turns} times, which identifies neither its "
        f"friction nor its inertia: move it, or --leave-out {joint}",
    )


def _check_stops(log: Log, j: int) -> None:
    """Check that the angle of joint ``j`` is neither clipped nor frozen while its command moves; raise BadInput."""
    values = log.angle[:, j]
    name = log.column("angle", j)
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    begins, ends = np.append(0, edges), np.append(edges, len(values))
    steps = np.abs(np.diff(values, prepend=values[0]))
    stopped = (ends - begins >= CLIPPED[1]) & (begins > 1)
    stopped &= steps[begins - 1] > CLIPPED[2] * np.sqrt((steps[1:] ** 2).mean())
    for extreme in (values.min(), values.max()):
        clipped = begins[stopped & (values[begins] == extreme)]
        if len(clipped) >= CLIPPED[0]:
            raise refuse(
                log,
                f"column {name} is clipped at {extreme:.4g} rad, {len(clipped)} times, first in row {clipped[0]}",
            )
    command = values if log.command is None else log.command[:, j]
    for k in np.flatnonzero(ends - begins >= max(3, round(FROZEN[0] / log.period))):
        require(
            np.ptp(command[begins[k] : ends[k]]) <= FROZEN[1] * np.ptp(command),
            KEY,
            log.path,
            f"column {name} stays at {values[begins[k]]:.4g} from row {begins[k]} "
            f"to {ends[k] - 1} while its command moves: a frozen encoder",
        )


def _check_lost_rows(log: Log) -> None:
    """Check that no rows were lost and the times renumbered; raise BadInput.

    All joints together would move several times as far in one row as their speed before and after it says.
    """
    scaled = log.angle / np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    reach = max(3, round(0.02 / log.period))
    middle = np.arange(reach, len(scaled) - 1 - reach)
    step, whole = (scaled[middle + 1 + k] - scaled[middle - k] for k in (0, reach))
    around = (whole - step) / (2.0 * reach)
    size = (around**2).sum(axis=1)
    fast = size > 0.1 * np.percentile(size, 95.0)
    advance = np.divide((step * around).sum(axis=1), size, out=np.zeros_like(size), where=fast)
    row = int(middle[advance.argmax()]) + 1
    require(
        advance.max()
        <= max(ADVANCE, 2.0 * np.percentile(advance, 99.0)),  # noisy logs have large advances everywhere
        KEY,
        log.path,
        f"moves {advance.max():.1f} times as far as its speed from row {row - 1} to "
        f"{row} (t = {log.time[row]:.3f} s): rows were lost and the times rewritten",
    )


def _check_torque(log: Log, torque: Array) -> None:
    """Check that measured torques (n, J), N m, agree with those of the drives; raise BadInput."""
    measured = low_pass(torque, log.period)
    expected = low_pass(Signals(log).compute_torque(log.angle) + log.feedforward, log.period)
    slopes = (measured * expected).sum(axis=0) / np.maximum((expected * expected).sum(axis=0), 1e-12)
    for j in np.flatnonzero(~((slopes >= 0.75) & (slopes <= 1.3))).tolist():
        times = f"{slopes[j]:.3g} times what the gains give: check --kp and --kd"
        raise refuse(log, f"column {log.column('torque', j)} is {times}")


def check_against_model(problem: Problem) -> list[str]:
    """Compare a log with a model by a regression; return notes on the limits of the log, one sentence each.

    Raises BadInput if commands are shifted in time, if gains or signs are implausible, or if the model explains too
    little of the torque.
    """
    log = problem.signals.log
    left, weights, errors, late = _fit_model(problem)
    require(
        DELAYS[0] <= late <= DELAYS[1],
        KEY,
        log.path,
        f"commands fit best {1e3 * abs(late):.0f} ms {'later' if late > 0 else 'earlier'} than they are written: "
        "their times are shifted, or --kp or --kd is wrong",
    )
    notes = list(_note(log))
    gravity = weights[:, 0]
    certain = errors[:, 0] < 0.3 * np.abs(gravity)
    for j in np.flatnonzero(certain & (gravity < 0.0)):
        raise refuse(
            log,
            f"torque of {log.joints[j]} grows where the model of {problem.machine.joints[j]} says "
            f"that it falls (factor {gravity[j]:.2f}): its sign, side or joint is another",
        )
    require(
        left <= MOST_LEFT,
        KEY,
        log.path,
        f"the model explains its torque only to {100.0 * left:.0f} %: order, signs or units of joints, or --robot, "
        "are wrong",
    )
    too_low = weights[:, 2] + 2.0 * errors[:, 2] < NEGATIVE * log.kd
    for j in np.flatnonzero(too_low & (log.command is not None)):
        raise refuse(
            log,
            f"viscous friction of {log.joints[j]} comes out as {weights[j, 2]:.2g} "
            f"N m s/rad, below zero: --kd {log.kd[j]:g} is too large",
        )
    factor = float(np.average(gravity[certain], weights=errors[certain, 0] ** -2)) if certain.any() else 1.0
    times = f"are {factor:.2f} times those of the rigid bodies of the model:"
    require(
        GRAVITY[0] <= factor <= GRAVITY[1],
        KEY,
        log.path,
        f"torques {times} gains (--kp), units of torque, or masses are wrong by that",
    )
    if not 0.8 <= factor <= 1.25:
        notes.append(f"Torques {times} masses, or gains, differ by that.")
    if log.command is not None and (viscous := float(np.median(weights[:, 2]))) > 0.4 * float(log.kd.mean()):
        notes.append(
            f"Viscous friction is {viscous:.2f} N m s/rad, much beside --kd {log.kd.mean():g}: check that gain."
        )
    return notes


def _fit_model(problem: Problem) -> tuple[float, Array, Array, float]:
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
    most = 0 if log.command is None else round(0.06 / period)

    def fit(delay: int) -> tuple[float, float, Array, Array, float]:
        torque = low_pass(Signals(log, delay).torque, period)[rows]
        left, weights, errors = _solve(filtered, torque)
        distance = left if measured is None else float(np.abs(measured - torque).mean())
        return distance, left, weights, errors, delay * period

    return min(map(fit, range(-most, most + 1)), key=lambda fitted: fitted[0])[1:]


def _solve(columns: Array, torque: Array) -> tuple[float, Array, Array]:
    """Fit the torque (n, J) of each joint by its ``columns`` (n, J, P), by least squares.

    Returns the part of the torque that is left, RMS over RMS, the weights (J, P), and their standard errors, for
    which one row in 40 counts as independent.
    """
    inverse = np.linalg.pinv(columns.transpose(1, 0, 2), rcond=1e-10)
    weights = np.einsum("jpk,kj->jp", inverse, torque)
    rest = torque - np.einsum("kjp,jp->kj", columns, weights)
    independent = max(len(torque) / 40.0, 2.0 * columns.shape[2])
    variance = (inverse**2).sum(axis=2) * (rest**2).sum(axis=0)[:, None] / independent
    left = float((rest**2).sum()) / max(float((torque**2).sum()), 1e-12)
    return left**0.5, weights, np.sqrt(np.maximum(variance, 1e-18))


def _note(log: Log) -> Iterator[str]:
    """Yield notes on the limits of a log: filtered angles, and commands that do not distinguish or excite joints."""
    if not _is_quantised(log):
        yield (
            "The angles show no step of an encoder: they were filtered or "
            "simulated, and noise and velocities are those of the filter."
        )
    if log.command is not None:
        centred = log.command - log.command.mean(axis=0)
        scaled = centred / np.maximum(np.sqrt((centred**2).mean(axis=0)), 1e-9)
        correlated = np.abs(scaled.T @ scaled) / len(scaled) > 0.999
        span = np.ptp(log.command, axis=0)
        equal = correlated & (np.abs(span[:, None] - span) < 0.02 * span)
        groups = {tuple(log.joints[k] for k in np.flatnonzero(row)) for row in equal if row.sum() > 1}
        if groups:
            listed = "; ".join(", ".join(group) for group in sorted(groups))
            yield (
                f"Joints with equal or mirrored commands ({listed}): nothing "
                "in this log shows whether their columns are exchanged."
            )
        if len(log.joints) > 1 and correlated.all():
            yield "All commands are one signal (rank 1): what joints do to each other is not excited."


def _is_quantised(log: Log) -> bool:
    """Return True if the angles of most joints, while they move, are multiples of the step of an encoder."""
    shares = list[float]()
    for steps in np.abs(np.diff(log.angle, axis=0)).T:
        steps = steps[steps > 1e-6]
        if len(steps) > 20:
            few = steps[steps < 20.0 * steps.min()] / steps.min()
            shares.append(float((np.abs(few - np.round(few)) < 0.1).mean()) if len(few) > 10 else 0.0)
    return bool(shares) and float(np.median(shares)) > ON_LATTICE
