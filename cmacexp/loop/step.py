"""The steps of the closed loop: observe, predict, control, guard, actuate, commit, advance, check, in this order.

Each of them is a kernel that both drivers call. :func:`take_fused_steps` runs built-in components without a pause;
the generator :func:`take_steps` pauses wherever an external component has to act. It would do for both, but a
generator keeps its state in memory: a step of built-in components would take three times as long.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmacexp.control.actuator import Actuator, actuate
from cmacexp.control.hybrid_kernels import HybridParams, HybridState, hybrid_feedback
from cmacexp.control.load_meter import LoadMeter, weigh
from cmacexp.control.steering import steer
from cmacexp.feedforward.kernels import FeedforwardParams, feedforward_step
from cmacexp.feedforward.weight_log import log_cycle
from cmacexp.jit.compiler import kernel
from cmacexp.loop.guard import Guard, begin_step, lets_act, lets_learn, needs_judging, take_torque, watch
from cmacexp.loop.samples import write_samples as commit
from cmacexp.loop.stop import DIVERGED, RUNNING, StopLimits
from cmacexp.loop.stop import stop_reason as check
from cmacexp.models.mechanism import Mechanism, update_geometry
from cmacexp.planning.columns import ACTING, BEFORE
from cmacexp.plants.kernels import PlantParams, PlantState, advance
from cmacexp.plants.mujoco_kernels import Engine, advance_engine
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.channel import Sensing
from cmacexp.sensors.kernels import Observation, read_sensors
from cmacexp.typing import Array, Counts, Mask, Scratch

MEASURE, ACT, PREDICT, STEP = range(4)
"""Methods of external components: of sensors, controller, feedforward and plant."""
NO_METHOD = -1
TAKEN, STOP, NOT_FINITE = range(3)
"""Entries of ``progress``: steps whose torque the plant has taken; RUNNING or why the loop stopped; the method that
returned a value that is not finite, or NO_METHOD."""


class Torques(NamedTuple):
    """Torques of one step, (L, J) each, N m."""

    feedforward: Scratch
    total: Scratch


class Loop(NamedTuple):
    """Parameters and states of the components of a loop; parameters of external ones are None."""

    support: Mask
    """Of the plan, as the next two."""
    reference: Array
    start_step: int
    mechanism: Mechanism
    plant: PlantParams | None
    engine: Engine | None
    """Of a built-in plant in MuJoCo, which has no other parameters."""
    travel: Array | None
    """(3,): of a body that a built-in plant moves, as of a Measurement."""
    plant_state: PlantState
    sensing: Sensing | None
    """None also of sensors that alter nothing."""
    observation: Observation
    """Input of the controller: the arrays of the plant itself where no sensor alters anything."""
    control: HybridParams | None
    control_state: HybridState
    feedforward: FeedforwardParams | None
    actuator: Actuator
    torques: Torques
    limits: StopLimits
    guard: Guard | None
    """Of learning; None: nothing guards it."""
    meter: LoadMeter | None
    """Of the load of a body; None: its plan does not adapt."""


class Inputs(NamedTuple):
    """Inputs of external components in K steps, one row each, so that they may keep them; None of built-in ones."""

    sensors: Measurement | None
    controller: Measurement | None
    feedforward: Array | None
    """(K, L, J): learning error, N m; an external controller calls its feedforward itself."""
    plant: Array | None
    """(K, L, J): torque, N m."""
    observes: bool
    """Whether the feedforward is shown every step, also those in which it does not act."""


@kernel
def copy_vector(values: Array, rows: Array, k: int) -> None:
    """Copy ``values`` (n,) into row ``k``."""
    for i in range(values.shape[0]):
        rows[k, i] = values[i]


@kernel
def copy_matrix(values: Array, rows: Array | None, k: int) -> None:
    """Copy ``values`` (L, J) into row ``k``."""
    if rows is not None:
        for i in range(values.shape[0]):
            for j in range(values.shape[1]):
                rows[k, i, j] = values[i, j]


@kernel
def copy_measurement(source: PlantState | Observation, rows: Measurement | None, k: int) -> None:
    """Copy the true state, or its observation, into row ``k``."""
    if rows is not None:
        copy_matrix(source.q, rows.q, k)
        copy_matrix(source.dq, rows.dq, k)
        copy_matrix(source.foot, rows.foot, k)
        copy_matrix(source.velocity, rows.velocity, k)
        copy_vector(source.force, rows.force, k)
        copy_vector(source.body, rows.body, k)
        copy_vector(source.body_rate, rows.body_rate, k)


@kernel
def is_finite(values: Array) -> bool:
    """Whether all of ``values`` (L, J) are finite."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not math.isfinite(values[i, j]):
                return False
    return True


@kernel
def observes_finite(observation: Observation) -> bool:
    """Whether all values of an observation are finite."""
    for i in range(observation.force.shape[0]):
        if not math.isfinite(observation.force[i]):
            return False
    for n in range(3):
        if not (math.isfinite(observation.body[n]) and math.isfinite(observation.body_rate[n])):
            return False
    return (
        is_finite(observation.q)
        and is_finite(observation.dq)
        and is_finite(observation.foot)
        and is_finite(observation.velocity)
    )


@kernel
def observe(
    sensing: Sensing | None, mechanism: Mechanism, step: int, machine: PlantState, observation: Observation
) -> None:
    """The built-in sensors."""
    if sensing is not None:
        read_sensors(sensing, mechanism, step, machine, observation)


@kernel
def begin(guard: Guard | None, feedforward: FeedforwardParams | None, step: int, sample: int) -> None:
    """The guard of learning, before a step."""
    if guard is not None and needs_judging(guard, sample):
        begin_step(guard, feedforward, step, sample)


@kernel
def predict(
    params: FeedforwardParams | None, guard: Guard | None, step: int, sample: int, error: Array, torque: Array
) -> None:
    """The built-in feedforward, before the feedback: ``error`` (L, J) is the learning error of the last step."""
    if params is not None:
        if lets_learn(guard):
            feedforward_step(params, step, sample, error, torque)
        elif sample == 0:
            log_cycle(params.log, params.weights)


@kernel
def control(
    params: HybridParams | None,
    state: HybridState,
    travel: Array | None,
    step: int,
    sample: int,
    support: Mask,
    reference: Array,
    observation: Observation,
) -> None:
    """The built-in controller, with rows of the plan."""
    if params is not None:
        steer(params.steering, travel, step, sample, support)
        hybrid_feedback(params, state, support, reference, observation)


@kernel
def advance_plant(params: PlantParams | None, engine: Engine | None, machine: PlantState, torque: Array) -> None:
    """The built-in plant."""
    if params is not None:
        advance(params, machine, torque)
    if engine is not None:
        advance_engine(engine, machine, torque)


@kernel
def check_measured(limits: StopLimits, sample: int, machine: PlantState) -> int:
    """:func:`check` for an external plant, whose velocities may be wrong too."""
    status = check(limits, sample, machine)
    if status == RUNNING:
        for n in range(3):
            if not math.isfinite(machine.body_rate[n]):
                return DIVERGED
        if not is_finite(machine.velocity):
            return DIVERGED
    return status


@kernel
def take_fused_steps(loop: Loop, progress: Counts, start: int, samples: Array, body_samples: Array) -> None:
    """:func:`take_steps` for built-in components, without pauses."""
    machine, observation, state = loop.plant_state, loop.observation, loop.control_state
    feedforward, total = loop.torques
    period = loop.support.shape[0]
    sample, status, taken = start % period, RUNNING, 0
    if start == 0 and samples.shape[0] > 0:
        status = check(loop.limits, 0, machine)
    while status == RUNNING and taken < samples.shape[0]:
        step = start + taken
        begin(loop.guard, loop.feedforward, step, sample)
        acting = lets_act(loop.guard, loop.start_step, step)
        observe(loop.sensing, loop.mechanism, step, machine, observation)
        if step >= loop.start_step:
            predict(loop.feedforward, loop.guard, step, sample, state.learning_error, feedforward)
        reference = loop.reference[ACTING if acting else BEFORE, sample]
        control(loop.control, state, loop.travel, step, sample, loop.support[sample], reference, observation)
        take_torque(loop.guard, sample, feedforward)
        actuate(loop.actuator, step, state.feedback, feedforward, total)
        commit(samples, body_samples, taken, loop.travel, machine, observation, state, feedforward)
        watch(loop.guard, sample, loop.support[sample], state, observation)
        weigh(loop.meter, loop.support[sample], observation)
        advance_plant(loop.plant, loop.engine, machine, total)
        taken += 1
        sample = sample + 1 if sample + 1 < period else 0
        status = check(loop.limits, sample, machine)
    progress[TAKEN], progress[STOP] = taken, status


@kernel
def take_steps(
    loop: Loop, inputs: Inputs, progress: Counts, start: int, samples: Array, body_samples: Array
) -> Iterator[tuple[int, int]]:
    """Take as many steps as ``samples`` (K, L, columns) and ``body_samples`` (K, columns) have rows, from ``start``.

    Fills both, with columns as in :mod:`cmacexp.loop.samples`, and ``progress`` (3,); ``inputs`` row by row, before
    the component acts. Yields the method of an external component that has to act before the generator resumes, and
    the row of its input.
    """
    # No local variable holds arrays: each pause would save them, which doubles the time of compiling.
    period, measured = loop.support.shape[0], inputs.plant is not None
    new_joints = measured or inputs.sensors is not None
    progress[TAKEN], progress[STOP], progress[NOT_FINITE] = 0, RUNNING, NO_METHOD
    if start == 0 and samples.shape[0] > 0:
        progress[STOP] = check(loop.limits, 0, loop.plant_state)
        if progress[STOP] != RUNNING:
            return
    sample = start % period
    for k in range(samples.shape[0]):
        step = start + k
        begin(loop.guard, loop.feedforward, step, sample)
        acting = lets_act(loop.guard, loop.start_step, step)
        if inputs.sensors is not None:
            copy_measurement(loop.plant_state, inputs.sensors, k)
            yield MEASURE, k
            if not observes_finite(loop.observation):
                progress[NOT_FINITE] = MEASURE
                return
        else:
            observe(loop.sensing, loop.mechanism, step, loop.plant_state, loop.observation)
        if inputs.controller is not None:
            copy_measurement(loop.observation, inputs.controller, k)
            yield ACT, k
            if not (is_finite(loop.control_state.feedback) and is_finite(loop.torques.feedforward)):
                progress[NOT_FINITE] = ACT
                return
        else:
            if inputs.feedforward is not None and (inputs.observes or (acting and lets_learn(loop.guard))):
                copy_matrix(loop.control_state.learning_error, inputs.feedforward, k)
                yield PREDICT, k
                if not is_finite(loop.torques.feedforward):
                    progress[NOT_FINITE] = PREDICT
                    return
            elif step >= loop.start_step:
                predict(
                    loop.feedforward, loop.guard, step, sample,
                    loop.control_state.learning_error, loop.torques.feedforward,
                )  # fmt: skip
            if new_joints:
                update_geometry(loop.mechanism, loop.observation.q, loop.observation.geometry)
            stage = ACTING if acting else BEFORE
            control(
                loop.control,
                loop.control_state,
                loop.travel,
                step,
                sample,
                loop.support[sample],
                loop.reference[stage, sample],
                loop.observation,
            )
        take_torque(loop.guard, sample, loop.torques.feedforward)
        actuate(loop.actuator, step, loop.control_state.feedback, loop.torques.feedforward, loop.torques.total)
        commit(
            samples, body_samples, k, loop.travel, loop.plant_state, loop.observation, loop.control_state,
            loop.torques.feedforward,
        )  # fmt: skip
        watch(loop.guard, sample, loop.support[sample], loop.control_state, loop.observation)
        weigh(loop.meter, loop.support[sample], loop.observation)
        if inputs.plant is not None:
            copy_matrix(loop.torques.total, inputs.plant, k)
            yield STEP, k
        else:
            advance_plant(loop.plant, loop.engine, loop.plant_state, loop.torques.total)
        progress[TAKEN] = k + 1
        sample = sample + 1 if sample + 1 < period else 0
        if measured:
            progress[STOP] = check_measured(loop.limits, sample, loop.plant_state)
        else:
            progress[STOP] = check(loop.limits, sample, loop.plant_state)
        if progress[STOP] != RUNNING:
            return
