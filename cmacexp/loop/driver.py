"""The driver of the loop, and the external components that its hooks call.

A component owns its inputs: it may keep them, and nothing that it writes into them reaches the loop.
"""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadOutput, Diverged
from cmacexp.feedforward import Observes
from cmacexp.feedforward.kernels import FeedforwardParams
from cmacexp.jit.hooks import Hook
from cmacexp.jit.interrupt import interruptible
from cmacexp.loop.builtin import External, find_external, make_loop
from cmacexp.loop.guard import Guard
from cmacexp.loop.guard_kernels import lets_act
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.step import FAILED_COMPONENT, Hooks, Loop, step_loop
from cmacexp.loop.validation import (
    DRIVE_NAMES,
    SIGNAL_NAMES,
    copy_drive,
    copy_measurement,
    copy_outputs,
    copy_parts,
    make_measurement_targets,
    make_targets,
    require_finite,
    require_finite_state,
)
from cmacexp.planning.plan import Plan, Reference
from cmacexp.planning.reference import ACTING, BEFORE, ControlReference
from cmacexp.plants.drives import ANGLE, DAMPING, DRIVE, FEEDFORWARD, STIFFNESS, TORQUE, VELOCITY
from cmacexp.protocols import Action, Drive, Measurement, RobotSignals, WatchesForce, copy_state, offers, view_state
from cmacexp.typing import Array


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """A view of an array, of the same shape and unit, that cannot be written to."""
    return np.broadcast_to(values, values.shape)


def list_rows(plan: Plan, stage: int) -> list[tuple[Any, ...]]:
    """Fields of a Reference but for the first three, of each sample of a ``stage``, read-only."""
    control = ControlReference(*(values[stage] for values in plan.reference))
    named = (
        map(type(each)._make, zip(*map(read_only, each), strict=True))
        for each in (control, plan.desired, plan.joints)
    )
    return list(zip(read_only(plan.support), *named, read_only(plan.force_desired), strict=True))


class ExternalComponents:
    """The components of a scenario as hooks call them: with inputs of their own, and answers that are checked."""

    def __init__(self, scenario: Scenario, loop: Loop, external: External):
        self.loop, self.external = loop, external
        self.plant, self.sensors = scenario.plant, scenario.sensors
        self.controller, self.feedforward = scenario.controller, scenario.feedforward
        self.state = view_state(loop.plant_state, loop.travel)
        self.observation = view_state(loop.observation, loop.observation.travel)
        state, torques, drives = loop.control_state, loop.torques, loop.drives
        self.measured, self.observed = map(make_measurement_targets, (self.state, self.observation))
        self.signals = [] if loop.signals is None else make_targets(SIGNAL_NAMES, loop.signals)
        self.action = make_targets(Action._fields[:3], (state.feedback, torques.feedforward, state.reference))
        self.trusted = make_targets(("force_trusted",), (state.fault_status.trusted,))
        self.learning_error = make_targets(("learning_error",), (state.learning_error,))
        self.drive = [] if drives is None else make_targets(DRIVE_NAMES, drives.command[ANGLE:])
        self.torque = make_targets(("torque",), (torques.feedforward,))
        self.has_fault_status = external.controller and offers(scenario.controller, WatchesForce)
        loop.shows[0] = 1
        self.divergence = ""
        """Cause that an external plant itself reported, if it has diverged."""
        self.period = len(loop.support)
        asks = external.controller or loop.feedforward is None or offers(scenario.feedforward, Observes)
        # What is given a reference; to make them takes as long as a short run.
        self.plan_rows = [list_rows(scenario.setup.plan, stage) for stage in (BEFORE, ACTING)] if asks else []

    def make_hooks(self) -> Hooks:
        """A hook for each external component, and one that shows steps to a feedforward that asks for it."""
        external, params = self.external, self.loop.feedforward
        observes = offers(self.feedforward, Observes) and (external.controller or external.feedforward)
        parts = {
            "sensors": (external.sensors, self._measure),
            "observer": (observes, self._show),
            "controller": (external.controller, self._act),
            "feedforward": (external.feedforward, self._predict if params is None else partial(self._play, params)),
            "plant": (external.plant, self._step),
        }
        return Hooks(**{name: Hook(interruptible(call)) for name, (is_called, call) in parts.items() if is_called})

    def _refer(self, step: int) -> Reference:
        """The reference of a step."""
        sample, acting = step % self.period, bool(lets_act(self.loop.guard, self.loop.start_step, step))
        return Reference._make((step, sample, acting, *self.plan_rows[ACTING if acting else BEFORE][sample]))

    def _measure(self, step: int) -> None:
        true, seen = copy_state(self.state, self.loop.travel, self.loop.signals), self.observation.travel
        if seen is not None:  # unless they measure that too
            seen[...] = self.loop.travel
        copy_measurement(self.sensors, "measure", self.sensors.measure(true), self.observed)

    def _show(self, step: int) -> None:
        """Show what the sensors show, and what the plant took."""
        seen = copy_state(self.observation), self.loop.torques.total.copy()
        goes_on = self.feedforward.observe(self._refer(step), *seen)  # type: ignore[attr-defined]  # it Observes
        self.loop.shows[0] = goes_on is None or bool(goes_on)

    def _act(self, step: int) -> None:
        reference, state = self._refer(step), self.loop.control_state
        action = self.controller.act(reference, copy_state(self.observation, self.observation.travel))
        if self.has_fault_status:
            trusted = self.controller.force_trusted  # type: ignore[attr-defined]
            copy_outputs(self.controller, "force_trusted", (trusted,), self.trusted)
        copy_parts(self.controller, "act", action, Action, self.action)
        if action.reference is None:
            state.reference[...] = reference.control.position
        if self.loop.guard is not None:  # what teaches is known to the controller alone
            error = state.feedback if action.learning_error is None else action.learning_error
            copy_outputs(self.controller, "act", (error,), self.learning_error)
        if self.loop.drives is not None:
            copy_drive(self.controller, action.drive, self.drive)
        elif action.drive is not None:
            name = type(self.controller).__name__
            raise BadOutput(f"{name}.act returned a drive, which nothing takes: give {name} sends_drives = True")

    def _predict(self, step: int) -> None:
        torque = self.feedforward.predict(self._refer(step), self.loop.control_state.learning_error.copy())
        copy_outputs(self.feedforward, "predict", (torque,), self.torque)

    def _play(self, params: FeedforwardParams, step: int) -> None:
        """Complete the feedback of the last steps, and get the torque of the next ones."""
        sample = step % self.period
        params.feedback[sample - 1] = self.loop.control_state.learning_error
        torque = self.feedforward.play(sample, read_only(params.feedback))  # type: ignore[attr-defined]  # it Plays
        copy_outputs(self.feedforward, "play", (torque,), make_targets(("torque",), (params.torque,)))
        require_finite(self.feedforward, "play", "torque", params.torque)

    def _step(self, step: int) -> None:
        try:
            measured = self._advance()
        except Diverged as error:
            self.divergence = str(error)
            self.state.q[...] = np.nan  # for which the check of this step stops the run
            return
        copy_measurement(self.plant, "step", measured, self.measured)
        if self.loop.signals is not None:
            copy_parts(self.plant, "step", measured.signals, RobotSignals, self.signals, "signals=")
            self._note_drives(self.loop.signals)
        if step == 0:
            require_finite_state(self.plant, "step", self.state)

    def _advance(self) -> Measurement:
        """Let an external plant take its torque, or its torque and what its drives are to do."""
        torque, drives = self.loop.torques.total.copy(), self.loop.drives
        if drives is None:
            return self.plant.step(torque)
        parts = (drives.command[part].copy() for part in (ANGLE, VELOCITY, STIFFNESS, DAMPING))
        return self.plant.step(torque, Drive(*parts))  # type: ignore[call-arg]  # its takes_drives says so

    def _note_drives(self, signals: RobotSignals) -> None:
        """What the drives of an external plant, if it has any, added to the torque that was sent to them."""
        drives = self.loop.drives
        if drives is None:
            return
        feedback, feedforward = self.loop.control_state.feedback, self.loop.torques.feedforward
        drives.acted[TORQUE], drives.acted[FEEDFORWARD] = feedback, feedforward
        drives.acted[DRIVE] = signals.torque - feedback - feedforward

    def require_finite(self) -> None:
        """Refuse what sensors, controller or feedforward gave that is not finite; raises BadOutput."""
        torque, feedback = self.loop.torques.feedforward, self.loop.control_state.feedback
        if self.external.sensors:
            require_finite_state(self.sensors, "measure", self.observation)
        if self.external.controller:
            require_finite(self.controller, "act", "feedback", feedback)
            require_finite(self.controller, "act", "feedforward", torque)
        if self.external.feedforward:
            require_finite(self.feedforward, "predict", "torque", torque)


class Driver:
    """Runs the loop of a scenario; taking no step compiles its program."""

    def __init__(self, scenario: Scenario, guard: Guard | None = None):
        external = find_external(scenario)
        self.loop = loop = make_loop(scenario, external, guard)
        self.components = ExternalComponents(scenario, loop, external) if any(external) else None
        self.hooks = Hooks() if self.components is None else self.components.make_hooks()
        if guard is not None:
            self.hooks = self.hooks._replace(guard=Hook(guard.begin_step))
        self.taken, (legs, joints) = 0, loop.torques.total.shape
        """Steps whose torque the plant has taken, also when a component raised."""
        self.state = view_state(loop.plant_state)
        self.run(*make_samples(1, legs, False, joints), steps=0)

    @property
    def divergence(self) -> str:
        """Cause that an external plant itself reported, if it has diverged; a built-in one knows its own."""
        return "" if self.components is None else self.components.divergence

    def run(self, samples: Array, body_samples: Array, first: int = 0, steps: int | None = None) -> int:
        """Take so many ``steps``, None: as many as there is room for.

        Fills ``samples`` (columns, K, L) and ``body_samples`` (columns, K) from their place ``first`` on.

        Returns RUNNING, DIVERGED or FELL; raises what a component raised, or BadOutput of its answer.
        """
        count = samples.shape[1] - first if steps is None else steps
        taken, stop = step_loop(self.loop, self.hooks, self.taken, count, samples, body_samples, first)
        self.taken += taken
        if stop == FAILED_COMPONENT:
            for hook in filter(None, self.hooks):
                hook.raise_error()
            if self.components is not None:
                self.components.require_finite()
        return stop
