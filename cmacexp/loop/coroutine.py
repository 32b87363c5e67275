"""The closed loop as a compiled generator: it runs built-in parts, and pauses where a external one has to act.

Resuming a compiled generator costs a tenth of a microsecond. Calling a kernel anew costs some 10: every array of the
tuples that it works on is looked at again.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.control.actuator import Actuator, actuate
from cmacexp.control.hybrid_kernels import HybridParams, HybridState, hybrid_feedback
from cmacexp.feedforward.kernels import FeedforwardParams, feedforward_step
from cmacexp.jit.compiler import kernel, kernel_apart, program
from cmacexp.loop.compiled import Torques
from cmacexp.loop.samples import write_samples
from cmacexp.loop.stop import DIVERGED, RUNNING, Guard, stop_reason
from cmacexp.models.mechanism import Mechanism, trigonometries
from cmacexp.planning.columns import ACTING, BEFORE
from cmacexp.plants.kernels import PlantParams, PlantState, advance
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.channel import Sensing
from cmacexp.sensors.kernels import Seen, sense
from cmacexp.typing import Array, Counts, Mask

MEASURE, ACT, PREDICT, STEP = range(4)
"""What the loop waits for when it pauses: the method of a external part."""


class External(NamedTuple):
    """Which parts are not built in."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """Of a built-in controller; a external controller asks its feedforward itself."""


class Inputs(NamedTuple):
    """Room for what external parts are given in K steps, a row for each, so that they may keep it; else empty."""

    true: Measurement
    """(K, ...): for sensors."""
    seen: Measurement
    """(K, ...): for a controller."""
    learning_error: Array
    """(K, L, 2): for a feedforward, N m."""
    torque: Array
    """(K, L, 2): for a plant, N m."""


class Row(NamedTuple):
    """Where a step is written down."""

    k: int
    samples: Array
    body_samples: Array


@kernel_apart
def is_finite(values: Array) -> bool:
    """Whether all of ``values`` (L, 2) are."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not math.isfinite(values[i, j]):
                return False
    return True


@kernel_apart
def sees_finite(seen: Seen) -> bool:
    """Whether all that is seen is finite."""
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


@kernel_apart
def hand(rows: Array, k: int, values: Array) -> None:
    """Copy ``values`` (L, 2) into ``rows[k]``."""
    for i in range(values.shape[0]):
        for j in range(2):
            rows[k, i, j] = values[i, j]


@kernel_apart
def hand_flat(rows: Array, k: int, values: Array) -> None:
    """Copy ``values`` (n,) into ``rows[k]``."""
    for i in range(values.shape[0]):
        rows[k, i] = values[i]


@kernel_apart
def hand_true(true: PlantState, rows: Measurement, k: int) -> None:
    """Fill row ``k`` of ``rows`` (K, ...) with what sensors are given."""
    hand(rows.q, k, true.q)
    hand(rows.dq, k, true.dq)
    hand(rows.foot, k, true.foot)
    hand(rows.velocity, k, true.velocity)
    hand_flat(rows.force, k, true.force)
    hand_flat(rows.body, k, true.body)
    hand_flat(rows.body_rate, k, true.body_rate)


@kernel_apart
def hand_seen(seen: Seen, rows: Measurement, k: int) -> None:
    """Fill row ``k`` of ``rows`` (K, ...) with what a controller is given."""
    hand(rows.q, k, seen.q)
    hand(rows.dq, k, seen.dq)
    hand(rows.foot, k, seen.foot)
    hand(rows.velocity, k, seen.velocity)
    hand_flat(rows.force, k, seen.force)
    hand_flat(rows.body, k, seen.body)
    hand_flat(rows.body_rate, k, seen.body_rate)


@kernel_apart
def control(
    external: External, params: HybridParams, state: HybridState, support: Mask, reference: Array, seen: Seen
) -> None:
    """The built-in controller at what is ``seen``, by a row of the plan."""
    if external.plant or external.sensors:
        trigonometries(params.mechanism, seen.q, seen.trig)
    hybrid_feedback(
        params, state, support, reference,
        seen.trig, seen.foot, seen.velocity, seen.force, seen.body, seen.body_rate,
    )  # fmt: skip


@kernel_apart
def commit(
    actuator: Actuator, state: HybridState, torques: Torques, machine: PlantState, seen: Seen, step: int, row: Row
) -> None:
    """Work out the torque that the plant gets, and write the step down."""
    actuate(actuator, step, state.feedback, torques.feedforward, torques.total)
    write_samples(row.samples, row.body_samples, row.k, machine, seen, state, torques.feedforward)


@kernel_apart
def watch(guard: Guard, machine: PlantState, sample: int, external_plant: bool) -> int:
    """RUNNING, or why the run stops at the start of a step."""
    status = stop_reason(guard, sample, machine.q, machine.dq, machine.foot, machine.force, machine.body)
    if status == RUNNING and external_plant and not moves_finitely(machine):
        return DIVERGED
    return status


@kernel_apart
def move(params: PlantParams, machine: PlantState, torque: Array) -> None:
    """The built-in plant."""
    advance(params, machine, torque)


@kernel_apart
def feel(sensing: Sensing, mechanism: Mechanism, step: int, machine: PlantState, seen: Seen) -> None:
    """The built-in sensors."""
    sense(sensing, mechanism, step, machine, seen)


@kernel_apart
def foresee(params: FeedforwardParams, step: int, sample: int, learning_error: Array, torque: Array) -> None:
    """The built-in feedforward."""
    feedforward_step(params, step, sample, learning_error, torque)


@program
def relay(
    support: Mask,
    reference: Array,
    start_step: int,
    params: PlantParams,
    machine: PlantState,
    sensing: Sensing,
    seen: Seen,
    control_params: HybridParams,
    state: HybridState,
    feedforward_params: FeedforwardParams,
    actuator: Actuator,
    torques: Torques,
    guard: Guard,
    external: External,
    progress: Counts,
    inputs: Inputs,
    start: int,
    samples: Array,
    body_samples: Array,
) -> Iterator[int]:
    """:func:`cmacexp.loop.fused.fused_loop`, pausing at external parts; the caller keeps all arrays alive.

    ``progress`` (3,) is filled: steps whose torque the plant has taken, RUNNING or why it stopped, and 1 + the method
    that gave a value that is not finite, else 0. The fields of :class:`FusedLoop` come one by one, and what is done
    between pauses are functions apart: a generator that takes all of it in one tuple compiles for a minute.

    Yields:
        4 x row + MEASURE, ACT, PREDICT or STEP; the caller has the part do it before it resumes.
    """
    period = support.shape[0]
    progress[0], progress[1], progress[2] = 0, RUNNING, 0
    if start == 0 and samples.shape[0] > 0:
        progress[1] = watch(guard, machine, 0, False)
        if progress[1] != RUNNING:
            return
    for k in range(samples.shape[0]):
        step = start + k
        if external.sensors:
            hand_true(machine, inputs.true, k)
            yield 4 * k + MEASURE
            if not sees_finite(seen):
                progress[2] = 1 + MEASURE
                return
        elif sensing.active:
            feel(sensing, params.mechanism, step, machine, seen)
        if external.controller:
            hand_seen(seen, inputs.seen, k)
            yield 4 * k + ACT
            if not (is_finite(state.feedback) and is_finite(torques.feedforward)):
                progress[2] = 1 + ACT
                return
        else:
            if step >= start_step:
                # Before the feedback, so that the learning error is still that of the last step.
                if external.feedforward:
                    hand(inputs.learning_error, k, state.learning_error)
                    yield 4 * k + PREDICT
                    if not is_finite(torques.feedforward):
                        progress[2] = 1 + PREDICT
                        return
                else:
                    foresee(feedforward_params, step, step % period, state.learning_error, torques.feedforward)
            stage = ACTING if step >= start_step else BEFORE
            control(external, control_params, state, support[step % period], reference[stage, step % period], seen)
        commit(actuator, state, torques, machine, seen, step, Row(k, samples, body_samples))
        if external.plant:
            hand(inputs.torque, k, torques.total)
            yield 4 * k + STEP
        else:
            move(params, machine, torques.total)
        progress[0] = k + 1
        progress[1] = watch(guard, machine, (step + 1) % period, external.plant)
        if progress[1] != RUNNING:
            return
