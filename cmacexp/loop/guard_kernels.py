"""Kernels of the guard of learning for every step: sums over the cycle, torque selection, alarm."""

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
    """Source of the torque that acts in addition to the feedback."""

    BASELINE = 0
    """None yet: feedback only, the reference for learning."""
    LEARNING = 1
    """The learning feedforward."""
    FROZEN = 2
    """The repeated torque of the best cycle."""
    REFINING = 3
    """The repeated torque of the best cycle, corrected once per cycle."""
    FEEDBACK_ONLY = 4
    """None any more, after everything else has failed."""


BASELINE = int(Phase.BASELINE)
LEARNING = int(Phase.LEARNING)
FEEDBACK_ONLY = int(Phase.FEEDBACK_ONLY)
EFFORT_LIMIT, SPEED_LIMIT, TILT_LIMIT = range(3)
"""Indices of the limits of one step, which are squares: effort, joint velocities, tilt of the body."""
HIGHEST = (3.0, 4.0, 1.4)
"""Ratios of the limits, before squaring, to the peaks with feedback only."""


class CycleSums(NamedTuple):
    """Sums of squares over a cycle."""

    effort: float
    """Learning error, (N m)^2."""
    error: float
    """Errors of feet and body, m^2."""
    motion: float
    """Joint velocities, (rad/s)^2."""
    demand: float
    """Sum of learning error and feedforward, (N m)^2; only in a first cycle with learnt weights."""


EFFORT, ERROR, MOTION, DEMAND = range(len(CycleSums._fields))


class GuardState(NamedTuple):
    """State shared by the loop and the guard of a run, for L legs with J joints and cycles of N samples."""

    phase: Flag
    """(1,): a value of :class:`Phase`."""
    infers: Flag
    """(1,): 1 in a first cycle with learnt weights, from which the baseline is inferred."""
    alarm: Flag
    """(1,): 1 after a step beyond a limit, until the guard has handled it."""
    corrects: Flag
    """(1,): 1 if ``torque`` must be corrected by ``errors`` before this cycle."""
    sums: Clock
    """(4,): sums of squares over this cycle, in the order and units of :class:`CycleSums`."""
    limits: Clock
    """(3,): limits of one step, (N m)^2, (rad/s)^2 and rad^2; a step beyond them ends learning at once."""
    lever: float
    """Weight of the squared tilt in the error: half the sum of the squared hip distances, m^2."""
    torque: Clock
    """(N, L, J): feedforward torque of this cycle, N m; recorded during learning, repeated afterwards."""
    errors: Clock
    """(N, L, J): learning errors of this cycle, N m; empty unless the guard refines."""
    output: Scratch
    """(J,): workspace for the output of one network, N m."""
    probe: ProbeState | None
    """Probe of the feedback delay; None if the lead is not estimated."""


def new_guard_state(
    samples: int, shape: tuple[int, int], refines: bool, lever: float, probe: ProbeState | None
) -> GuardState:
    """Make the state of a guard at the start of a run.

    Args:
        samples: samples per cycle, N.
        shape: (L, J), legs and joints per leg.
        refines: True with ``learning.guard=refine``, which needs the errors of a whole cycle.
        lever: weight of the squared tilt in the error, m^2.
        probe: probe of the feedback delay, if any.
    """
    phase, infers, alarm, corrects = (np.zeros(1, dtype=np.int64) for _ in range(4))
    torque = np.zeros((samples, *shape))
    errors = np.zeros_like(torque) if refines else np.zeros((0, *shape))
    return GuardState(
        phase=phase,
        infers=infers,
        alarm=alarm,
        corrects=corrects,
        sums=np.zeros(len(CycleSums._fields)),
        limits=np.zeros(3),
        lever=lever,
        torque=torque,
        errors=errors,
        output=np.zeros(shape[1]),
        probe=probe,
    )


@kernel
def lets_act(guard: GuardState | None, start_step: int, step: int) -> bool:
    """Return True if the feedforward acts in ``step``."""
    if guard is None:
        return step >= start_step
    return BASELINE < guard.phase[0] < FEEDBACK_ONLY


@kernel
def lets_learn(guard: GuardState | None) -> bool:
    """Return True if the feedforward, where it acts, learns and supplies the torque (no repeated torque)."""
    return guard is None or guard.phase[0] == LEARNING


@kernel
def raise_limits(limits: Array, effort: float, speed: float, tilt: float) -> None:
    """Raise the ``limits`` (3,) as required by the squares of a step with feedback only.

    ``effort``, ``speed`` and ``tilt`` are in (N m)^2, (rad/s)^2 and rad^2, as the limits.
    """
    for n, peak in enumerate((effort, speed, tilt)):
        limits[n] = max(limits[n], HIGHEST[n] ** 2 * peak)


@kernel
def accumulate_cycle(
    guard: GuardState | None, sample: int, support: Mask, control: HybridState, observation: Observation
) -> None:
    """Add effort and errors of a step to the sums of its cycle, and check the limits of a step.

    ``sample`` is the step within the cycle; ``support`` (L,) is True for supporting legs. To be called before the
    plant advances, since arrays that were just written are slow to read.
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
    """Record the feedforward ``torque`` (L, J) of a step, N m, during learning; else replace it by the repeated one.

    The torque of a probe is added.
    """
    if guard is None:
        return
    phase = guard.phase[0]
    recorded = guard.torque[sample]
    for i in range(torque.shape[0]):
        for j in range(torque.shape[1]):
            if phase == LEARNING:
                recorded[i, j] = torque[i, j]
            else:
                torque[i, j] = recorded[i, j] if LEARNING < phase < FEEDBACK_ONLY else 0.0
    add_probe(guard.probe, sample, torque)


@kernel
def correct_torque(guard: GuardState | None, params: FeedforwardParams | None) -> None:
    """Correct the repeated torque by the errors of the last cycle, if the guard has requested it.

    Trains the network once on the learning errors ``guard.errors``, N m, and adds the change of its output to
    ``guard.torque`` (N, L, J), N m; see :func:`correct`. Does nothing without a guard or a network.
    """
    if guard is not None and params is not None and guard.corrects[0] != 0:
        guard.corrects[0] = 0
        correct(params, guard.errors, guard.output, guard.torque)
