"""What is wrong with a log, before anything is computed from it: each fault is one line that names column and row.

Faults of the log alone come first. Then the log is compared with the model: units, signs, order, gains and shifts in
time show in a regression of the torque, long before they would show as plausible but wrong parameters.
"""

from collections.abc import Iterator

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.gap.identify import Problem
from cmacexp.gap.log import KEY, Log
from cmacexp.gap.machine import Machine
from cmacexp.gap.signals import Signals, differentiate, low_pass
from cmacexp.typing import Array

LEAST_ROWS = 200
RATES = (20.0, 20_000.0)
"""Sampling rates of logs, Hz."""
NORM_ERROR = 0.01
"""By which the norm of an orientation, a unit quaternion, may differ from 1."""
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
    if len(log.time) < LEAST_ROWS:
        yield f"has {len(log.time)} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    found = {key: getattr(log, key) for key in ("time", "orientation", "angle", "command", "torque")}
    for quantity, values in ((key, own) for key, own in found.items() if own is not None):
        for place in map(tuple, np.argwhere(~np.isfinite(values)).tolist()):
            name = quantity if quantity in ("time", "orientation") else log.column(quantity, place[1])
            yield f"column {name} is {values[place]} in row {place[0]}: fill or cut such rows"
    if log.orientation is not None:
        norms = np.linalg.norm(log.orientation, axis=1)
        for row in np.flatnonzero(np.abs(norms - 1.0) > NORM_ERROR):
            yield f"orientation has the norm {norms[row]:.3g} in row {row}: must be 1"
    yield from _find_in_time(log)
    if log.command is not None:
        yield from _find_in_pairs(log, log.command)
    yield from _find_in_angles(log, machine)
    if log.torque is not None and log.command is not None and np.isfinite(log.kp).all():
        yield from _find_in_torque(log, log.torque)


def _find_in_time(log: Log) -> Iterator[str]:
    steps, period = np.diff(log.time), log.period
    for before in np.flatnonzero(steps <= 0.0):
        what = "repeats the time of" if steps[before] == 0.0 else "is earlier than"
        yield f"row {before + 1} {what} the row before it: sort the rows and remove those written twice"
    if not RATES[0] <= 1.0 / period <= RATES[1]:
        yield f"has {1.0 / period:.3g} rows a second, which robots do not have: say the unit of time, --units time=ms"
    for before in np.flatnonzero(steps > GAP * period):
        yield (
            f"lacks rows before row {before + 1} (t = {log.time[before + 1]:.3f} s): "
            f"{1e3 * steps[before]:.1f} ms instead of {1e3 * period:.1f} ms; cut the log there"
        )


def _find_in_pairs(log: Log, command: Array) -> Iterator[str]:
    """Measured beside commanded angles: units, signs, order."""
    span, centred = np.ptp(command, axis=0), command - command.mean(axis=0)
    names, others = ([log.column(each, j) for j in range(len(span))] for each in ("angle", "command"))
    if np.sqrt(((log.angle - command) ** 2).mean()) < 1e-4 * max(span.max(), 1e-9):
        yield f"column {names[0]} and others hold the commands, not measured angles"
    products = (centred * log.angle).sum(axis=0)
    slopes = np.divide(products, (centred**2).sum(axis=0), out=np.ones_like(span), where=span > LEAST_RANGE)
    for j in np.flatnonzero((slopes < SLOPES[0]) | (slopes > SLOPES[1])):
        if np.ptp(log.angle[:, j]) < 0.05 * span[j]:
            yield (
                f"column {names[j]} does not move while {others[j]} moves "
                f"{span[j]:.3g} rad: a frozen encoder or another joint"
            )
        elif slopes[j] < 0.0:
            yield (
                f"column {names[j]} moves against {others[j]} (slope {slopes[j]:.2f}): "
                "its sign or its joint is another"
            )
        else:
            in_degrees = abs(abs(np.log(slopes[j])) - np.log(180.0 / np.pi)) < 0.4
            hint = "one of them is in degrees, --units" if in_degrees else "units or joints differ"
            yield f"column {names[j]} moves {slopes[j]:.3g} times as far as {others[j]}: {hint}"
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in np.flatnonzero(apart > np.maximum(MOST_APART[0], MOST_APART[1] * span)):
        yield f"column {names[j]} is {apart[j]:.2g} rad apart from {others[j]} in the median: their zeros differ"
    distance = np.sqrt(((log.angle[:, :, None] - command[:, None, :]) ** 2).mean(axis=0))
    for a, b in enumerate(distance.argmin(axis=1)):
        if distance[a, b] < NEARER * distance[a, a] and distance[b, a] < NEARER * distance[b, b]:
            yield f"columns {names[a]} and {names[b]} seem to be exchanged: each follows the command of the other"
        elif distance[a, b] < 0.3 * distance[a, a]:
            yield f"column {names[a]} follows {others[b]} and not {others[a]}"


def _find_in_angles(log: Log, machine: Machine) -> Iterator[str]:
    speeds = differentiate(log.angle, log.period)
    moving = np.abs(speeds) > 0.1 * np.sqrt((speeds**2).mean(axis=0))
    for j, joint in enumerate(log.joints):
        name, values = log.column("angle", j), log.angle[:, j]
        low, high = machine.ranges[j]
        span, turns = np.ptp(values), np.count_nonzero(np.diff(np.sign(speeds[moving[:, j], j])))
        if values.min() < low - BEYOND or values.max() > high + BEYOND:
            inside = low - BEYOND <= values.min() * np.pi / 180.0 and values.max() * np.pi / 180.0 <= high + BEYOND
            hint = (
                "it looks like degrees: --units angle=deg,command=deg"
                if inside and span > 3.0
                else "check its unit, zero and joint"
            )
            yield (
                f"column {name} reaches from {values.min():.3g} to {values.max():.3g} rad, "
                f"{machine.joints[j]} of the model from {low:.3g} to {high:.3g}: {hint}"
            )
        yield from _find_stops(log, j)
        bend = np.abs(np.diff(values, 2))
        if bend.max() > max(SPIKE * np.percentile(bend, 99.0), 0.02 * span, 1e-6):
            row = int(bend.argmax()) + 1
            yield (
                f"column {name} jumps at row {row} (t = {log.time[row]:.3f} "
                "s): an outlier, or the log was joined there"
            )
        if span < LEAST_RANGE or turns < LEAST_TURNS:
            yield (
                f"joint {joint} moves {span:.2g} rad and turns {turns} times, which identifies neither its "
                f"friction nor its inertia: move it, or --leave-out {joint}"
            )
    yield from _find_lost_rows(log)


def _find_stops(log: Log, j: int) -> Iterator[str]:
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
            yield f"column {name} is clipped at {extreme:.4g} rad, {len(clipped)} times, first in row {clipped[0]}"
    command = values if log.command is None else log.command[:, j]
    for k in np.flatnonzero(ends - begins >= max(3, round(FROZEN[0] / log.period))):
        if np.ptp(command[begins[k] : ends[k]]) > FROZEN[1] * np.ptp(command):
            yield (
                f"column {name} stays at {values[begins[k]]:.4g} from row {begins[k]} "
                f"to {ends[k] - 1} while its command moves: a frozen encoder"
            )


def _find_lost_rows(log: Log) -> Iterator[str]:
    """A step of all joints together that is several times as long as their speed on both sides of it says."""
    scaled = log.angle / np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    reach = max(3, round(0.02 / log.period))
    place = np.arange(reach, len(scaled) - 1 - reach)
    step, whole = (scaled[place + 1 + k] - scaled[place - k] for k in (0, reach))
    around = (whole - step) / (2.0 * reach)
    size = (around**2).sum(axis=1)
    fast = size > 0.1 * np.percentile(size, 95.0)
    advance = np.divide((step * around).sum(axis=1), size, out=np.zeros_like(size), where=fast)
    if advance.max() > max(ADVANCE, 2.0 * np.percentile(advance, 99.0)):  # which is large of a noisy log
        row = int(place[advance.argmax()]) + 1
        yield (
            f"moves {advance.max():.1f} times as far as its speed from row {row - 1} to "
            f"{row} (t = {log.time[row]:.3f} s): rows were lost and the times written anew"
        )


def _find_in_torque(log: Log, torque: Array) -> Iterator[str]:
    """Measured torques must be those of the drives."""
    drives = Signals(log).compute_torque(log.angle) + log.feedforward
    a, b = low_pass(torque, log.period), low_pass(drives, log.period)
    slopes = (a * b).sum(axis=0) / np.maximum((b * b).sum(axis=0), 1e-12)
    for j in np.flatnonzero(~((slopes >= 0.75) & (slopes <= 1.3))).tolist():
        yield f"column {log.column('torque', j)} is {slopes[j]:.3g} times what the gains give: check --kp and --kd"


def check_against_model(problem: Problem) -> list[str]:
    """Compare a log with a model by a regression; notes on what the log cannot show, a sentence each.

    Raises BadInput where commands are shifted in time, gains or signs cannot be right, or nothing fits.
    """
    log, machine = problem.signals.log, problem.machine
    period, rows = log.period, slice(20, len(log.time) - 20)
    columns = np.concatenate([problem.rigid[..., None], problem.make_regressors(1)[..., [0, 1, 2, 4]]], axis=-1)
    filtered = low_pass(columns, period)
    delays = [0] if log.command is None else range(-round(0.06 / period), round(0.06 / period) + 1)
    found: list[tuple[float, float, Array, Array, int]] = []
    for delay in delays:
        torque = low_pass(Signals(log, delay).torque, period)[rows]
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
    notes = list(_note(log))
    gravity, known = weights[:, 0], errors[:, 0] < 0.3 * np.abs(weights[:, 0])
    for j in np.flatnonzero(known & (gravity < 0.0)):
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
    factor = float(np.average(gravity[known], weights=errors[known, 0] ** -2)) if known.any() else 1.0
    times = f"are {factor:.2f} times those of the rigid bodies of the model:"
    if not GRAVITY[0] <= factor <= GRAVITY[1]:
        raise refuse(f"torques {times} gains (--kp), units of torque, or masses are wrong by that")
    if not 0.8 <= factor <= 1.25:
        notes.append(f"Torques {times} masses, or gains, differ by that.")
    if log.command is not None and (viscous := float(np.median(weights[:, 2]))) > 0.4 * float(log.kd.mean()):
        notes.append(
            f"Viscous friction is {viscous:.2f} N m s/rad, much beside --kd {log.kd.mean():g}: check that gain."
        )
    return notes


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
