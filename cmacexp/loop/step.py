"""One step of the closed loop: guard, sensors, feedforward, controller, actuator, samples and plant, in this order.

A step has two halves, :func:`sense` and :func:`act`. :func:`take_steps` runs both, compiled or as plain Python with
the same bits; :mod:`cmacexp.loop.stepwise` pauses between them. Hooks call the external components.
"""

from cmacexp.control.actuator import actuate
from cmacexp.control.drive_kernels import DriveParams, command_drives
from cmacexp.control.hybrid_kernels import HybridParams, HybridState, hybrid_feedback
from cmacexp.control.load_meter import accumulate_load
from cmacexp.control.steering import steer
from cmacexp.feedforward.kernels import FeedforwardParams, feedforward_step, log_cycle
from cmacexp.jit.compiler import kernel, program
from cmacexp.jit.hooks import DONE, Hook
from cmacexp.jit.kernels import by_type
from cmacexp.loop.guard_kernels import (
    GuardState,
    accumulate_cycle,
    correct_torque,
    lets_act,
    lets_learn,
    record_torque,
)
from cmacexp.loop.parts import Hooks, Loop
from cmacexp.loop.samples import write_drives, write_samples
from cmacexp.loop.stop import DIVERGED, RUNNING, StopLimits, is_finite, moves_finite, observes_finite, stop_reason
from cmacexp.models.mechanism import Mechanism, update_kinematics
from cmacexp.planning.reference import ACTING, BEFORE, ControlReference, select
from cmacexp.plants.drives import Drives, send_command
from cmacexp.plants.kernels import PlantParams, PlantState, advance
from cmacexp.plants.mujoco_kernels import Engine, advance_engine
from cmacexp.protocols import RobotSignals
from cmacexp.sensors.estimator import Proprioception, estimate
from cmacexp.sensors.kernels import Observation, Sensing, read_sensors
from cmacexp.typing import Array, Mask

FAILED_COMPONENT = -1
"""Reason of a stop: an external component raised an exception or returned a value that is not finite."""


@kernel
def call(hook: Hook | None, step: int) -> bool:
    """Call a hook, if there is one, for ``step``; return False if it raised an exception."""
    return hook is None or hook(step) == DONE


@kernel
def begin(
    hook: Hook | None, guard: GuardState | None, feedforward: FeedforwardParams | None, step: int, sample: int
) -> bool:
    """Run the guard of learning at the start of a cycle or after an alarm; return False if its hook raised."""
    if guard is not None and (sample == 0 or guard.alarm[0] != 0):
        if not call(hook, step):
            return False
        correct_torque(guard, feedforward)
    return True


@kernel
def read_true_state(
    sensing: Sensing,
    mechanism: Mechanism,
    step: int,
    machine: PlantState,
    signals: RobotSignals | None,
    support: Mask,
    observation: Observation,
) -> None:
    """Run sensors that measure the true state of the machine."""
    read_sensors(sensing, mechanism, step, machine, observation)


@kernel
def read_own_signals(
    sensing: Proprioception,
    mechanism: Mechanism,
    step: int,
    machine: PlantState,
    signals: RobotSignals | None,
    support: Mask,
    observation: Observation,
) -> None:
    """Run the state estimator of a robot on its onboard ``signals`` and the planned ``support`` (L,)."""
    if signals is not None:
        estimate(sensing.estimator, sensing.sensing, mechanism, signals, step, support, observation)


measure = by_type({Sensing: read_true_state, Proprioception: read_own_signals})


@kernel
def observe(
    hook: Hook | None,
    sensing: Sensing | Proprioception | None,
    mechanism: Mechanism,
    step: int,
    machine: PlantState,
    signals: RobotSignals | None,
    support: Mask,
    observation: Observation,
) -> bool:
    """Run the sensors; return False if external ones raised an exception or gave values that are not finite."""
    if hook is not None:
        return hook(step) == DONE and observes_finite(observation)
    if sensing is not None:
        measure(sensing, mechanism, step, machine, signals, support, observation)
    return True


@kernel
def update_given_joints(
    plant: Hook | None, sensors: Hook | None, mechanism: Mechanism, observation: Observation
) -> None:
    """Update the kinematics if an external plant or external sensors supplied the joint angles."""
    if plant is not None or sensors is not None:
        update_kinematics(mechanism, observation.q, observation.kinematics)


@kernel
def predict(
    params: FeedforwardParams | None, guard: GuardState | None, step: int, sample: int, error: Array, torque: Array
) -> None:
    """Run the built-in feedforward before the feedback: while learning it fills ``torque`` (L, J), N m.

    ``error`` (L, J), N m, is the learning error of the last step. While a torque is repeated, only logs are written.
    """
    if params is not None:
        if lets_learn(guard):
            feedforward_step(params, step, sample, error, torque)
        elif sample == 0:
            log_cycle(params.log, params.weights)


@kernel
def control_hybrid(
    params: HybridParams,
    state: HybridState,
    drives: Drives | None,
    step: int,
    sample: int,
    support: Mask,
    reference: ControlReference,
    observation: Observation,
) -> None:
    """Run hybrid position/force control with planned ``support`` (L,) and ``reference`` of this ``sample``."""
    steer(params.steering, observation.travel, step, sample, support)
    hybrid_feedback(params, state, support, reference, observation)


@kernel
def control_drives(
    params: DriveParams,
    state: HybridState,
    drives: Drives | None,
    step: int,
    sample: int,
    support: Mask,
    reference: ControlReference,
    observation: Observation,
) -> None:
    """Compute commands for drives with local loops; arguments as for :func:`control_hybrid`."""
    if drives is not None:
        steer(params.steering, observation.travel, step, sample, support)
        command_drives(params, state, drives.command, sample, support, reference, observation)


control = by_type({HybridParams: control_hybrid, DriveParams: control_drives})


@kernel
def begins_block(params: FeedforwardParams | None, sample: int) -> bool:
    """Return True if an external feedforward is called in this step: in every step unless it plays blocks."""
    return params is None or params.block == 0 or sample % params.block == 0


@kernel
def ask_feedforward(hook: Hook | None, step: int, torque: Array) -> bool:
    """Call an external feedforward; return False if it raised an exception or its torque is not finite."""
    return hook is None or (call(hook, step) and is_finite(torque))


@kernel
def advance_analytic(params: PlantParams, machine: PlantState, torque: Array, drives: Drives | None) -> None:
    """Advance the analytic plant by one sampling period under ``torque`` (L, J), N m."""
    advance(params, machine, torque)


advance_by_type = by_type({PlantParams: advance_analytic, Engine: advance_engine})


@kernel
def advance_plant(
    hook: Hook | None,
    params: PlantParams | Engine | None,
    step: int,
    machine: PlantState,
    torque: Array,
    drives: Drives | None,
) -> bool:
    """Advance the plant under ``torque`` (L, J), N m, or under ``drives``; return False if an external one raised."""
    if hook is not None:
        return hook(step) == DONE
    if params is not None:
        advance_by_type(params, machine, torque, drives)
    return True


@kernel
def check(hook: Hook | None, limits: StopLimits, sample: int, machine: PlantState) -> int:
    """Return RUNNING, or the reason to stop at the start of a step.

    With an external plant (``hook``) the velocities are checked too.
    """
    status = stop_reason(limits, sample, machine)
    if hook is not None and status == RUNNING and not moves_finite(machine):
        return DIVERGED
    return status


@kernel
def sense(loop: Loop, hooks: Hooks, step: int, sample: int) -> bool:
    """Run the first half of a step, before the torques: guard and sensors; return False if a component failed."""
    plant = loop.plant
    sensors = loop.sensors
    mechanism = loop.mechanism
    support = loop.plan.support[sample]
    if not begin(hooks.guard, loop.guard, loop.feedforward, step, sample):
        return False
    if not observe(
        hooks.sensors, sensors.params, mechanism, step, plant.state, plant.signals, support, sensors.observation
    ):
        return False
    update_given_joints(hooks.plant, hooks.sensors, mechanism, sensors.observation)
    return loop.shows[0] == 0 or call(hooks.observer, step)


@kernel
def act(loop: Loop, hooks: Hooks, step: int, sample: int, k: int, samples: Array, body_samples: Array) -> bool:
    """Run the second half of a step: torques, samples and plant; return False if a component failed.

    It fills step ``k`` of ``samples`` (columns, K, L) and ``body_samples`` (columns, K).
    """
    plan = loop.plan
    plant = loop.plant
    observation = loop.sensors.observation
    controller = loop.controller
    feedforward = loop.feedforward
    guard = loop.guard
    drives = loop.drives
    state = controller.state
    learnt, total = loop.torques
    support = plan.support[sample]
    if hooks.controller is not None:
        if not (call(hooks.controller, step) and is_finite(state.feedback) and is_finite(learnt)):
            return False
    else:
        acting = lets_act(guard, plan.start_step, step)
        asks = acting and lets_learn(guard) and begins_block(feedforward, sample)
        if asks and not ask_feedforward(hooks.feedforward, step, learnt):
            return False
        if step >= plan.start_step:
            predict(feedforward, guard, step, sample, state.learning_error, learnt)
        reference = select(plan.reference, ACTING if acting else BEFORE, sample)
        if controller.params is not None:
            control(controller.params, state, drives, step, sample, support, reference, observation)
    record_torque(guard, sample, learnt)
    actuate(loop.actuator, step, state.feedback, learnt, total)
    send_command(drives, step, state.feedback, learnt)
    write_samples(
        samples,
        body_samples,
        k=k,
        travel=plant.travel,
        machine=plant.state,
        observation=observation,
        control=state,
        feedforward=learnt,
    )
    accumulate_cycle(guard, sample, support, state, observation)
    accumulate_load(loop.meter, support, observation)
    if not advance_plant(hooks.plant, plant.params, step, plant.state, total, drives):
        return False
    write_drives(samples, k, drives)
    return True


@kernel
def take_steps(
    loop: Loop, hooks: Hooks, start: int, steps: int, samples: Array, body_samples: Array, first: int
) -> tuple[int, int]:
    """Run up to ``steps`` steps of the loop from step ``start`` on.

    It fills ``samples`` (columns, K, L) and ``body_samples`` (columns, K), with columns as in
    :mod:`cmacexp.loop.samples`, from index ``first`` of axis K on. Returns the number of steps whose torque was
    applied to the plant, and RUNNING or the reason of a stop: DIVERGED, FELL or FAILED_COMPONENT.
    """
    limits = loop.limits
    machine = loop.plant.state
    period = loop.plan.support.shape[0]
    sample = start % period
    step = start
    status = RUNNING
    if start == 0 and steps > 0:
        status = stop_reason(limits, sample, machine)
    while status == RUNNING and step < start + steps:
        k = first + step - start
        if not (sense(loop, hooks, step, sample) and act(loop, hooks, step, sample, k, samples, body_samples)):
            return step - start, FAILED_COMPONENT
        step += 1
        sample = sample + 1 if sample + 1 < period else 0
        status = check(hooks.plant, limits, sample, machine)
    return step - start, status


step_loop = program(take_steps)
