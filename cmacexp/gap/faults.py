"""What is wrong with a log, before anything is computed from it: each fault is one line that names column and row.

Faults of the log alone come first. Then the log is compared with the model: units, signs, order, gains and shifts in
time show in a regression of the torque, long before they would show as plausible but wrong parameters.
"""

from collections.abc import Iterator

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.gap.identify import Level, Problem, make_regressors
from cmacexp.gap.log import KEY, Log
from cmacexp.gap.machine import Machine
from cmacexp.gap.signals import Signals, differentiate, low_pass
from cmacexp.typing import Array

LEAST_ROWS = 200
RATES = (20.0, 20_000.0)
"""Sampling rates of logs, Hz."""
GAP = 1.6
"""Spacing of two rows, over the median, from which rows are missing."""
LEAST_RANGE, LEAST_TURNS = 0.02, 4
"""Motion of a joint that shows anything of it: its range, rad, and how often it turns."""
BEYOND = 0.1
"""By which angles of a robot may lie beyond the limits of its model, rad."""
SLOPES = (0.5, 1.4)
"""Of measured over commanded angles."""
MOST_APART = (0.1, 0.3)
"""Median distance of measured and commanded angles, rad, and over the range, that a sagging joint may have."""
NEARER = 0.5
"""Distance of a measured angle to the command of another joint, over that to its own, that shows an exchange."""
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
    for fault in _find(log, machine):
        raise BadInput(KEY, log.path, fault)


def _find(log: Log, machine: Machine) -> Iterator[str]:
    signals = {"angle": log.angle, "command": log.command, "velocity": log.velocity, "torque": log.torque}
    if len(log.time) < LEAST_ROWS:
        yield f"has {len(log.time)} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    for quantity, values in {**signals, "time": log.time[:, None], "orientation": log.orientation}.items():
        if values is not None and not np.isfinite(values).all():
            row, joint = np.argwhere(~np.isfinite(values))[0]
            name = log.column(quantity, joint) if quantity in signals else quantity
            yield f"column {name} is {values[row, joint]} in row {row}: fill or cut such rows"
    yield from _find_in_time(log)
    if log.command is not None:
        yield from _find_in_pairs(log, log.command)
    yield from _find_in_angles(log, machine)
    if log.velocity is not None:
        yield from _compare(
            log, "velocity", log.velocity, differentiate(log.angle, log.period), "the slope of the angles"
        )
    if log.torque is not None and log.command is not None and np.isfinite(log.kp).all():
        own = Signals(log).compute_torque(log.angle) + log.feedforward
        yield from _compare(log, "torque", log.torque, own, "what the gains give: check --kp and --kd")


def _find_in_time(log: Log) -> Iterator[str]:
    steps, period = np.diff(log.time), log.period
    if (steps <= 0.0).any():
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        what = "repeats the time of" if steps[row - 1] == 0.0 else "is earlier than"
        yield f"row {row} {what} the row before it: sort the rows and remove those written twice"
    if not RATES[0] <= 1.0 / period <= RATES[1]:
        yield f"has {1.0 / period:.3g} rows a second, which robots do not have: say the unit of time, --units time=ms"
    if (steps > GAP * period).any():
        row = int(np.flatnonzero(steps > GAP * period)[0]) + 1
        yield (
            f"lacks rows before row {row} (t = {log.time[row]:.3f} s): "
            f"{1e3 * steps[row - 1]:.1f} ms instead of {1e3 * period:.1f} ms; cut the log there"
        )


def _find_in_pairs(log: Log, command: Array) -> Iterator[str]:
    """Measured beside commanded angles: units, signs, order."""
    span = np.ptp(command, axis=0)
    if np.sqrt(((log.angle - command) ** 2).mean()) < 1e-4 * max(span.max(), 1e-9):
        yield f"column {log.column('angle', 0)} and others hold the commands, not measured angles"
    slopes = np.full(len(span), 1.0)
    for j in np.flatnonzero(span > LEAST_RANGE).tolist():
        slopes[j] = np.polyfit(command[:, j], log.angle[:, j], 1)[0]
    for j in np.flatnonzero((slopes < SLOPES[0]) | (slopes > SLOPES[1])).tolist():
        name, other = log.column("angle", j), log.column("command", j)
        if np.ptp(log.angle[:, j]) < 0.05 * span[j]:
            yield (
                f"column {name} does not move while {other} moves "
                f"{span[j]:.3g} rad: a frozen encoder or another joint"
            )
        elif slopes[j] < 0.0:
            yield f"column {name} moves against {other} (slope {slopes[j]:.2f}): its sign or its joint is another"
        else:
            turned = abs(np.log(slopes[j] * np.pi / 180.0)) < 0.4 or abs(np.log(slopes[j] * 180.0 / np.pi)) < 0.4
            hint = "one of them is in degrees, --units" if turned else "units or joints differ"
            yield f"column {name} moves {slopes[j]:.3g} times as far as {other}: {hint}"
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in np.flatnonzero(apart > np.maximum(MOST_APART[0], MOST_APART[1] * span)).tolist():
        name, other = log.column("angle", j), log.column("command", j)
        yield f"column {name} is {apart[j]:.2g} rad apart from {other} in the median: their zeros differ"
    distance = np.sqrt(((log.angle[:, :, None] - command[:, None, :]) ** 2).mean(axis=0))
    for a in range(len(span)):
        b = int(distance[a].argmin())
        if distance[a, b] < NEARER * distance[a, a] and distance[b, a] < NEARER * distance[b, b]:
            yield (
                f"columns {log.column('angle', a)} and {log.column('angle', b)} "
                "seem to be exchanged: each follows the command of the other"
            )
        elif distance[a, b] < 0.3 * distance[a, a]:
            yield (
                f"column {log.column('angle', a)} follows "
                f"{log.column('command', b)} and not {log.column('command', a)}"
            )


def _find_in_angles(log: Log, machine: Machine) -> Iterator[str]:
    for j in range(log.angle.shape[1]):
        name, values = log.column("angle", j), log.angle[:, j]
        low, high = machine.ranges[j]
        if values.min() < low - BEYOND or values.max() > high + BEYOND:
            inside = low - BEYOND <= values.min() * np.pi / 180.0 and values.max() * np.pi / 180.0 <= high + BEYOND
            hint = (
                "it looks like degrees: --units angle=deg,command=deg"
                if inside and np.ptp(values) > 3.0
                else "check its unit, zero and joint"
            )
            yield (
                f"column {name} reaches from {values.min():.3g} to {values.max():.3g} rad, "
                f"{machine.joints[j]} of the model from {low:.3g} to {high:.3g}: {hint}"
            )
        yield from _find_stops(log, j)
        bend = np.abs(np.diff(values, 2))
        if bend.max() > max(SPIKE * np.percentile(bend, 99.0), 0.02 * np.ptp(values), 1e-6):
            row = int(bend.argmax()) + 1
            yield (
                f"column {name} jumps at row {row} (t = {log.time[row]:.3f} "
                "s): an outlier, or the log was joined there"
            )
    yield from _find_lost_rows(log)
    for j in range(log.angle.shape[1]):
        span, speed = np.ptp(log.angle[:, j]), differentiate(log.angle[:, [j]], log.period)[:, 0]
        moving = speed[np.abs(speed) > 0.1 * np.sqrt((speed**2).mean())]
        turns = int((np.diff(np.sign(moving)) != 0).sum())
        if span < LEAST_RANGE or turns < LEAST_TURNS:
            moved = f"moves {span:.2g} rad and turns {turns} times"
            yield (
                f"joint {log.joints[j]} {moved}, which identifies neither its "
                f"friction nor its inertia: move it, or --leave-out {log.joints[j]}"
            )


def _find_stops(log: Log, j: int) -> Iterator[str]:
    """Values that stay exactly the same while the joint is told to move."""
    values, name = log.angle[:, j], log.column("angle", j)
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    begins, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(values)]])
    command = None if log.command is None else log.command[:, j]
    least = max(3, round(FROZEN[0] / log.period))
    for extreme in (values.min(), values.max()):
        held = [(b, e) for b, e in zip(begins, ends, strict=True) if values[b] == extreme and e - b >= CLIPPED[1]]
        fast = CLIPPED[2] * np.sqrt((np.diff(values) ** 2).mean())
        moved = [b for b, e in held if b > 1 and abs(values[b - 1] - values[b - 2]) > fast]
        if len(moved) >= CLIPPED[0]:
            yield f"column {name} is clipped at {extreme:.4g} rad, {len(moved)} times, first in row {moved[0]}"
    for begin, end in zip(begins, ends, strict=True):
        if command is not None and end - begin >= least and np.ptp(command[begin:end]) > FROZEN[1] * np.ptp(command):
            yield (
                f"column {name} stays at {values[begin]:.4g} from row {begin} "
                f"to {end - 1} while its command moves: a frozen encoder"
            )


def _find_lost_rows(log: Log) -> Iterator[str]:
    """A step of all joints together that is several times as long as their speed on both sides of it says."""
    scaled = log.angle / np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    reach = max(3, round(0.02 / log.period))
    steps = np.diff(scaled, axis=0)
    total = np.cumsum(np.concatenate([np.zeros((1, steps.shape[1])), steps]), axis=0)
    place = np.arange(reach, len(steps) - reach)
    around = (total[place] - total[place - reach] + total[place + 1 + reach] - total[place + 1]) / (2.0 * reach)
    size = (around**2).sum(axis=1)
    fast = size > 0.1 * np.percentile(size, 95.0)
    advance = np.where(fast, (steps[place] * around).sum(axis=1) / np.where(fast, size, 1.0), 0.0)
    usual = np.percentile(advance, 99.0)  # of a noisy log it is large
    if advance.max() > max(ADVANCE, 2.0 * usual):
        row = int(place[advance.argmax()]) + 1
        yield (
            f"moves {advance.max():.1f} times as far as its speed from row {row - 1} to "
            f"{row} (t = {log.time[row]:.3f} s): rows were lost and the times written anew"
        )


def _compare(log: Log, quantity: str, values: Array, expected: Array, what: str) -> Iterator[str]:
    """Signals (n, J) that must be those that follow from others."""
    for j in range(values.shape[1]):
        a, b = low_pass(values[:, [j]], log.period)[:, 0], low_pass(expected[:, [j]], log.period)[:, 0]
        slope = float(a @ b) / max(float(b @ b), 1e-12)
        if not 0.75 <= slope <= 1.3:
            yield f"column {log.column(quantity, j)} is {slope:.3g} times {what}"


def check_against_model(problem: Problem) -> list[str]:
    """Compare a log with a model by a regression; notes on what the log cannot show, a sentence each.

    Raises BadInput where commands are shifted in time, gains or signs cannot be right, or nothing fits.
    """
    signals, log, machine = problem.signals, problem.signals.log, problem.machine
    period, level = log.period, Level("", 1, offset=True)
    columns = np.concatenate([problem.rigid[..., None], make_regressors(problem, level)[..., [0, 1, 2, 4]]], axis=-1)
    filtered, rows = low_pass(columns, period), slice(20, len(log.time) - 20)
    delays = [0] if log.command is None else range(-round(0.06 / period), round(0.06 / period) + 1)
    found: list[tuple[float, float, Array, Array, int]] = []
    for delay in delays:
        torque = low_pass(Signals(log, delay).torque if log.command is not None else signals.torque, period)[rows]
        left, weights, errors = _solve(filtered[rows], torque)
        distance = left if log.torque is None else float(np.abs(low_pass(log.torque, period)[rows] - torque).mean())
        found.append((distance, left, weights, errors, delay))
    # Where the drives' torque is known their law is compared with that: friction that sticks looks like a delay.
    _, left, weights, errors, delay = min(found, key=lambda each: each[0])

    def refuse(reason: str) -> BadInput:
        return BadInput(KEY, log.path, reason)

    if not DELAYS[0] <= delay * period <= DELAYS[1]:
        raise refuse(
            f"commands fit best {1e3 * abs(delay * period):.0f} ms "
            f"{'later' if delay > 0 else 'earlier'} than they are written: their times are shifted, or "
            "--kp or --kd is wrong"
        )
    notes = _note(log)
    gravity = np.where(errors[:, 0] < 0.3 * np.abs(weights[:, 0]), weights[:, 0], np.nan)
    for j in np.flatnonzero(gravity < 0.0):
        raise refuse(
            f"torque of {log.joints[j]} grows where the model of {machine.joints[j]} says "
            f"that it falls (factor {gravity[j]:.2f}): its sign, side or joint is another"
        )
    if left > MOST_LEFT:
        raise refuse(
            f"the model explains its torque only to {100.0 * left:.0f} "
            "%: order, signs or units of joints, or --robot, are wrong"
        )
    too_low = weights[:, 2] + 2.0 * errors[:, 2] < NEGATIVE * log.kd
    for j in np.flatnonzero(too_low & (log.command is not None)):
        raise refuse(
            f"viscous friction of {log.joints[j]} comes out as {weights[j, 2]:.2g} "
            f"N m s/rad, below zero: --kd {log.kd[j]:g} is too large"
        )
    if np.isfinite(gravity).any():
        known = np.isfinite(gravity)
        factor = float(np.average(gravity[known], weights=errors[known, 0] ** -2))
        if not GRAVITY[0] <= factor <= GRAVITY[1]:
            raise refuse(
                f"torques are {factor:.2f} times those of the rigid bodies of the "
                "model: gains (--kp), units of torque, or masses are wrong by that"
            )
        if not 0.8 <= factor <= 1.25:
            notes.append(
                f"Torques are {factor:.2f} times those of the rigid "
                "bodies of the model: masses, or gains, differ by that."
            )
    if log.command is not None and (viscous := float(np.median(weights[:, 2]))) > 0.4 * float(log.kd.mean()):
        notes.append(
            f"Viscous friction is {viscous:.2f} N m s/rad, much beside --kd {log.kd.mean():g}: check that gain."
        )
    return notes


def _solve(columns: Array, torque: Array) -> tuple[float, Array, Array]:
    """Part of the torque that is left, weights (J, P), and their standard errors with correlated errors."""
    weights, errors, rest, total = [], [], 0.0, 0.0
    for j in range(torque.shape[1]):
        a, b = columns[:, j], torque[:, j]
        own, *_ = np.linalg.lstsq(a, b, rcond=None)
        error = b - a @ own
        independent = max(len(b) / 40.0, 2.0 * a.shape[1])
        spread = np.linalg.pinv(a.T @ a / len(b)) * (error**2).mean() / independent
        weights.append(own)
        errors.append(np.sqrt(np.maximum(np.diag(spread), 1e-18)))
        rest, total = rest + float((error**2).sum()), total + float((b**2).sum())
    return (rest / max(total, 1e-12)) ** 0.5, np.array(weights), np.array(errors)


def _note(log: Log) -> list[str]:
    """What the log cannot show, and what was done to it."""
    notes = []
    if not _is_quantised(log):
        notes.append(
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
            notes.append(
                f"Joints with equal or mirrored commands ({listed}): nothing "
                "in this log shows whether their columns are exchanged."
            )
        if len(log.joints) > 1 and alike.all():
            notes.append("All commands are one signal (rank 1): what joints do to each other is not excited.")
    return notes


def _is_quantised(log: Log) -> bool:
    """Whether measured angles lie on the lattice of an encoder."""
    shares = []
    for values in log.angle.T:
        steps = np.abs(np.diff(values))
        steps = steps[steps > 1e-6]
        if len(steps) > 20:
            step = float(steps.min())
            few = steps[steps < 20.0 * step] / step
            shares.append(float((np.abs(few - np.round(few)) < 0.1).mean()) if len(few) > 10 else 0.0)
    return bool(shares) and float(np.median(shares)) > ON_LATTICE
