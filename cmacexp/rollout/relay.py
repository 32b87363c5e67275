"""The closed loop as a compiled generator: it runs built-in parts, and pauses where a foreign one has to act.

Resuming a compiled generator costs a tenth of a microsecond. Calling a kernel anew costs some 10: every array of the
tuples that it works on is looked at again.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.arrays import Array, Counts
from cmacexp.compile import kernel, kernel_apart, kernel_within
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


@kernel_within
def is_finite(values: Array) -> bool:
    """Whether all of ``values`` (L, 2) are."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not math.isfinite(values[i, j]):
                return False
    return True


@kernel_within
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


@kernel_within
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


@kernel_within
def hand_true(loop: FusedLoop, rows: Measurement, k: int) -> None:
    """Fill row ``k`` with what sensors are given."""
    true = loop.plant_state
    hand_measurement(
        rows, k, true.q, true.dq, true.foot, true.velocity, true.force, true.body, true.body_rate
    )  # fmt: skip


@kernel_within
def hand_seen(loop: FusedLoop, rows: Measurement, k: int) -> None:
    """Fill row ``k`` with what a controller is given."""
    seen = loop.seen
    hand_measurement(
        rows, k, seen.q, seen.dq, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate
    )  # fmt: skip


@kernel_within
def control(loop: FusedLoop, foreign: Foreign, acting: bool, step: int, sample: int) -> None:
    """The built-in controller, with its feedforward if that is built in as well."""
    seen, state = loop.seen, loop.control_state
    if acting and not foreign.feedforward:
        # Before the feedback, so that what it taught is still the last step's.
        feedforward_step(loop.feedforward, step, sample, state.taught, loop.torques.feedforward)
    if foreign.plant or foreign.sensors:
        trigonometries(loop.plant.mechanism, seen.q, seen.trig)
    hybrid_feedback(
        loop.control, state, loop.support[sample], loop.reference[1 if acting else 0, sample],
        seen.trig, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate,
    )  # fmt: skip


@kernel_within
def commit(loop: FusedLoop, step: int, k: int, samples: Array, body_samples: Array) -> None:
    """Work out the torque that the plant gets, and write the step down in row ``k``."""
    machine, seen, state = loop.plant_state, loop.seen, loop.control_state
    feedforward, total = loop.torques
    actuate(loop.actuator, step, state.feedback, feedforward, total)
    write_samples(
        samples, body_samples, k, machine.foot, machine.velocity, machine.q, machine.dq,
        machine.force, seen.force, state.reference, state.feedback, feedforward, machine.body,
    )  # fmt: skip
    if has_measured(samples):
        write_measured(samples, body_samples, k, seen, machine.body_rate, state.plausible.trusted)


@kernel_within
def watch(loop: FusedLoop, sample: int, foreign_plant: bool) -> int:
    """RUNNING, or why the run stops at the start of a step."""
    machine = loop.plant_state
    status = stop_reason(loop.guard, sample, machine.q, machine.dq, machine.foot, machine.force, machine.body)
    if status == RUNNING and foreign_plant and not moves_finitely(machine):
        return DIVERGED
    return status


@kernel_within
def move(loop: FusedLoop) -> None:
    """The built-in plant."""
    advance(loop.plant, loop.plant_state, loop.torques.total)


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
    that gave a value that is not finite, else 0. What is done between pauses are functions apart: a generator saves
    all that it names at each of its pauses, which takes long to compile.

    Yields:
        4 x row + MEASURE, ACT, PREDICT or STEP; the caller has the part do it before it resumes.
    """
    period = loop.support.shape[0]
    progress[0], progress[1], progress[2] = 0, RUNNING, 0
    if start == 0 and samples.shape[0] > 0:
        progress[1] = watch(loop, 0, False)
        if progress[1] != RUNNING:
            return
    sample = start % period
    for k in range(samples.shape[0]):
        acting = start + k >= loop.start_step
        if foreign.sensors:
            hand_true(loop, handed.true, k)
            yield 4 * k + MEASURE
            if not sees_finite(loop.seen):
                progress[2] = 1 + MEASURE
                return
        elif loop.sensing.active:
            sense(loop.sensing, loop.plant.mechanism, start + k, loop.plant_state, loop.seen)
        if foreign.controller:
            hand_seen(loop, handed.seen, k)
            yield 4 * k + ACT
            if not (is_finite(loop.control_state.feedback) and is_finite(loop.torques.feedforward)):
                progress[2] = 1 + ACT
                return
        else:
            if foreign.feedforward and acting:
                hand(handed.taught, k, loop.control_state.taught)
                yield 4 * k + PREDICT
                if not is_finite(loop.torques.feedforward):
                    progress[2] = 1 + PREDICT
                    return
            control(loop, foreign, acting, start + k, sample)
        commit(loop, start + k, k, samples, body_samples)
        if foreign.plant:
            hand(handed.torque, k, loop.torques.total)
            yield 4 * k + STEP
        else:
            move(loop)
        progress[0] = k + 1
        sample = sample + 1 if sample + 1 < period else 0
        progress[1] = watch(loop, sample, foreign.plant)
        if progress[1] != RUNNING:
            return
