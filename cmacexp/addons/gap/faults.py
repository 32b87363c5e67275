"""Checks of a log before anything is computed from it: all faults in one line, with the options that go on.

The log is compared with the model: wrong units, signs, order, gains and shifts in time show in a regression of the
torque, long before they would show as plausible but wrong parameters. A joint whose torque drives and model explain
has no fault of units, sign or order, however far it is from its commands. A fault that a user accepts is a note.
"""

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.regression import DELAYS, GRAVITY, MOST_LEFT, Regression, list_unexplained
from cmacexp.addons.gap.signals import Signals, differentiate, is_quantised, low_pass
from cmacexp.errors import BadInput, require
from cmacexp.typing import Array

LEAST_ROWS = 200
"""Least number of rows of a log."""
LARGEST = 1e100
"""Bound of all values of a log, in any unit: the square of a larger one could overflow."""
NORM_ERROR = 0.01
"""Tolerance of the norm of an orientation, a unit quaternion."""
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
UNIT = (0.3, 3.0)
"""Ratios of torque for one joint, beyond which its measured torque is in another unit: a payload changes less."""
MOST_TURNED = 4.0 * np.pi
"""Largest angle, rad, of a joint without limits whose torque drives and model do not explain."""


KINDS = (
    "copied", "scale", "zero", "order", "range", "clipped", "jump", "rest", "frozen", "lost", "torque", "delay",
    "sign", "model", "damping", "gravity",
)  # fmt: skip
"""Kinds of faults that ``--accept`` makes notes."""
CAUSES = {"copied", "scale", "zero", "order", "range", "frozen", "clipped", "jump", "lost", "torque"}
"""Kinds of faults after which a comparison with the model says nothing more."""
NOTE = "note"
"""Kind of what is no fault, and only noted."""


class Fault(NamedTuple):
    """A fault of a log: its kind, what it is, and the option and value that go on."""

    kind: str
    text: str
    option: str = "--accept"
    value: str = ""


class Unfit(BadInput):
    """A log with faults; ``options`` are those that go on, with their values."""

    def __init__(self, key: str, value: object, allowed: str, options: dict[str, list[str]]):
        super().__init__(key, value, allowed)
        self.args = (*self.args, options)  # as for BadInput
        self.options = options


def check(problem: Problem, regression: Regression, accepted: Collection[str] = ()) -> list[str]:
    """Check a log by itself and against a model, and return notes on its limits, one sentence each.

    Faults of a kind of KINDS in ``accepted`` are notes. Raises BadInput with all other faults in one line.
    """
    log = problem.signals.log
    implausible = list_unexplained(problem, regression)
    unexplained = implausible if log.has_drives else set(range(len(log.joints)))
    faults = [] if log.command is None else list(_check_pairs(log, log.command, unexplained))
    for j in range(len(log.joints)):
        faults += _check_angle(log, problem.machine, j, j in implausible)
    faults += _check_lost_rows(log)
    if log.torque is not None and log.has_drives:
        faults += _check_torque(log, log.torque)
    if log.is_unit_known and not CAUSES.difference(accepted).intersection(fault.kind for fault in faults):
        faults += _check_against_model(problem, regression)
    refused = [fault for fault in faults if fault.kind not in (NOTE, *accepted)]
    if refused:
        raise _refuse(log, refused)
    notes = [*_note(log), *(fault.text for fault in faults if fault.kind == NOTE)]
    return notes + [f"Accepted ({fault.kind}): {fault.text}." for fault in faults if fault.kind != NOTE]


def _refuse(log: Log, faults: list[Fault]) -> Unfit:
    """Return the error that names all faults, those of one kind by the first of them, and the options that go on."""
    by_kind = dict[str, list[Fault]]()
    options = dict[str, list[str]]()
    for fault in faults:
        by_kind.setdefault(fault.kind, []).append(fault)
        values = options.setdefault(fault.option, [])
        values += [value for value in [fault.value or fault.kind] if value not in values]
    more = {kind: f" (and {len(alike) - 1} more of this kind)" * (len(alike) > 1) for kind, alike in by_kind.items()}
    text = "; ".join(f"{alike[0].text}{more[kind]}" for kind, alike in by_kind.items())
    listed = " ".join(f"{option} {','.join(values)}" for option, values in options.items())
    kinds = ",".join(by_kind)
    accept = f"if the log is right, go on with --accept {kinds}"
    advice = accept if options.keys() == {"--accept"} else f"if so, go on with {listed}; {accept}"
    if len(options.get("--leave-out", ())) == len(log.joints):
        advice = f"this is so of all joints: take a longer log, or go on with --accept {kinds}"
        options = {"--accept": [*by_kind]}
    return Unfit(KEY, log.path, f"{text}; {advice}", options)


def check_values(log: Log) -> None:
    """Check that a log has enough rows, and finite values of plausible size; raise BadInput."""
    rows = len(log.time)
    require(
        rows >= LEAST_ROWS, KEY, log.path, f"has {rows} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    )
    for quantity in ("time", "orientation", "angle", "command", "command_velocity", "torque", "feedforward"):
        values = vars(log)[quantity]
        for index in () if values is None else map(tuple, np.argwhere(~(np.abs(values) < LARGEST)).tolist()):
            name = quantity if quantity in ("time", "orientation") else log.column(quantity, index[1])
            raise BadInput(
                KEY, log.path, f"column {name} is {values[index]} in row {index[0]}: fill or cut such rows"
            )
    if log.orientation is not None:
        norms = np.linalg.norm(log.orientation, axis=1)
        for row in np.flatnonzero(np.abs(norms - 1.0) > NORM_ERROR):
            raise BadInput(KEY, log.path, f"orientation has the norm {norms[row]:.3g} in row {row}: must be 1")


def _check_pairs(log: Log, command: Array, unexplained: Collection[int]) -> Iterator[Fault]:
    """Yield faults of units, signs, zeros and order of the measured angles against the commands (n, J), rad.

    Only joints whose torque is ``unexplained`` by drives and model, given by number, have such faults.
    """
    span = np.ptp(command, axis=0)
    centred = command - command.mean(axis=0)
    angles, commands = ([log.column(quantity, j) for j in range(len(span))] for quantity in ("angle", "command"))
    if np.sqrt(((log.angle - command) ** 2).mean()) < 1e-4 * max(span.max(), 1e-9):
        yield Fault("copied", f"column {angles[0]} and others hold the commands, not measured angles")
        return
    products = (centred * log.angle).sum(axis=0)
    slopes = np.divide(products, (centred**2).sum(axis=0), out=np.ones_like(span), where=span > LEAST_RANGE)
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in sorted(unexplained):
        if not SLOPES[0] <= slopes[j] <= SLOPES[1]:
            ratio = abs(slopes[j]) * np.pi / 180.0
            in_degrees = SLOPES[0] <= ratio <= SLOPES[1]
            mend = ("--units", "angle=deg") if in_degrees else ("--accept", "")
            yield Fault(
                "scale",
                f"column {angles[j]} moves {slopes[j]:.3g} times as far as {commands[j]}, which drives and model do "
                "not explain: one of them is in degrees (57.3 or 0.0175: --units), its sign or joint is another "
                "(below 0), or its encoder is frozen (near 0)",
                *mend,
            )
        elif apart[j] > max(MOST_APART[0], MOST_APART[1] * span[j]):
            yield Fault(
                "zero",
                f"column {angles[j]} is {apart[j]:.2g} rad apart from {commands[j]} in the median: their zeros "
                "differ",
            )
    distance = np.sqrt(((log.angle[:, :, None] - command[:, None, :]) ** 2).mean(axis=0))
    for a, b in enumerate(distance.argmin(axis=1)):
        both_nearer = distance[a, b] < NEARER * distance[a, a] and distance[b, a] < NEARER * distance[b, b]
        if a in unexplained and (both_nearer or distance[a, b] < MUCH_NEARER * distance[a, a]):
            yield Fault(
                "order", f"column {angles[a]} follows {commands[b]} and not {commands[a]}: are columns exchanged?"
            )


def _check_angle(log: Log, machine: Machine, j: int, is_unexplained: bool) -> Iterator[Fault]:
    """Yield faults of the measured angle of joint ``j``: unit, zero, stops, jumps and amount of motion.

    If drives and model do not explain its torque, a joint without limits turns by no more than MOST_TURNED.
    """
    joint = log.joints[j]
    name = log.column("angle", j)
    values = log.angle[:, j]
    low, high = machine.ranges[j]
    if is_unexplained and not machine.is_prismatic[j]:
        low, high = max(low, -MOST_TURNED), min(high, MOST_TURNED)
    speed = differentiate(values[:, None], log.period)[:, 0]
    moving = speed[np.abs(speed) > 0.1 * np.sqrt((speed**2).mean())]
    span = np.ptp(values)
    turns = np.count_nonzero(np.diff(np.sign(moving)))
    if span < LEAST_RANGE or turns < LEAST_TURNS:
        yield Fault(
            "rest",
            f"joint {joint} moves {span:.2g} rad and turns {turns} times, which identifies neither its friction nor "
            "its inertia: move it, or leave it out",
            "--leave-out",
            joint,
        )
        return
    if not (low - BEYOND <= values.min() and values.max() <= high + BEYOND):
        inside = (low - BEYOND <= np.radians(values.min())) and np.radians(values.max()) <= high + BEYOND
        units = "angle=deg" if log.command is None else "angle=deg,command=deg"
        mend = ("--units", units) if inside and not machine.is_prismatic[j] else ("--accept", "")
        yield Fault(
            "range",
            f"column {name} reaches from {values.min():.3g} to {values.max():.3g} rad, {machine.joints[j]} "
            f"should be from {low:.3g} to {high:.3g}: check its unit (degrees: --units angle=deg,command=deg), zero "
            "and joint",
            *mend,
        )
    yield from _check_stops(log, j)
    bend = np.abs(np.diff(values, 2))
    row = int(bend.argmax()) + 1
    if bend.max() > max(SPIKE * np.percentile(bend, 99.0), 0.02 * span, 1e-6):
        yield Fault(
            "jump",
            f"column {name} jumps at row {row} (t = {log.time[row]:.3f} s): an outlier, or the log was joined there",
        )


def _check_stops(log: Log, j: int) -> Iterator[Fault]:
    """Yield faults of an angle of joint ``j`` that is clipped, or frozen while its command moves."""
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
            yield Fault(
                "clipped",
                f"column {name} is clipped at {extreme:.4g} rad, {len(clipped)} times, first in row {clipped[0]}",
            )
    command = values if log.command is None else log.command[:, j]
    for k in np.flatnonzero(ends - begins >= max(3, round(FROZEN[0] / log.period))):
        if np.ptp(command[begins[k] : ends[k]]) > FROZEN[1] * np.ptp(command):
            yield Fault(
                "frozen",
                f"column {name} stays at {values[begins[k]]:.4g} from row {begins[k]} "
                f"to {ends[k] - 1} while its command moves: a frozen encoder",
            )


def _check_lost_rows(log: Log) -> Iterator[Fault]:
    """Yield a fault if rows were lost and the times renumbered.

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
    worst = advance.max()  # much above those of rows that move: an encoder of coarse steps stands still between them
    if worst > ADVANCE and worst > 2.0 * np.percentile(advance[advance > 0.0], 99.0):
        yield Fault(
            "lost",
            f"the log moves {worst:.1f} times as far as its speed from row {row - 1} to "
            f"{row} (t = {log.time[row]:.3f} s): rows were lost and the times rewritten",
        )


def _check_torque(log: Log, torque: Array) -> Iterator[Fault]:
    """Yield faults of measured torques (n, J), N m, that do not agree with those of the drives."""
    measured = low_pass(torque, log.period)
    expected = low_pass(Signals(log).compute_torque(log.angle) + log.feedforward, log.period)
    slopes = (measured * expected).sum(axis=0) / np.maximum((expected * expected).sum(axis=0), 1e-12)
    for j in np.flatnonzero(~((slopes >= 0.75) & (slopes <= 1.3))).tolist():
        times = f"{slopes[j]:.3g} times what the gains give: check --kp and --kd, or its unit is another"
        yield Fault("torque", f"column {log.column('torque', j)} is {times}", "--units", "torque=unknown")


def _check_against_model(problem: Problem, regression: Regression) -> Iterator[Fault]:
    """Yield faults that a regression of the log on the model shows: times, gains, signs, or too little explained."""
    log = problem.signals.log
    late = regression.delay
    if log.has_drives and not DELAYS[0] <= late <= DELAYS[1]:
        yield Fault(
            "delay",
            f"commands fit best {1e3 * abs(late):.0f} ms {'later' if late > 0 else 'earlier'} than they are written: "
            "their times are shifted, or --kp or --kd is wrong",
        )
    gravity = regression.weights[:, 0]
    for j in np.flatnonzero(regression.is_certain & (gravity < 0.0)):
        yield Fault(
            "sign",
            f"torque of {log.joints[j]} grows where the model of {problem.machine.joints[j]} says "
            f"that it falls (factor {gravity[j]:.2f}): its sign, side or joint is another",
        )
    power = (problem.signals.torque**2).mean(axis=0)
    whole = float(np.sqrt((regression.left**2 * power).sum() / max(float(power.sum()), 1e-12)))
    if whole > MOST_LEFT:
        yield Fault(
            "model",
            f"the model leaves {100.0 * whole:.0f} % of its torque unexplained: order, signs or units of joints, or "
            "--robot, are wrong, or its base was not level or moved, or its feet touched the ground",
        )
    viscous = regression.weights[:, 2]
    for j in np.flatnonzero(regression.has_negative_friction(log) & log.has_drives):
        yield Fault(
            "damping",
            f"viscous friction of {log.joints[j]} comes out as {viscous[j]:.2g} "
            f"N m s/rad, below zero: --kd {log.kd[j]:g} is too large",
        )
    yield from _check_gravity(problem, regression)
    if log.has_drives and (median := float(np.median(viscous))) > 0.4 * float(log.kd.mean()):
        text = f"Viscous friction is {median:.2f} N m s/rad, much beside --kd {log.kd.mean():g}: check that gain."
        yield Fault(NOTE, text)


def _check_gravity(problem: Problem, regression: Regression) -> Iterator[Fault]:
    """Yield faults of torques in proportion to those of the rigid bodies of the model.

    Ratios that are small or unknown are notes.
    """
    log = problem.signals.log
    gravity = regression.weights[:, 0]
    certain = regression.is_certain
    precision = regression.errors[certain, 0] ** -2
    factor = float(np.average(gravity[certain], weights=precision)) if certain.any() else 1.0
    times = f"are {factor:.2f} times those of the rigid bodies of the model:"
    if not GRAVITY[0] <= factor <= GRAVITY[1]:
        mend = ("--units", "torque=unknown") if problem.signals.is_measured else ("--accept", "")
        yield Fault("gravity", f"torques {times} gains (--kp), units of torque, or masses are wrong by that", *mend)
    elif not 0.8 <= factor <= 1.25:
        yield Fault(NOTE, f"Torques {times} masses, or gains, differ by that.")
    if not problem.signals.is_measured or log.has_drives:
        return  # the drives give the unit
    for j in np.flatnonzero(certain & (gravity > 0.0) & ((gravity < UNIT[0]) | (gravity > UNIT[1]))):
        yield Fault(
            "gravity",
            f"torque of {log.joints[j]} is {gravity[j]:.2f} times that of the rigid bodies of the model: its unit is "
            "another",
            "--units",
            "torque=unknown",
        )
    if unknown := [log.joints[j] for j in np.flatnonzero(~certain)]:
        yield Fault(
            NOTE,
            f"Nothing in this log shows whether the torques of {', '.join(unknown)} are in N m: the rigid bodies are "
            "too light or move too little, and there are no gains.",
        )


def _note(log: Log) -> Iterator[str]:
    """Yield notes on the limits of a log: filtered angles, and commands that do not distinguish or excite joints."""
    if not is_quantised(log):
        yield (
            "The angles show no step of an encoder: they were filtered, resampled or "
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
