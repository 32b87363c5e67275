"""The guard of learning: no run ends worse than with feedback alone because it learnt.

The guard compares every cycle with one of feedback alone, by two root mean squares: that of the effort (the learning
error, J^T U) and that of the error of feet and body. The level of a cycle is the geometric mean of their ratios to
those of feedback alone, which has the level 1. The guard keeps the feedforward torque of the best cycle; when
learning does harm, that torque is repeated. If this does not help either, feedback goes on alone. The last cycle of a
run is not judged. Where learnt weights act from the first cycle, that of feedback alone is inferred from its sums.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.config.schema import REFINE
from cmacexp.control.hybrid_kernels import HybridState
from cmacexp.feedforward.kernels import FeedforwardParams, correct, exchange
from cmacexp.jit.compiler import kernel
from cmacexp.loop.probe import (
    CYCLES_LEFT,
    DONE,
    LEARN_AGAIN,
    MOST_PROBES,
    PROBED,
    WAITING,
    Probe,
    add_torque,
    begin_probe,
    new_probe,
    note_response,
)
from cmacexp.models.mechanism import Mechanism, has_body
from cmacexp.models.trend import SIGNIFICANT, WINDOW, count_rises
from cmacexp.planning.columns import JOINT_COLUMNS
from cmacexp.planning.plan import Plan
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import CLOCK, Array, Clock, Counts, Mask, Scratch

WATCHING, LEARNING, HOLDING, REFINING, ALONE = range(5)
"""Phases: feedback alone before learning; learning; the best torque repeated; that improved once a cycle; feedback
alone since nothing else held."""
PEAK, WORSE, DRIFT, CHATTER = range(4)
CAUSES = (
    "effort, speed or tilt beyond that of feedback alone",
    "feedback alone was better",
    "effort and error drifted",
    "feedback alone chatters, which leaves nothing to learn from",
)
PHASE, STEPS, CYCLE, LEARNT, SETTLING, SLOT, BEST_CYCLE, EVENTS, ALARM = range(9)
"""Counters: phase; steps seen of this cycle; cycles begun; cycles of the phase; cycles before it is judged; the slot
of the torque that acts, the other one holds that of the best cycle; that cycle, 0: none; events; whether a step was
beyond a limit."""
EFFORT, ERROR, MOTION, EFFORT_ALONE, ERROR_ALONE, MOTION_PLANNED, LAST, BEST, LOWEST, WHOLE = range(10)
"""Values: sums of squares over this cycle; the roots of those of feedback alone, and the planned sum of motion; error
of the last cycle over that of feedback alone; level of the best cycle; lowest mean level; sum with feedforward."""
EFFORT_LIMIT, SPEED_LIMIT, TILT_LIMIT = range(3)
"""Limits of one step, as squares: of the effort, the joint velocities and the tilt of the body."""
HIGHEST = (3.0, 4.0, 1.4)
"""Ratios of these limits to the peaks with feedback alone."""
UPRIGHT = 0.1
"""Tilt of a body below which it is far from a fall, rad."""
HIGHEST_EFFORT = 2.0
"""Effort of a cycle, over that of feedback alone, that no smaller error justifies."""
CHATTERS = 3.0
"""Root mean square of the joint velocities with feedback alone, over that planned, above which it chatters: in random
worlds it was up to 1.9, or in a limit cycle above 3."""
RISE = 1.2
"""Ratio of the mean level of WINDOW cycles to its lowest at which a trend is a drift."""
BETTER = 0.98
"""Ratio to the level of the best cycle below which a cycle becomes the best one: most cycles copy nothing."""
TINY = 1e-300
"""Is added to divisors that may be 0."""
STILL_FALLS = 0.95
"""Ratio to the error of the last cycle up to which an error above that of feedback alone still falls."""
MOST_EVENTS = 8


class Guard(NamedTuple):
    """The guard of one run, of L legs with J joints over a cycle of N samples."""

    refines: bool
    """Whether the torque that is repeated is improved once a cycle."""
    start_step: int
    """First step in which the feedforward may act."""
    counts: Annotated[Counts, CLOCK]
    """(9,): counters."""
    values: Clock
    """(10,): values."""
    limits: Clock
    """(3,): limits of one step; learning ends at once beyond them."""
    lever: float
    """Of the tilt, squared, in the error: the sum of half the squared distances of the hips, m^2."""
    levels: Clock
    """(WINDOW,): levels of the last cycles of learning, a ring."""
    torque: Clock
    """(2, N, L, J): feedforward torques of this cycle and of the best one, N m."""
    errors: Clock
    """(N, L, J): learning errors of this cycle, N m; empty unless it refines."""
    output: Scratch
    """(J,): of one network, N m."""
    weights: Clock
    """(L, M, J): weights in use at the end of the best cycle, at first those of the start, as in their log."""
    probe: Probe
    """Of how late feedback is, before learning and after each retreat."""
    events: Clock
    """(MOST_EVENTS, 3): step, cause and restored cycle, 0 for feedback alone, of each event."""


class Event(NamedTuple):
    """What the guard did, and why; its fields are an entry of the manifest."""

    cycle: int
    """In which it acted, from 1."""
    step: int
    cause: str
    restored: int
    """Cycle whose torque acts since then; 0: feedback is alone."""


def read_events(guard: Guard | None) -> list[Event]:
    """The events so far, in their order."""
    if guard is None:
        return []
    rows, samples = guard.events[: guard.counts[EVENTS]], guard.torque.shape[1]
    return [Event(int(step) // samples + 1, int(step), CAUSES[int(cause)], int(cycle)) for step, cause, cycle in rows]


def new_guard(
    mode: str, mechanism: Mechanism, plan: Plan, weights: Array, probe_seed: int | None, has_learnt: bool
) -> Guard:
    """A guard at the start of a run, in the mode ``freeze`` or ``refine``.

    ``weights`` (L, M, J) are those in use at the start, in the order of their log; ``probe_seed`` is that of the
    torque that probes how late feedback is, None if nothing does. Where weights have learnt in an earlier run they
    act at once, and the first cycle takes the place of that of feedback alone.
    """
    shape, samples = mechanism.shape, len(plan.support)
    planned = plan.joints[:, :, JOINT_COLUMNS["velocity"][: shape[1]]]
    limits = np.zeros(3)
    motion = (planned**2).sum(axis=(1, 2))
    limits[SPEED_LIMIT] = HIGHEST[SPEED_LIMIT] ** 2 * motion.max()
    limits[TILT_LIMIT] = UPRIGHT**2
    lever = 0.5 * float((mechanism.hips**2).sum()) if has_body(mechanism) else 0.0
    values = np.zeros(10)
    values[[MOTION_PLANNED, BEST, LOWEST]] = motion.sum(), 1.0, math.inf
    counts = np.zeros(9, dtype=np.int64)
    if has_learnt and probe_seed is None:
        counts[PHASE] = LEARNING
    return Guard(
        mode == REFINE,
        plan.start_step,
        counts,
        values,
        limits,
        lever,
        np.zeros(WINDOW),
        np.zeros((2, samples, *shape)),
        np.zeros((samples if mode == REFINE else 0, *shape)),
        np.zeros(shape[1]),
        weights,
        new_probe(0 if probe_seed is None else samples, shape, probe_seed or 0),
        np.zeros((MOST_EVENTS, 3)),
    )


@kernel
def lets_act(guard: Guard | None, start_step: int, step: int) -> bool:
    """Whether the feedforward acts in ``step``."""
    if guard is None:
        return step >= start_step
    return WATCHING < guard.counts[PHASE] < ALONE


@kernel
def lets_learn(guard: Guard | None) -> bool:
    """Whether the feedforward itself learns and gives the torque, where it acts."""
    return guard is None or guard.counts[PHASE] == LEARNING


@kernel
def starts_learnt(guard: Guard) -> bool:
    """Whether this is the first cycle of a run that starts from what another one has learnt."""
    return guard.counts[PHASE] == LEARNING and guard.values[EFFORT_ALONE] == 0.0


@kernel
def raise_limits(limits: Array, effort: float, speed: float, tilt: float) -> None:
    """Raise the limits (3,) to what a step of feedback alone allows."""
    limits[EFFORT_LIMIT] = max(limits[EFFORT_LIMIT], HIGHEST[EFFORT_LIMIT] ** 2 * effort)
    limits[SPEED_LIMIT] = max(limits[SPEED_LIMIT], HIGHEST[SPEED_LIMIT] ** 2 * speed)
    limits[TILT_LIMIT] = max(limits[TILT_LIMIT], HIGHEST[TILT_LIMIT] ** 2 * tilt)


@kernel
def watch(guard: Guard | None, sample: int, support: Mask, control: HybridState, observation: Observation) -> None:
    """Note effort and errors of a step, ``sample`` of its cycle, before the plant moves on.

    Arrays that were written a moment before would be read slowly.
    """
    if guard is None:
        return
    counts, values, learnt = guard.counts, guard.values, starts_learnt(guard)
    effort, error, speed, whole = 0.0, 0.0, 0.0, 0.0
    for i in range(support.shape[0]):
        for j in range(control.reference.shape[1]):
            effort += control.learning_error[i, j] * control.learning_error[i, j]
            if learnt:
                whole += (control.learning_error[i, j] + guard.torque[counts[SLOT], sample, i, j]) ** 2
            speed += observation.dq[i, j] * observation.dq[i, j]
            if j != 1 or not support[i]:  # the force of a supporting foot is controlled, not its height
                off = control.reference[i, j] - observation.foot[i, j]
                error += off * off
            if guard.refines:
                guard.errors[sample, i, j] = control.learning_error[i, j]
    tilt = observation.body[1] * observation.body[1] + observation.body[2] * observation.body[2]
    values[EFFORT] += effort
    values[ERROR] += error + guard.lever * tilt
    values[MOTION] += speed
    values[WHOLE] += whole
    counts[STEPS] += 1
    note_response(guard.probe, sample, control.learning_error)
    if learnt or not LEARNING <= counts[PHASE] < ALONE:
        raise_limits(guard.limits, max(effort, whole), speed, tilt)
    elif effort > guard.limits[EFFORT_LIMIT] or speed > guard.limits[SPEED_LIMIT] or tilt > guard.limits[TILT_LIMIT]:
        counts[ALARM] = 1


@kernel
def take_torque(guard: Guard | None, sample: int, torque: Array) -> None:
    """Keep the feedforward ``torque`` (L, J) of a step, N m; where learning has ended, replace it."""
    if guard is None:
        return
    phase, table = guard.counts[PHASE], guard.torque[guard.counts[SLOT], sample]
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            if phase == LEARNING:
                table[i, j] = torque[i, j]
            else:
                torque[i, j] = table[i, j] if LEARNING < phase < ALONE else 0.0
    add_torque(guard.probe, sample, torque)


@kernel(inline=False)
def copy_slot(torque: Array, slot: int) -> None:
    """Copy the torques of ``slot`` to the other one; ``torque`` (2, N, L, J)."""
    for k in range(torque.shape[1]):
        for i in range(torque.shape[2]):
            for j in range(torque.shape[3]):
                torque[1 - slot, k, i, j] = torque[slot, k, i, j]


@kernel(inline=False)
def retreat(guard: Guard, params: FeedforwardParams | None, step: int, cause: int) -> None:
    """Return to the torque and weights of the best cycle; to feedback alone if there is none, or it did not help."""
    counts, values = guard.counts, guard.values
    learnt = counts[PHASE] == LEARNING
    if counts[PHASE] == HOLDING:
        counts[BEST_CYCLE] = 0
    counts[SLOT] = 1 - counts[SLOT]  # which is zero throughout as long as no cycle was better than feedback alone
    if guard.refines and learnt:
        counts[PHASE] = REFINING
        copy_slot(guard.torque, counts[SLOT])
    else:
        counts[PHASE] = HOLDING if counts[BEST_CYCLE] > 0 else ALONE
    exchange(params, guard.weights, False)
    counts[SETTLING], counts[LEARNT] = 2, 0
    values[LOWEST] = math.inf
    probed = guard.probe.counts[PROBED]
    guard.probe.counts[CYCLES_LEFT] = WAITING if 0 < probed < MOST_PROBES and cause != CHATTER else DONE
    if counts[EVENTS] < guard.events.shape[0]:
        event = guard.events[counts[EVENTS]]
        event[0], event[1], event[2] = step, cause, counts[BEST_CYCLE]
        counts[EVENTS] += 1


@kernel(inline=False)
def has_drifted(guard: Guard, level: float) -> bool:
    """Whether the levels of the last WINDOW cycles rise, and their mean is far above its lowest."""
    counts, values, n = guard.counts, guard.values, guard.levels.shape[0]
    newest = counts[LEARNT] % n
    guard.levels[newest] = level
    counts[LEARNT] += 1
    if counts[LEARNT] < n:
        return False
    mean = 0.0
    for k in range(n):
        mean += guard.levels[k] / n
    values[LOWEST] = min(values[LOWEST], mean)
    return mean > RISE * values[LOWEST] and count_rises(guard.levels, newest) >= SIGNIFICANT


@kernel(inline=False)
def measure_alone(guard: Guard) -> None:
    """Take the cycle that has ended as one of feedback alone."""
    values = guard.values
    values[EFFORT_ALONE], values[ERROR_ALONE] = math.sqrt(values[EFFORT]) + TINY, math.sqrt(values[ERROR]) + TINY


@kernel(inline=False)
def infer_alone(guard: Guard) -> None:
    """Feedback alone would have to give what feedback and feedforward gave together, with errors in proportion."""
    values = guard.values
    measure_alone(guard)
    values[BEST] = values[EFFORT_ALONE] / (math.sqrt(values[WHOLE]) + TINY)
    values[EFFORT_ALONE] /= values[BEST]
    values[ERROR_ALONE] /= values[BEST]


@kernel
def chatters(values: Array) -> bool:
    """Whether the joints moved far more in the cycle that has ended than planned."""
    return 0.0 < CHATTERS * CHATTERS * values[MOTION_PLANNED] < values[MOTION]


@kernel(inline=False)
def learn_from_now_on(guard: Guard) -> None:
    """Learn, from the weights of the best cycle, in the slot that does not hold its torque."""
    counts, probe = guard.counts, guard.probe
    if counts[PHASE] != WATCHING:
        counts[SLOT] = 1 - counts[SLOT]
    counts[PHASE], counts[LEARNT], probe.counts[LEARN_AGAIN] = LEARNING, 0, 0


@kernel(inline=False)
def judge(guard: Guard, params: FeedforwardParams | None, step: int) -> None:
    """Judge the cycle that has ended before ``step``."""
    counts, values, probe = guard.counts, guard.values, guard.probe
    if probe.counts[CYCLES_LEFT] > DONE:
        return
    if counts[PHASE] == WATCHING:
        if probe.counts[PROBED] == 0:
            measure_alone(guard)
        if chatters(values):
            retreat(guard, params, step, CHATTER)
        elif counts[CYCLE] > 1 and begin_probe(probe, values[EFFORT_ALONE]):
            return
        elif probe.counts[CYCLES_LEFT] == DONE and step >= guard.start_step:
            learn_from_now_on(guard)
    elif probe.counts[LEARN_AGAIN] != 0:
        learn_from_now_on(guard)
    elif starts_learnt(guard) and chatters(values):
        retreat(guard, params, step, CHATTER)
    elif starts_learnt(guard):
        infer_alone(guard)
        counts[BEST_CYCLE], counts[SLOT] = counts[CYCLE], 1 - counts[SLOT]
        exchange(params, guard.weights, True)
    elif counts[SETTLING] == 0 and begin_probe(probe, values[EFFORT_ALONE]):
        return
    elif counts[PHASE] != ALONE and counts[SETTLING] == 0:
        effort = math.sqrt(values[EFFORT]) / values[EFFORT_ALONE]
        error = math.sqrt(values[ERROR]) / values[ERROR_ALONE]
        level = math.sqrt(effort * error)
        drifts = has_drifted(guard, level)
        improves = counts[PHASE] != HOLDING and level < BETTER * values[BEST] and error < 1.0
        first = counts[PHASE] == LEARNING and counts[LEARNT] == 1
        if improves:
            values[BEST], counts[BEST_CYCLE] = level, counts[CYCLE]
            exchange(params, guard.weights, True)
            if counts[PHASE] == LEARNING:
                counts[SLOT] = 1 - counts[SLOT]
            else:
                copy_slot(guard.torque, counts[SLOT])
        elif not first and (effort > HIGHEST_EFFORT or error > max(1.0, STILL_FALLS * values[LAST])):
            retreat(guard, params, step, WORSE)
        elif drifts and counts[PHASE] != HOLDING:
            retreat(guard, params, step, DRIFT)
        values[LAST] = error
    elif counts[SETTLING] > 0:
        counts[SETTLING] -= 1
        if counts[SETTLING] == 0 and counts[BEST_CYCLE] == 0:
            measure_alone(guard)  # again: the first cycle started from rest


@kernel
def needs_judging(guard: Guard, sample: int) -> bool:
    """Whether :func:`begin_step` has something to do."""
    return sample == 0 or guard.counts[ALARM] != 0


@kernel(inline=False)
def begin_step(guard: Guard, params: FeedforwardParams | None, step: int, sample: int) -> None:
    """End learning at once after a step beyond the limits; at the start of a cycle judge the last one."""
    counts, values, probes = guard.counts, guard.values, guard.probe.counts[CYCLES_LEFT] != DONE
    if counts[ALARM] != 0:
        counts[ALARM] = 0
        if counts[PHASE] == LEARNING or (counts[PHASE] == REFINING and counts[SETTLING] == 0 and not probes):
            retreat(guard, params, step, PEAK)
    if sample == 0:
        if counts[STEPS] == guard.torque.shape[1]:
            judge(guard, params, step)
            if counts[PHASE] == REFINING and counts[SETTLING] == 0 and guard.probe.counts[CYCLES_LEFT] == DONE:
                correct(params, guard.errors, guard.output, guard.torque[counts[SLOT]])
        counts[STEPS], counts[CYCLE] = 0, counts[CYCLE] + 1
        values[EFFORT], values[ERROR], values[MOTION] = 0.0, 0.0, 0.0
