"""The closed loop as a compiled generator: it runs built-in parts, and pauses where a foreign one has to act.

Resuming a compiled generator costs a tenth of a microsecond. Calling a kernel anew costs some 10: every array of the
tuples that it works on is looked at again.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.arrays import Array, Counts
from cmacexp.compile import kernel, kernel_apart
from cmacexp.control.actuator import actuate
from cmacexp.control.feedforward_law import feedforward_step
from cmacexp.control.hybrid_law import hybrid_feedback
from cmacexp.models.mechanism import trigonometries
from cmacexp.plants.kernels import PlantState, advance
from cmacexp.plants.protocol import Measurement
from cmacexp.rollout.fused import FusedLoop
from cmacexp.rollout.layout import has_measured, write_measured, write_samples
from cmacexp.rollout.stop import DIVERGED, RUNNING, stop_reason
from cmacexp.sensors.law import Seen, sense

MEASURE, ACT, PREDICT, STEP = range(4)
"""What the loop waits for when it pauses: the method of a foreign part."""


class Foreign(NamedTuple):
    """Which parts are not built in."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """Of a built-in controller; a foreign controller asks its feedforward itself."""


class Handed(NamedTuple):
    """Room for what foreign parts are given in K steps, a row for each, so that they may keep it; else empty."""

    true: Measurement
    """(K, ...): for sensors."""
    seen: Measurement
    """(K, ...): for a controller."""
    taught: Array
    """(K, L, 2): for a feedforward, N m."""
    torque: Array
    """(K, L, 2): for a plant, N m."""


@kernel
def is_finite(values: Array) -> bool:
    """Whether all of ``values`` (L, 2) are."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not math.isfinite(values[i, j]):
                return False
    return True


@kernel
def sees_finite(seen: Seen) -> bool:
    """Whether all of a measurement is finite."""
    for i in range(seen.force.shape[0]):
        if not math.isfinite(seen.force[i]):
            return False
    for n in range(3):
        if not (math.isfinite(seen.body[n]) and math.isfinite(seen.body_rate[n])):
            return False
    return is_finite(seen.q) and is_finite(seen.dq) and is_finite(seen.foot) and is_finite(seen.velocity)


@kernel
def moves_finitely(machine: PlantState) -> bool:
    """Whether velocities are finite that no kernel of ours has computed."""
    for n in range(3):
        if not math.isfinite(machine.body_rate[n]):
            return False
    return is_finite(machine.velocity)


@kernel
def hand(rows: Array, k: int, values: Array) -> None:
    """Copy ``values`` (L, 2) into ``rows[k]``."""
    for i in range(values.shape[0]):
        for j in range(2):
            rows[k, i, j] = values[i, j]


@kernel
def hand_measurement(
    rows: Measurement,
    k: int,
    q: Array,
    dq: Array,
    foot: Array,
    velocity: Array,
    force: Array,
    body: Array,
    rate: Array,
) -> None:
    """Copy the parts of a measurement into row ``k`` of ``rows`` (K, ...)."""
    hand(rows.q, k, q)
    hand(rows.dq, k, dq)
    hand(rows.foot, k, foot)
    hand(rows.velocity, k, velocity)
    for i in range(force.shape[0]):
        rows.force[k, i] = force[i]
    for n in range(3):
        rows.body[k, n], rows.body_rate[k, n] = body[n], rate[n]


@kernel_apart
def relay(
    loop: FusedLoop,
    foreign: Foreign,
    progress: Counts,
    handed: Handed,
    start: int,
    samples: Array,
    body_samples: Array,
) -> Iterator[int]:
    """:func:`cmacexp.rollout.fused.fused_loop`, pausing at foreign parts; the caller keeps all arrays alive.

    ``progress`` (3,) is filled: steps whose torque the plant has taken, RUNNING or why it stopped, and 1 + the method
    that gave a value that is not finite, else 0.

    Yields:
        4 x row + MEASURE, ACT, PREDICT or STEP; the caller has the part do it before it resumes.
    """
    plant, machine, seen, state = loop.plant, loop.plant_state, loop.seen, loop.control_state
    feedforward, total = loop.torques
    steps = samples.shape[0]
    period = loop.support.shape[0]
    progress[0], progress[1], progress[2] = 0, RUNNING, 0
    if start == 0 and steps > 0:
        progress[1] = stop_reason(loop.guard, 0, machine.q, machine.dq, machine.foot, machine.force, machine.body)
        if progress[1] != RUNNING:
            return
    sample = start % period
    for k in range(steps):
        acting = start + k >= loop.start_step
        if foreign.sensors:
            hand_measurement(
                handed.true, k, machine.q, machine.dq, machine.foot, machine.velocity,
                machine.force, machine.body, machine.body_rate,
            )  # fmt: skip
            yield 4 * k + MEASURE
            if not sees_finite(seen):
                progress[2] = 1 + MEASURE
                return
        elif loop.sensing.active:
            sense(loop.sensing, plant.mechanism, start + k, machine, seen)
        if foreign.controller:
            hand_measurement(
                handed.seen, k, seen.q, seen.dq, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate
            )
            yield 4 * k + ACT
            if not (is_finite(state.feedback) and is_finite(feedforward)):
                progress[2] = 1 + ACT
                return
        else:
            reference = loop.reference[1 if acting else 0, sample]
            if acting:
                # Before the feedback, so that what it taught is still the last step's.
                if foreign.feedforward:
                    hand(handed.taught, k, state.taught)
                    yield 4 * k + PREDICT
                    if not is_finite(feedforward):
                        progress[2] = 1 + PREDICT
                        return
                else:
                    feedforward_step(loop.feedforward, start + k, sample, state.taught, feedforward)
            if foreign.plant or foreign.sensors:
                trigonometries(plant.mechanism, seen.q, seen.trig)
            hybrid_feedback(
                loop.control, state, loop.support[sample], reference,
                seen.trig, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate,
            )  # fmt: skip
        actuate(loop.actuator, start + k, state.feedback, feedforward, total)
        write_samples(
            samples, body_samples, k, machine.foot, machine.velocity, machine.q, machine.dq,
            machine.force, seen.force, state.reference, state.feedback, feedforward, machine.body,
        )  # fmt: skip
        if has_measured(samples):
            write_measured(samples, body_samples, k, seen, machine.body_rate)
        if foreign.plant:
            hand(handed.torque, k, total)
            yield 4 * k + STEP
        else:
            advance(plant, machine, total)
        progress[0] = k + 1
        sample = sample + 1 if sample + 1 < period else 0
        progress[1] = stop_reason(
            loop.guard, sample, machine.q, machine.dq, machine.foot, machine.force, machine.body
        )
        if progress[1] == RUNNING and foreign.plant and not moves_finitely(machine):
            progress[1] = DIVERGED
        if progress[1] != RUNNING:
            return
