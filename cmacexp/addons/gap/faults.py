"""What is wrong with a log, before anything is computed from it: each fault is one line that names column and row.

Faults of the log alone come first. Then the log is compared with the model: units, signs, order, gains and shifts in
time show in a regression of the torque, long before they would show as plausible but wrong parameters.
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
LARGEST = 1e100
"""No measurement, in whatever unit, is as large; squares of such numbers have no room in a float."""
RATES = (20.0, 20_000.0)
"""Sampling rates of logs, Hz."""
NORM_ERROR = 0.01
"""Amount by which the norm of an orientation, a unit quaternion, may differ from 1."""
GAP = 1.6
"""Spacing of two rows, over the median, from which rows are missing."""
LEAST_RANGE, LEAST_TURNS = 0.02, 4
"""Motion of a joint that shows anything of it: its range, rad, and how often it turns."""
BEYOND = 0.1
"""Angle by which joints of a robot may lie beyond the limits of its model, rad."""
SLOPES = (0.5, 1.4)
"""Least and largest slope of measured over commanded angles."""
MOST_APART = (0.1, 0.3)
"""Median distance of measured and commanded angles, rad, and over the range, that a sagging joint may have."""
NEARER, MUCH_NEARER = 0.5, 0.3
"""Distance of a measured angle to the command of another joint, over that to its own, that shows an exchange: of both
joints, and of one alone."""
ADVANCE = 3.0
"""Motion between two rows, over speed times spacing, from which rows were lost and times written anew."""
SPIKE = 25.0
"""Second difference, over the 99th percentile of the joint, of a value that no motion explains."""
FROZEN = (0.15, 0.3)
"""Seconds at exactly one angle, and the part of the range that the command moves meanwhile."""
CLIPPED = (3, 3, 0.15)
"""How often, and for how many rows in sequence, a moving joint stands at exactly its extreme angle; and the part of
its RMS speed that it has just before: joints that stick come to rest slowly."""
DELAYS = (-0.012, 0.03)
"""Delays of commands that drives can have, s; what is searched reaches 0.06 s to both sides."""
GRAVITY = (0.6, 1.7)
"""Torque of the rigid bodies over that of the model: masses, and gains, that the model or the user may have."""
MOST_LEFT = 0.35
"""Part of the torque that no combination of model, friction, damping and inertia explains."""
NEGATIVE = -0.06
"""Viscous friction, over the gain kd, below which kd is wrong."""
ON_LATTICE = 0.6
"""Part of small steps of an encoder that are multiples of the smallest one."""


def check_log(log: Log, machine: Machine) -> None:
    """Check a log by itself and against the limits of a model; raises BadInput for the first fault."""
    rows = len(log.time)
    require(
        rows >= LEAST_ROWS, KEY, log.path, f"has {rows} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    )
    for quantity in ("time", "orientation", "angle", "command", "command_velocity", "torque", "feedforward"):
        values = vars(log)[quantity]
        for place in () if values is None else map(tuple, np.argwhere(~(np.abs(values) < LARGEST)).tolist()):
            name = quantity if quantity in ("time", "orientation") else log.column(quantity, place[1])
            raise refuse(log, f"column {name} is {values[place]} in row {place[0]}: fill or cut such rows")
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
    """The mistake of a log with a fault."""
    return BadInput(KEY, log.path, fault)


def _check_time(log: Log) -> None:
    steps, period = np.diff(log.time), log.period
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
    """Measured beside commanded angles: units, signs, order."""
    span, centred = np.ptp(command, axis=0), command - command.mean(axis=0)
    names, others = ([log.column(each, j) for j in range(len(span))] for each in ("angle", "command"))
    require(
        np.sqrt(((log.angle - command) ** 2).mean()) >= 1e-4 * max(span.max(), 1e-9),
        KEY,
        log.path,
        f"column {names[0]} and others hold the commands, not measured angles",
    )
    products = (centred * log.angle).sum(axis=0)
    slopes = np.divide(products, (centred**2).sum(axis=0), out=np.ones_like(span), where=span > LEAST_RANGE)
    for j in np.flatnonzero((slopes < SLOPES[0]) | (slopes > SLOPES[1])):
        raise refuse(
            log,
            f"column {names[j]} moves {slopes[j]:.3g} times as far as {others[j]}: one of them is in degrees "
            "(57.3 or 0.0175: --units), its sign or joint is another (below 0), or its encoder is frozen (near 0)",
        )
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in np.flatnonzero(apart > np.maximum(MOST_APART[0], MOST_APART[1] * span)):
        raise refuse(
            log, f"column {names[j]} is {apart[j]:.2g} rad apart from {others[j]} in the median: their zeros differ"
        )
    distance = np.sqrt(((log.angle[:, :, None] - command[:, None, :]) ** 2).mean(axis=0))
    for a, b in enumerate(distance.argmin(axis=1)):
        both_nearer = distance[a, b] < NEARER * distance[a, a] and distance[b, a] < NEARER * distance[b, b]
        require(
            not both_nearer and distance[a, b] >= MUCH_NEARER * distance[a, a],
            KEY,
            log.path,
            f"column {names[a]} follows {others[b]} and not {others[a]}: are columns exchanged?",
        )


def _check_angle(log: Log, machine: Machine, j: int) -> None:
    """One joint: its unit and zero, stops, jumps, and whether it moves enough."""
    joint, name, values, (low, high) = log.joints[j], log.column("angle", j), log.angle[:, j], machine.ranges[j]
    speed = differentiate(values[:, None], log.period)[:, 0]
    moving = speed[np.abs(speed) > 0.1 * np.sqrt((speed**2).mean())]
    span, turns = np.ptp(values), np.count_nonzero(np.diff(np.sign(moving)))
    least, most = low - BEYOND, high + BEYOND
    require(
        least <= values.min() and values.max() <= most,
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
    """Values that stay exactly the same while the joint is told to move."""
    values, name = log.angle[:, j], log.column("angle", j)
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    begins, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(values)]])
    steps = np.abs(np.diff(values, prepend=values[0]))
    stopped = (ends - begins >= CLIPPED[1]) & (begins > 1)
    stopped &= steps[begins - 1] > CLIPPED[2] * np.sqrt((steps[1:] ** 2).mean())
    for extreme in (values.min(), values.max()):
        clipped = begins[stopped & (values[begins] == extreme)]
        if len(clipped) >= CLIPPED[0]:
            times = f"{len(clipped)} times, first in row {clipped[0]}"
            raise refuse(log, f"column {name} is clipped at {extreme:.4g} rad, {times}")
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
    """A step of all joints together that is several times as long as their speed on both sides of it says."""
    scaled = log.angle / np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    reach = max(3, round(0.02 / log.period))
    place = np.arange(reach, len(scaled) - 1 - reach)
    step, whole = (scaled[place + 1 + k] - scaled[place - k] for k in (0, reach))
    around = (whole - step) / (2.0 * reach)
    size = (around**2).sum(axis=1)
    fast = size > 0.1 * np.percentile(size, 95.0)
    advance = np.divide((step * around).sum(axis=1), size, out=np.zeros_like(size), where=fast)
    row = int(place[advance.argmax()]) + 1
    require(
        advance.max() <= max(ADVANCE, 2.0 * np.percentile(advance, 99.0)),  # which is large of a noisy log
        KEY,
        log.path,
        f"moves {advance.max():.1f} times as far as its speed from row {row - 1} to "
        f"{row} (t = {log.time[row]:.3f} s): rows were lost and the times written anew",
    )


def _check_torque(log: Log, torque: Array) -> None:
    """Measured torques must be those of the drives."""
    drives = Signals(log).compute_torque(log.angle) + log.feedforward
    a, b = low_pass(torque, log.period), low_pass(drives, log.period)
    slopes = (a * b).sum(axis=0) / np.maximum((b * b).sum(axis=0), 1e-12)
    for j in np.flatnonzero(~((slopes >= 0.75) & (slopes <= 1.3))).tolist():
        times = f"{slopes[j]:.3g} times what the gains give: check --kp and --kd"
        raise refuse(log, f"column {log.column('torque', j)} is {times}")


def check_against_model(problem: Problem) -> list[str]:
    """Compare a log with a model by a regression; notes on what the log cannot show, a sentence each.

    Raises BadInput where commands are shifted in time, gains or signs cannot be right, or nothing fits.
    """
    log, machine = problem.signals.log, problem.machine
    left, weights, errors, late = _fit_model(problem)
    require(
        DELAYS[0] <= late <= DELAYS[1],
        KEY,
        log.path,
        f"commands fit best {1e3 * abs(late):.0f} ms {'later' if late > 0 else 'earlier'} than they are written: "
        "their times are shifted, or --kp or --kd is wrong",
    )
    notes = list(_note(log))
    gravity, known = weights[:, 0], errors[:, 0] < 0.3 * np.abs(weights[:, 0])
    for j in np.flatnonzero(known & (gravity < 0.0)):
        raise refuse(
            log,
            f"torque of {log.joints[j]} grows where the model of {machine.joints[j]} says "
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
    factor = float(np.average(gravity[known], weights=errors[known, 0] ** -2)) if known.any() else 1.0
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
    """As :func:`_solve`, with commands delayed by what fits best, and that delay, s.

    Where the drives' torque is known their law is compared with that: friction that sticks looks like a delay.
    """
    log, period, rows = problem.signals.log, problem.signals.log.period, slice(20, len(problem.signals.log.time) - 20)
    columns = np.concatenate([problem.rigid[..., None], problem.make_regressors(1)[..., [0, 1, 2, 4]]], axis=-1)
    filtered = low_pass(columns, period)[rows]
    known = None if log.torque is None else low_pass(log.torque, period)[rows]
    most = 0 if log.command is None else round(0.06 / period)

    def fit(delay: int) -> tuple[float, float, Array, Array, float]:
        torque = low_pass(Signals(log, delay).torque, period)[rows]
        left, weights, errors = _solve(filtered, torque)
        distance = left if known is None else float(np.abs(known - torque).mean())
        return distance, left, weights, errors, delay * period

    return min(map(fit, range(-most, most + 1)), key=lambda each: each[0])[1:]


def _solve(columns: Array, torque: Array) -> tuple[float, Array, Array]:
    """Part of the torque that is left, weights (J, P), and their standard errors with correlated errors."""
    inverse = np.linalg.pinv(columns.transpose(1, 0, 2), rcond=1e-10)
    weights = np.einsum("jpk,kj->jp", inverse, torque)
    rest = torque - np.einsum("kjp,jp->kj", columns, weights)
    independent = max(len(torque) / 40.0, 2.0 * columns.shape[2])
    variance = (inverse**2).sum(axis=2) * (rest**2).sum(axis=0)[:, None] / independent
    left = float((rest**2).sum()) / max(float((torque**2).sum()), 1e-12)
    return left**0.5, weights, np.sqrt(np.maximum(variance, 1e-18))


def _note(log: Log) -> Iterator[str]:
    """What the log cannot show, and what was done to it."""
    if not _is_quantised(log):
        yield (
            "The angles show no step of an encoder: they were filtered or "
            "simulated, and noise and velocities are those of the filter."
        )
    if log.command is not None:
        centred = log.command - log.command.mean(axis=0)
        scaled = centred / np.maximum(np.sqrt((centred**2).mean(axis=0)), 1e-9)
        alike = np.abs(scaled.T @ scaled) / len(scaled) > 0.999
        span = np.ptp(log.command, axis=0)
        equal = alike & (np.abs(span[:, None] - span) < 0.02 * span)
        groups = {tuple(log.joints[k] for k in np.flatnonzero(row)) for row in equal if row.sum() > 1}
        if groups:
            listed = "; ".join(", ".join(group) for group in sorted(groups))
            yield (
                f"Joints with equal or mirrored commands ({listed}): nothing "
                "in this log shows whether their columns are exchanged."
            )
        if len(log.joints) > 1 and alike.all():
            yield "All commands are one signal (rank 1): what joints do to each other is not excited."


def _is_quantised(log: Log) -> bool:
    """Whether the angles of most joints, where they move, lie on the lattice of an encoder."""
    shares = list[float]()
    for steps in np.abs(np.diff(log.angle, axis=0)).T:
        steps = steps[steps > 1e-6]
        if len(steps) > 20:
            few = steps[steps < 20.0 * steps.min()] / steps.min()
            shares.append(float((np.abs(few - np.round(few)) < 0.1).mean()) if len(few) > 10 else 0.0)
    return bool(shares) and float(np.median(shares)) > ON_LATTICE
