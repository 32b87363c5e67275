"""Checks of a log before anything is computed from it: all faults in one line, with the options that go on.

The log is compared with the model: wrong units, signs, order, gains and shifts in time show in a regression of the
torque, long before they would show as plausible but wrong parameters. A joint whose torque drives and model explain
has no fault of units, sign or order, however far it is from its commands. A fault that a user accepts is a note.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.model_faults import LEAST_RANGE, NOTE, Fault, check_against_model
from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.regression import Regression, list_unexplained
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.addons.gap.velocities import check_velocity, find_ratio, is_alike
from cmacexp.errors import BadInput, require
from cmacexp.typing import Array

LEAST_ROWS = 200
"""Least number of rows of a log."""
LARGEST = 1e100
"""Bound of all values of a log, in any unit: the square of a larger one could overflow."""
NORM_ERROR = 0.01
"""Tolerance of the norm of an orientation, a unit quaternion."""
LEAST_TURNS = 1
"""Least number of reversals of that motion, which tell friction from an offset."""
BEYOND = 0.1
"""Tolerance of the limits of the joints in the model, rad."""
SLOPES = (0.5, 1.4)
"""Least and largest slope of the measured over the commanded angle."""
MOST_APART = (0.1, 0.3)
"""Tolerance of the median of measured less commanded angle, since joints sag: rad, and relative to the range."""
MOST_APART_ROWS = 0.2
"""Mean motion from row to row over the range of a joint above which rows are no samples in order."""
COPIED = (1e-4, 0.1)
"""Distances below which angles and commands are copies: of the same row, over the largest range of commands; and of
angles from commands of the row before, over the motion from row to row."""
NEARER, MUCH_NEARER = 0.5, 0.3
"""Distance of a measured angle to the command of another joint, over that to the command of its own joint, below
which columns are exchanged: for both joints, and for only one of them."""
ADVANCE = 3.5
"""Motion between two rows, over speed times spacing, above which rows were lost and times were renumbered."""
SPIKE = 25.0
"""Second difference, over the 99th percentile of the joint, above which a value is an outlier."""
FROZEN = (0.15, 0.3, 0.1)
"""Limits of a frozen encoder: time at exactly one angle, s, motion of the command meanwhile over its range, and the
first step afterwards over that motion."""
CLIPPED = (3, 3, 0.15)
"""Limits of a clipped angle: number of stops of a moving joint at exactly its extreme angle, rows of each stop, and
speed just before it over the RMS speed: joints that stick by friction come to rest slowly."""
TICKS = 2.9
"""Least number of the smallest steps of an angle in one row that says that its joint moves, not just its encoder."""
UNSIGNED = (0.02, 0.01)
"""Torque over its largest value that counts as none, and share of rows with none: a magnitude returns to 0."""
MOST_TURNED = 4.0 * np.pi
"""Largest angle, rad, of a joint without limits whose torque drives and model do not explain."""


KINDS = (
    "copied", "scale", "zero", "order", "range", "clipped", "jump", "rest", "frozen", "lost", "rate", "unsigned",
    "torque", "delay", "sign", "model", "lean", "load", "damping", "gravity",
)  # fmt: skip
"""Kinds of faults that ``--accept`` makes notes."""
CAUSES = {
    "copied", "scale", "zero", "order", "range", "frozen", "clipped", "jump", "lost", "rate", "unsigned", "torque",
}  # fmt: skip
"""Kinds of faults after which a comparison with the model says nothing more."""


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
    ratio = find_ratio(log)
    for j in np.argsort(-np.ptp(log.angle, axis=0), kind="stable").tolist():  # those that move first
        faults += _check_angle(log, problem.machine, j, j in implausible, is_alike(ratio))
    if is_alike(ratio):
        faults = [fault for fault in faults if fault.kind != "jump"]  # it moved so
    else:
        faults += _check_lost_rows(log)
    faults += check_velocity(log, ratio)
    if log.torque is not None:
        faults += _check_torque(log, log.torque)
    outside = [k for k, fault in enumerate(faults) if fault.kind == "range"]
    for k in outside if 2 * len(outside) < len(log.joints) else ():  # limits of these: a unit is that of all
        faults[k] = Fault(NOTE, f"{faults[k].text[0].upper()}{faults[k].text[1:]}.")
    is_compared = not CAUSES.difference(accepted).intersection(fault.kind for fault in faults)
    if is_compared:
        faults += check_against_model(problem, regression)
    refused = [fault for fault in faults if fault.kind not in (NOTE, *accepted)]
    if refused:
        raise _refuse(log, refused, is_compared)
    notes = [*_note(log), *(fault.text for fault in faults if fault.kind == NOTE)]
    return notes + [f"Accepted ({fault.kind}): {fault.text}." for fault in faults if fault.kind != NOTE]


def _refuse(log: Log, faults: list[Fault], is_compared: bool) -> Unfit:
    """Return the error that names all faults, those of one kind by the first of them, and the options that go on.

    Unless it ``is_compared`` with the model already, that follows with these options.
    """
    by_kind = dict[str, list[Fault]]()
    options = dict[str, list[str]]()
    for fault in faults:
        by_kind.setdefault(fault.kind, []).append(fault)
        values = options.setdefault(fault.option, [])
        values += [value for value in [fault.value or fault.kind] if value not in values]
    more = {kind: f" (and {len(alike) - 1} more of this kind)" * (len(alike) > 1) for kind, alike in by_kind.items()}
    text = "; ".join(f"{alike[0].text}{more[kind]}" for kind, alike in by_kind.items())
    text += "; the log was not yet compared with the model" * (not is_compared)
    listed = " ".join(f"{option} {','.join(values)}" for option, values in options.items())
    kinds = ",".join(by_kind)
    accept = f"if the log is right, go on with --accept {kinds}"
    advice = accept if options.keys() == {"--accept"} else f"if so, go on with {listed}; {accept}"
    if len(options.get("--leave-out", ())) == len(log.joints):
        advice = f"this is so of all joints: take a longer log, or go on with --accept {kinds}"
        options = {"--accept": [*by_kind]}
    return Unfit(KEY, log.path, f"{text}; {advice}", options)


def drop_commands(log: Log) -> Log:
    """Return a log without its commands if they do not agree with the angles and are not needed; a note says so.

    They are not where torques are measured and gains unknown: they only show the lag.
    """
    if log.command is None or log.torque is None or log.has_gains:
        return log
    faults = [fault for fault in _check_pairs(log, log.command, range(len(log.joints))) if fault.kind != "copied"]
    if not faults:
        return log
    more = f" (and {len(faults) - 1} more)" * (len(faults) > 1)
    text = f"Commands are not used, since torques are logged: {faults[0].text}{more}."
    return replace(log, command=None, command_velocity=np.zeros_like(log.angle)).note(text)


def check_length(log: Log) -> None:
    """Check that a log has enough rows; raise BadInput."""
    rows = len(log.time)
    require(
        rows >= LEAST_ROWS, KEY, log.path, f"has {rows} rows, fewer than {LEAST_ROWS}: too short to identify anything"
    )


def check_values(log: Log) -> None:
    """Check that a log has enough rows, and finite values of plausible size; raise BadInput."""
    check_length(log)
    for quantity in ("time", "orientation", "angle", "command", "command_velocity", "torque", "feedforward"):
        values = vars(log)[quantity]
        for index in () if values is None else map(tuple, np.argwhere(~(np.abs(values) < LARGEST)).tolist()):
            name = quantity if quantity in ("time", "orientation") else log.column(quantity, index[1])
            raise BadInput(
                KEY,
                log.path,
                f"column {name} is {values[index]} in row {log.find_row(index[0])}: fill or cut such rows",
            )
    spans = np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    apart = np.median(np.abs(np.diff(log.angle, axis=0)).mean(axis=0) / spans)
    unordered = (
        f"moves by {100.0 * apart:.0f} % of the range of its joints from row to row: rows are no samples in order"
    )
    require(apart < MOST_APART_ROWS, KEY, log.path, unordered)
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
    step = np.sqrt((np.diff(log.angle, axis=0) ** 2).mean())
    for later, most in ((0, COPIED[0] * max(span.max(), 1e-9)), (1, COPIED[1] * step)):
        apart = log.angle[later:] - command[: len(command) - later]
        if np.sqrt((apart**2).mean()) < most:
            row = " of the next row" * later
            yield Fault("copied", f"column {commands[0]} and others hold the angles{row}: they are no commands")
            return
    products = (centred * log.angle).sum(axis=0)
    slopes = np.divide(products, (centred**2).sum(axis=0), out=np.ones_like(span), where=span > LEAST_RANGE)
    apart = np.abs(np.median(log.angle - command, axis=0))
    for j in sorted(unexplained):
        if not SLOPES[0] <= slopes[j] <= SLOPES[1]:
            mend = ("--accept", "")
            for key, values, ratio in (("angle", log.angle, np.pi / 180.0), ("command", command, 180.0 / np.pi)):
                if SLOPES[0] <= abs(slopes[j]) * ratio <= SLOPES[1] and np.abs(values[:, j]).max() > 2.0 * np.pi:
                    mend = ("--units", f"{key}=deg")
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


def _check_angle(log: Log, machine: Machine, j: int, is_unexplained: bool, is_in_rad: bool) -> Iterator[Fault]:
    """Yield faults of the measured angle of joint ``j``: unit, zero, stops, jumps and amount of motion.

    If drives and model do not explain its torque, a joint without limits turns by no more than MOST_TURNED,
    unless measured velocities say that it ``is_in_rad``.
    """
    joint = log.joints[j]
    name = log.column("angle", j)
    values = log.angle[:, j]
    low, high = machine.ranges[j]
    if is_unexplained and not machine.is_prismatic[j] and not is_in_rad:
        zero = 2.0 * np.pi * np.round(values.mean() / (2.0 * np.pi)) if np.isinf(high - low) else 0.0  # of an encoder
        low, high = max(low, zero - MOST_TURNED), min(high, zero + MOST_TURNED)
    speed = differentiate(values[:, None], log.period)[:, 0]
    moving = speed[np.abs(speed) > 0.1 * np.sqrt((speed**2).mean())]
    span = np.ptp(values)
    turns = np.count_nonzero(np.diff(np.sign(moving)))
    if span < LEAST_RANGE or turns < LEAST_TURNS:
        turned = "" if span < LEAST_RANGE else f" and turns {turns} times"
        yield Fault(
            "rest",
            f"joint {joint} moves {span:.2g} rad{turned}, which identifies neither its friction nor its inertia: "
            "move it, or leave it out",
            "--leave-out",
            joint,
        )
        return
    if not (low - BEYOND <= values.min() and values.max() <= high + BEYOND):
        inside = (low - BEYOND <= np.radians(values.min())) and np.radians(values.max()) <= high + BEYOND
        inside &= bool(np.abs(values).max() > 2.0 * np.pi)
        inside &= not is_in_rad
        units = "angle=deg" if log.command is None else "angle=deg,command=deg"
        mend = ("--units", units) if inside and not machine.is_prismatic[j] else ("--accept", "")
        is_limited = np.isfinite(machine.ranges[j]).any()
        allowed = f"should be from {low:.3g} to {high:.3g}" if is_limited else "has no limits, but turns less"
        yield Fault(
            "range",
            f"column {name} reaches from {values.min():.3g} to {values.max():.3g} rad, {machine.joints[j]} "
            f"{allowed}: check its unit (degrees: --units angle=deg,command=deg), zero and joint",
            *mend,
        )
    yield from _check_stops(log, j)
    bend = np.abs(np.diff(values, 2))
    row = int(bend.argmax()) + 1
    if bend.max() > max(SPIKE * np.percentile(bend, 99.0), 0.02 * span, 1e-6):
        yield Fault(
            "jump",
            f"column {name} jumps at row {log.find_row(row)} (t = {log.time[row]:.3f} s): an outlier, or the log was "
            "joined there",
        )


def _check_stops(log: Log, j: int) -> Iterator[Fault]:
    """Yield faults of an angle of joint ``j`` that is clipped, or frozen while its command moves.

    A joint that turns slows down as much in the rows before it as it takes to come to rest.
    """
    values = log.angle[:, j]
    name = log.column("angle", j)
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    begins, ends = np.append(0, edges), np.append(edges, len(values))
    steps = np.abs(np.diff(values, prepend=values[0]))
    stopped = (ends - begins >= CLIPPED[1]) & (begins > 1)
    tick = float(np.percentile(steps[steps > 0.0], 5.0)) if steps.any() else np.inf  # few are interpolated
    least = max(CLIPPED[2] * np.sqrt((steps[1:] ** 2).mean()), TICKS * tick)
    stopped &= (steps[begins - 1] > least) & (np.append(steps, 0.0)[ends] > least)
    slowing = (steps[np.maximum(begins - 4, 0)] - steps[begins - 1]) / 3.0
    stopped &= steps[begins - 1] > slowing * (ends - begins)
    for extreme in (values.min(), values.max()):
        clipped = begins[stopped & (values[begins] == extreme)]
        if len(clipped) >= CLIPPED[0]:
            yield Fault(
                "clipped",
                f"column {name} is clipped at {extreme:.4g} rad, {len(clipped)} times, first in row "
                f"{log.find_row(int(clipped[0]))}",
            )
    command = values if log.command is None else log.command[:, j]
    for k in np.flatnonzero(ends - begins >= max(3, round(FROZEN[0] / log.period))):
        way = np.ptp(command[begins[k] : ends[k]])
        returns = ends[k] < len(values) and steps[ends[k]] < FROZEN[2] * way  # it was stuck: an encoder would jump
        if way > FROZEN[1] * np.ptp(command) and not returns:
            yield Fault(
                "frozen",
                f"column {name} stays at {values[begins[k]]:.4g} from row {log.find_row(int(begins[k]))} "
                f"to {log.find_row(int(ends[k]) - 1)} while its command moves: a frozen encoder",
            )


def _check_lost_rows(log: Log) -> Iterator[Fault]:
    """Yield a fault if rows were lost and the times renumbered.

    All joints together would move several times as far in one row as in any row before and after it.
    """
    scaled = log.angle / np.maximum(np.ptp(log.angle, axis=0), LEAST_RANGE)
    steps = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
    reach = max(3, round(0.02 / log.period))
    if len(steps) <= 2 * reach:
        return
    around = np.lib.stride_tricks.sliding_window_view(steps, 2 * reach + 1)
    moved = steps[steps > 0.0] if steps.any() else np.ones(1)
    usual = max(float(np.median(moved)), TICKS * float(moved.min()))  # encoders of coarse steps stand still, too
    largest = np.maximum(np.delete(around, reach, axis=1).max(axis=1), usual)
    advance = around[:, reach] / largest
    row = int(advance.argmax()) + reach + 1
    if advance.max() > ADVANCE:
        yield Fault(
            "lost",
            f"the log moves {advance.max():.1f} times as far as around it from row {log.find_row(row - 1)} to "
            f"{log.find_row(row)} (t = {log.time[row]:.3f} s), one of {np.count_nonzero(advance > ADVANCE)} places: "
            "rows were lost and the times rewritten",
        )


def _check_torque(log: Log, torque: Array) -> Iterator[Fault]:
    """Yield faults of measured torques (n, J), N m: without signs, or unlike those of the drives."""
    is_none = np.abs(torque) < UNSIGNED[0] * np.abs(torque).max(axis=0)
    if not ((torque < 0.0).any() or is_none.mean() < UNSIGNED[1]) and torque.any():
        name = log.column("torque", 0)
        yield Fault("unsigned", f"column {name} and others are never below 0 and return to it: magnitudes of torques")
    if not log.has_drives:
        return
    measured = low_pass(torque, log.period)
    expected = low_pass(Signals(log).compute_torque(log.angle) + log.feedforward, log.period)
    slopes = (measured * expected).sum(axis=0) / np.maximum((expected * expected).sum(axis=0), 1e-12)
    for j in np.flatnonzero(~((slopes >= 0.75) & (slopes <= 1.3))).tolist():
        times = f"{slopes[j]:.3g} times what the gains give: check --kp and --kd, or its unit is another"
        yield Fault("torque", f"column {log.column('torque', j)} is {times}", "--units", "torque=unknown")


def _note(log: Log) -> Iterator[str]:
    """Yield notes on the limits of a log: commands that do not distinguish or excite joints."""
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
