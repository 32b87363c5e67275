"""What the guard of learning does in every step, as kernels: sums over the cycle, the torque that acts, the alarm."""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.control.hybrid_kernels import HybridState
from cmacexp.feedforward.kernels import FeedforwardParams, correct
from cmacexp.jit.compiler import kernel
from cmacexp.loop.probe import ProbeState, add_probe, note_response
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import CLOCK, Array, Clock, Counts, Mask, Scratch

Flag = Annotated[Counts, CLOCK]


class Phase(IntEnum):
    """What acts besides the feedback."""

    BASELINE = 0
    """Nothing yet: feedback only, with which learning is compared."""
    LEARNING = 1
    """The feedforward, which learns."""
    FROZEN = 2
    """The torque of the best cycle, repeated."""
    REFINING = 3
    """The same, improved once a cycle."""
    FEEDBACK_ONLY = 4
    """Nothing any more, since nothing else held."""


BASELINE = int(Phase.BASELINE)
LEARNING = int(Phase.LEARNING)
FEEDBACK_ONLY = int(Phase.FEEDBACK_ONLY)
EFFORT_LIMIT, SPEED_LIMIT, TILT_LIMIT = range(3)
"""Limits of one step, as squares: of the effort, the joint velocities and the tilt of the body."""
HIGHEST = (3.0, 4.0, 1.4)
"""Ratios of these limits to the peaks with feedback only."""


class CycleSums(NamedTuple):
    """Sums of squares over a cycle."""

    effort: float
    """The learning error, (N m)^2."""
    error: float
    """The errors of feet and body, m^2."""
    motion: float
    """The joint velocities, (rad/s)^2."""
    demand: float
    """Learning error and feedforward together, (N m)^2; only in a first cycle with learnt weights."""


EFFORT, ERROR, MOTION, DEMAND = range(len(CycleSums._fields))


class GuardState(NamedTuple):
    """What the loop and the guard of one run share, of L legs with J joints over a cycle of N samples."""

    phase: Flag
    """(1,): one of :class:`Phase`."""
    infers: Flag
    """(1,): 1 in a first cycle with learnt weights, from which that of feedback only is inferred."""
    alarm: Flag
    """(1,): 1 after a step beyond a limit, until the guard has seen it."""
    corrects: Flag
    """(1,): 1 if ``torque`` is to be corrected by ``errors`` before this cycle."""
    sums: Clock
    """(4,): of squares over this cycle, in the order of :class:`CycleSums`."""
    limits: Clock
    """(3,): limits of one step, (N m)^2, (rad/s)^2 and rad^2; learning ends at once beyond them."""
    lever: float
    """Weight of the tilt, squared, in the error: the sum of half the squared distances of the hips, m^2."""
    torque: Clock
    """(N, L, J): feedforward torque of this cycle, N m: recorded while it learns, then repeated."""
    errors: Clock
    """(N, L, J): learning errors of this cycle, N m; empty unless the guard refines."""
    output: Scratch
    """(J,): of one network, N m."""
    probe: ProbeState | None
    """Probe of the delay of the feedback; None: nothing estimates the lead."""


def new_guard_state(
    samples: int, shape: tuple[int, int], refines: bool, lever: float, probe: ProbeState | None
) -> GuardState:
    """The state of a guard before a run of cycles of so many ``samples``; ``shape`` (L, J)."""
    phase, infers, alarm, corrects = (np.zeros(1, dtype=np.int64) for _ in range(4))
    sums, torque = np.zeros(len(CycleSums._fields)), np.zeros((samples, *shape))
    errors = np.zeros_like(torque) if refines else np.zeros((0, *shape))
    return GuardState(
        phase=phase,
        infers=infers,
        alarm=alarm,
        corrects=corrects,
        sums=sums,
        limits=np.zeros(3),
        lever=lever,
        torque=torque,
        errors=errors,
        output=np.zeros(shape[1]),
        probe=probe,
    )


@kernel
def lets_act(guard: GuardState | None, start_step: int, step: int) -> bool:
    """Whether the feedforward acts in ``step``."""
    if guard is None:
        return step >= start_step
    return BASELINE < guard.phase[0] < FEEDBACK_ONLY


@kernel
def lets_learn(guard: GuardState | None) -> bool:
    """Whether the feedforward itself learns and gives the torque, where it acts."""
    return guard is None or guard.phase[0] == LEARNING


@kernel
def raise_limits(limits: Array, effort: float, speed: float, tilt: float) -> None:
    """Raise the limits (3,) to what a step of feedback only, of these squares, allows.

    They are in (N m)^2, (rad/s)^2 and rad^2, as ``effort``, ``speed`` and ``tilt``.
    """
    for n, peak in enumerate((effort, speed, tilt)):
        limits[n] = max(limits[n], HIGHEST[n] ** 2 * peak)


@kernel
def accumulate_cycle(
    guard: GuardState | None, sample: int, support: Mask, control: HybridState, observation: Observation
) -> None:
    """Add effort and errors of ``sample``, a step with ``support`` (L,), before the plant moves on; check its limits.

    Arrays that were written a moment before would be read slowly.
    """
    if guard is None:
        return
    infers = guard.infers[0] != 0
    effort = error = speed = demand = 0.0
    for i in range(support.shape[0]):
        for j in range(control.reference.shape[1]):
            effort += control.learning_error[i, j] * control.learning_error[i, j]
            if infers:
                demand += (control.learning_error[i, j] + guard.torque[sample, i, j]) ** 2
            speed += observation.dq[i, j] * observation.dq[i, j]
            if j != 1 or not support[i]:  # the force of a supporting foot is controlled, not its height
                off = control.reference[i, j] - observation.foot[i, j]
                error += off * off
            if guard.errors.shape[0] > 0:
                guard.errors[sample, i, j] = control.learning_error[i, j]
    tilt = observation.body[1] * observation.body[1] + observation.body[2] * observation.body[2]
    sums = guard.sums
    sums[EFFORT] += effort
    sums[ERROR] += error + guard.lever * tilt
    sums[MOTION] += speed
    sums[DEMAND] += demand
    note_response(guard.probe, sample, control.learning_error)
    limits = guard.limits
    if infers or not LEARNING <= guard.phase[0] < FEEDBACK_ONLY:
        raise_limits(limits, max(effort, demand), speed, tilt)
    elif effort > limits[EFFORT_LIMIT] or speed > limits[SPEED_LIMIT] or tilt > limits[TILT_LIMIT]:
        guard.alarm[0] = 1


@kernel
def record_torque(guard: GuardState | None, sample: int, torque: Array) -> None:
    """Record the feedforward ``torque`` (L, J) of a step, N m; where it does not learn, replace it."""
    if guard is None:
        return
    phase, recorded = guard.phase[0], guard.torque[sample]
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            if phase == LEARNING:
                recorded[i, j] = torque[i, j]
            else:
                torque[i, j] = recorded[i, j] if LEARNING < phase < FEEDBACK_ONLY else 0.0
    add_probe(guard.probe, sample, torque)


@kernel
def correct_torque(guard: GuardState | None, params: FeedforwardParams | None) -> None:
    """Correct the torque of the cycle that begins by the errors of the last one, if the guard asks for that."""
    if guard is not None and params is not None and guard.corrects[0] != 0:
        guard.corrects[0] = 0
        correct(params, guard.errors, guard.output, guard.torque)
