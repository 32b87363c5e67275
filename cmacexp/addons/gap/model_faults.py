"""Faults of a log that show against the model of its machine: times, gains, signs, units, or too little explained."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.regression import DELAYS, GRAVITY, MOST_LEFT, Regression, fit_gravity, fit_load

ALIKE = 0.3
"""Largest distance of the factor of a joint from the median, over that, that another unit makes; a load changes those
of joints near it more."""
LEAN_LIKE = {"sign", "model", "gravity"}
"""Kinds of faults that a base which leans, or a load, looks like."""
OPPOSITE = 2
"""Joints whose torque has the opposite sign, over those with the right one, above which all count the other way."""
LEAST_LEAN = 5.0
"""Least lean of a base that is named, degrees."""
UPSIDE_DOWN = 150.0
"""Roll from which a base that leans looks like torques of the opposite sign, degrees."""
BETTER = 0.6
"""Part of the torque that is left with a cause, over that without it, below which it is the cause."""
LIKE_GRAVITY = 0.15
"""Largest relative difference of estimated gravity from that of the model with which it is gravity."""
LEAST_TURN = 0.1
"""Least range of the motion of a joint whose torque says whether its sign and size are right, rad."""
NEGATIVE_SHARE = 0.3
"""Share of a measured torque that viscous friction below zero takes at the RMS speed, above which it is a fault."""
LEAST_RANGE = 0.02
"""Least range of the motion of a joint that identifies anything of it, rad."""
UNIT = (0.3, 3.0)
"""Ratios of torque for one joint, beyond which its measured torque is in another unit: a payload changes less."""
NOTE = "note"
"""Kind of what is no fault, and only noted."""


class Fault(NamedTuple):
    """A fault of a log: its kind, what it is, and the option and value that go on."""

    kind: str
    text: str
    option: str = "--accept"
    value: str = ""


def check_against_model(problem: Problem, regression: Regression) -> list[Fault]:
    """Return faults that a regression of the log on the model shows: times, gains, signs, or too little explained.

    A base that leans, and a load, are named in place of what they look like.
    """
    faults = list(_compare(problem, regression))
    if not LEAN_LIKE.intersection(fault.kind for fault in faults) or problem.machine.model is None:
        return faults
    power = (problem.signals.torque**2).mean(axis=0)
    level = float(np.sqrt((regression.left_as_modelled**2 * power).sum() / max(float(power.sum()), 1e-12)))
    most = min(MOST_LEFT, BETTER * level)
    cause = _find_lean(problem, most) or _find_load(problem, most)
    return faults if cause is None else [*(fault for fault in faults if fault.kind not in LEAN_LIKE), cause]


def _find_lean(problem: Problem, most: float) -> Fault | None:
    """Return the fault of a base that leans, if gravity from another side leaves less than ``most``; else None."""
    log = problem.signals.log
    if log.orientation is not None or not log.is_unit_known:
        return None
    gravity, left = fit_gravity(problem)
    size = float(np.linalg.norm(gravity))
    usual = float(np.linalg.norm(problem.machine.model.opt.gravity))
    x, y, z = gravity / max(size, 1e-9)
    roll, pitch = np.degrees([np.arctan2(-y, -z), np.arcsin(np.clip(x, -1.0, 1.0))])
    if left >= most or abs(size / usual - 1.0) >= LIKE_GRAVITY or np.hypot(roll, pitch) < LEAST_LEAN:
        return None
    text = (
        f"gravity comes from another side: with a base that leans by {roll:.0f} degrees about x and {pitch:.0f} "
        f"about y, and {size:.3g} m/s^2, joints and model leave {100.0 * left:.0f} % of the torque"
    )
    if abs(roll) > UPSIDE_DOWN:
        text += "; or all torques count against the joints, --units torque=-Nm"
    return Fault("lean", text, "--lean", f"{roll:.1f},{pitch:.1f}")


def _find_load(problem: Problem, most: float) -> Fault | None:
    """Return the fault of a load on the last link, if with its mass less than ``most`` is left; else None."""
    log = problem.signals.log
    if not log.is_unit_known or problem.machine.has_limbs:
        return None
    factor, left = fit_load(problem, len(log.joints) - 1)
    if left >= most or factor < 1.0:
        return None
    link, bodies = problem.machine.find_link(len(log.joints) - 1)
    mass = (factor - 1.0) * float(problem.machine.model.body_mass[bodies].sum())
    text = (
        f"the robot carries a load that the model lacks: with {mass:.2g} kg more on {link}, joints and model leave "
        f"{100.0 * left:.0f} % of the torque; add it to the model"
    )
    return Fault("load", text)


def _compare(problem: Problem, regression: Regression) -> Iterator[Fault]:
    """Yield faults that the regression of a log on the model of a machine with a level base shows."""
    log = problem.signals.log
    late = regression.delay
    if log.has_drives and not DELAYS[0] <= late <= DELAYS[1]:
        yield Fault(
            "delay",
            f"commands fit best {1e3 * abs(late):.0f} ms {'later' if late > 0 else 'earlier'} than they are written: "
            "their times are shifted, --kp or --kd is wrong, or the drive also follows a commanded velocity, "
            "columns dq_des_JOINT, that the log lacks",
        )
    gravity = regression.weights[:, 0]
    moves = np.ptp(log.angle, axis=0) >= LEAST_TURN
    touched = "its feet touched the ground"
    reversed_joints = np.flatnonzero(regression.differs & moves & (gravity < 0.0)) if log.is_unit_known else ()
    certain = regression.is_certain & moves
    is_opposite = len(reversed_joints) > OPPOSITE * np.count_nonzero(certain & (gravity > 0.0))
    for j in reversed_joints:
        yield Fault(
            "sign",
            f"torque of {log.joints[j]} grows where the model of {problem.machine.joints[j]} says that it falls "
            f"(factor {gravity[j]:.2g}): {f'{touched}, or ' * problem.machine.has_limbs}its sign, side or joint is "
            "another",
            *(("--units", "torque=-Nm") if is_opposite and problem.signals.is_measured else ("--accept", "")),
        )
    power = (problem.signals.torque**2).mean(axis=0)
    whole = float(np.sqrt((regression.left**2 * power).sum() / max(float(power.sum()), 1e-12)))
    poor = [log.joints[j] for j in np.flatnonzero(regression.left > MOST_LEFT)]
    if not log.is_unit_known and poor:
        text = f"The model does not explain the torques of {', '.join(poor)} in any unit: it leaves more than"
        yield Fault(NOTE, f"{text} {100.0 * MOST_LEFT:.0f} % of each.")
    if log.is_unit_known and whole > MOST_LEFT:
        wrong = "order, signs or units of joints, or --robot, are wrong"
        causes = [wrong, "its base was not level or moved", touched]
        yield Fault(
            "model",
            f"the model leaves {100.0 * whole:.0f} % of its torque unexplained: "
            f"{', or '.join(causes[::-1] if problem.machine.has_limbs else causes)}",
        )
    viscous = regression.weights[:, 2]
    speed = np.maximum(np.sqrt((problem.signals.velocity**2).mean(axis=0)), 1e-9)
    is_driven = viscous + 3.0 * regression.errors[:, 2] < -NEGATIVE_SHARE * problem.signals.torque.std(axis=0) / speed
    for j in np.flatnonzero(is_driven & moves & (not log.has_drives) & log.is_unit_known):
        yield Fault(
            "damping",
            f"viscous friction of {log.joints[j]} comes out as {viscous[j]:.2g} N m s/rad, below zero: its torques "
            "have another sign or belong to another joint, or its times are shifted",
        )
    for j in np.flatnonzero(regression.has_negative_friction(log) & log.has_drives):
        yield Fault(
            "damping",
            f"viscous friction of {log.joints[j]} comes out as {viscous[j]:.2g} "
            f"N m s/rad, below zero: --kd {log.kd[j]:g} is too large",
        )
    if log.is_unit_known and not is_opposite:
        is_alike = not len(reversed_joints) and whole <= MOST_LEFT
        yield from _check_gravity(problem, regression, is_alike)
    if log.has_drives and (median := float(np.median(viscous))) > 0.4 * float(log.kd.mean()):
        text = f"Viscous friction is {median:.2f} N m s/rad, much beside --kd {log.kd.mean():g}: check that gain."
        yield Fault(NOTE, text)


def _check_gravity(problem: Problem, regression: Regression, is_alike: bool) -> Iterator[Fault]:
    """Yield faults of torques in proportion to those of the rigid bodies of the model.

    Ratios that are small or unknown are notes, as is a joint unlike most others. Another unit goes on only if all but
    their size ``is_alike``.
    """
    log = problem.signals.log
    gravity = regression.weights[:, 0]
    moves = np.ptp(log.angle, axis=0) >= LEAST_TURN
    certain = regression.is_certain & moves
    factor = float(np.median(gravity[certain])) if certain.any() else 1.0
    times = f"are {factor:.2g} times those of the rigid bodies of the model:"
    is_odd = (gravity < UNIT[0]) | (gravity > UNIT[1])
    odd = np.flatnonzero(regression.differs & moves & (gravity > 0.0) & is_odd)
    is_unit = is_alike and factor > 0.0 and bool((np.abs(gravity[certain] - factor) < ALIKE * factor).all())
    if not GRAVITY[0] <= factor <= GRAVITY[1] and (is_unit or log.has_drives or not len(odd)):
        mend = ("--units", "torque=unknown") if problem.signals.is_measured and is_unit else ("--accept", "")
        load = "the model lacks a load, or " * (problem.signals.is_measured and not is_unit)
        text = f"torques {times} {load}gains (--kp), units of torque, or masses are wrong by that"
        yield Fault("gravity", text, *mend)
    elif not 0.8 <= factor <= 1.25 and not len(odd):
        yield Fault(NOTE, f"Torques {times} masses, or gains, differ by that.")
    if not problem.signals.is_measured or log.has_drives:
        return  # the drives give the unit
    is_exception = np.count_nonzero(certain & is_odd) < np.count_nonzero(certain & ~is_odd)
    for j in odd:
        times = f"orque of {log.joints[j]} is {gravity[j]:.2g} times that of the rigid bodies of the model"
        if is_exception:
            yield Fault(NOTE, f"T{times}: it moves a load that the model lacks, or its unit is another.")
        else:
            mend = ("--units", "torque=unknown") if is_alike else ("--accept", "")
            yield Fault("gravity", f"t{times}: its unit is another", *mend)
    if unknown := [log.joints[j] for j in np.flatnonzero(~certain)]:
        yield Fault(
            NOTE,
            f"Nothing in this log shows whether the torques of {', '.join(unknown)} are in N m: the rigid bodies are "
            "too light or move too little, and there are no gains.",
        )
