"""The driver of the loop, and the calls of external components by its hooks.

External components get copies of their inputs: they may keep or overwrite them without an effect on the loop.
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
from cmacexp.loop.parts import Hooks, Loop
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.step import FAILED_COMPONENT, step_loop
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
    """Return a read-only view of ``values``, with the same shape and unit."""
    return np.broadcast_to(values, values.shape)


def list_rows(plan: Plan, stage: int) -> list[tuple[Any, ...]]:
    """List the planned fields of a Reference (all but the first three) by sample, as read-only arrays.

    ``stage`` selects the references of the controller: BEFORE the feedforward acts, or ACTING.
    """
    control = ControlReference(*(values[stage] for values in plan.reference))
    rows = (
        map(type(table)._make, zip(*map(read_only, table), strict=True))
        for table in (control, plan.desired, plan.joints)
    )
    return list(zip(read_only(plan.support), *rows, read_only(plan.force_desired), strict=True))


class ExternalComponents:
    """External components of a scenario, which hooks call with copies of their inputs; outputs are checked."""

    def __init__(self, scenario: Scenario, loop: Loop, external: External):
        self.loop = loop
        self.external = external
        self.plant = scenario.plant
        self.sensors = scenario.sensors
        self.controller = scenario.controller
        self.feedforward = scenario.feedforward
        self.state = view_state(loop.plant.state, loop.plant.travel)
        self.observation = view_state(loop.sensors.observation, loop.sensors.observation.travel)
        state = loop.controller.state
        self.measured, self.observed = map(make_measurement_targets, (self.state, self.observation))
        self.signals = [] if loop.plant.signals is None else make_targets(SIGNAL_NAMES, loop.plant.signals)
        self.action = make_targets(Action._fields[:3], (state.feedback, loop.torques.feedforward, state.reference))
        self.trusted = make_targets(("force_trusted",), (state.fault_status.trusted,))
        self.learning_error = make_targets(("learning_error",), (state.learning_error,))
        self.drive = [] if loop.drives is None else make_targets(DRIVE_NAMES, loop.drives.command[ANGLE:])
        self.torque = make_targets(("torque",), (loop.torques.feedforward,))
        self.has_fault_status = external.controller and offers(scenario.controller, WatchesForce)
        loop.shows[0] = 1
        self.divergence = ""
        """Cause of a divergence as an external plant reported it."""
        self.period = len(loop.plan.support)
        # To list the references takes as long as a short run.
        needs_rows = external.controller or loop.feedforward is None or offers(scenario.feedforward, Observes)
        self.plan_rows = [list_rows(scenario.setup.plan, stage) for stage in (BEFORE, ACTING)] if needs_rows else []

    def make_hooks(self) -> Hooks:
        """Make a hook for each external component, and one for a feedforward that observes the steps."""
        external = self.external
        params = self.loop.feedforward
        observes = offers(self.feedforward, Observes) and (external.controller or external.feedforward)
        calls = {
            "sensors": (external.sensors, self._measure),
            "observer": (observes, self._show),
            "controller": (external.controller, self._act),
            "feedforward": (external.feedforward, self._predict if params is None else partial(self._play, params)),
            "plant": (external.plant, self._step),
        }
        return Hooks(**{name: Hook(interruptible(call)) for name, (is_called, call) in calls.items() if is_called})

    def _refer(self, step: int) -> Reference:
        """Return the reference of a step."""
        sample = step % self.period
        acting = bool(lets_act(self.loop.guard, self.loop.plan.start_step, step))
        return Reference._make((step, sample, acting, *self.plan_rows[ACTING if acting else BEFORE][sample]))

    def _measure(self, step: int) -> None:
        if self.observation.travel is not None:  # the default for sensors that do not measure it
            self.observation.travel[...] = self.loop.plant.travel
        true = copy_state(self.state, self.loop.plant.travel, self.loop.plant.signals)
        copy_measurement(self.sensors, "measure", self.sensors.measure(true), self.observed)

    def _show(self, step: int) -> None:
        """Call ``observe`` of the feedforward, with the measurement and the last torque of the plant."""
        inputs = copy_state(self.observation), self.loop.torques.total.copy()
        goes_on = self.feedforward.observe(self._refer(step), *inputs)  # type: ignore[attr-defined]  # it Observes
        self.loop.shows[0] = goes_on is None or bool(goes_on)

    def _act(self, step: int) -> None:
        reference = self._refer(step)
        state = self.loop.controller.state
        action = self.controller.act(reference, copy_state(self.observation, self.observation.travel))
        if self.has_fault_status:
            trusted = self.controller.force_trusted  # type: ignore[attr-defined]
            copy_outputs(self.controller, "force_trusted", (trusted,), self.trusted)
        copy_parts(self.controller, "act", action, Action, self.action)
        if action.reference is None:
            state.reference[...] = reference.control.position
        if self.loop.guard is not None:  # only the controller knows the learning error
            error = state.feedback if action.learning_error is None else action.learning_error
            copy_outputs(self.controller, "act", (error,), self.learning_error)
        if self.loop.drives is not None:
            copy_drive(self.controller, action.drive, self.drive)
        elif action.drive is not None:
            name = type(self.controller).__name__
            raise BadOutput(f"{name}.act returned a drive, which nothing takes: give {name} sends_drives = True")

    def _predict(self, step: int) -> None:
        torque = self.feedforward.predict(self._refer(step), self.loop.controller.state.learning_error.copy())
        copy_outputs(self.feedforward, "predict", (torque,), self.torque)

    def _play(self, params: FeedforwardParams, step: int) -> None:
        """Store the learning error of the last step, and call ``play`` for the torque of the next block."""
        sample = step % self.period
        params.feedback[sample - 1] = self.loop.controller.state.learning_error
        torque = self.feedforward.play(sample, read_only(params.feedback))  # type: ignore[attr-defined]  # it Plays
        copy_outputs(self.feedforward, "play", (torque,), make_targets(("torque",), (params.torque,)))
        require_finite(self.feedforward, "play", "torque", params.torque)

    def _step(self, step: int) -> None:
        try:
            measured = self._advance()
        except Diverged as error:
            self.divergence = str(error)
            self.state.q[...] = np.nan  # so that the check of this step stops the run
            return
        copy_measurement(self.plant, "step", measured, self.measured)
        if self.loop.plant.signals is not None:
            copy_parts(self.plant, "step", measured.signals, RobotSignals, self.signals, "signals=")
            self._note_drives(self.loop.plant.signals)
        if step == 0:
            require_finite_state(self.plant, "step", self.state)

    def _advance(self) -> Measurement:
        """Step the external plant with the torque, and with the command to its drives if it has any."""
        torque = self.loop.torques.total.copy()
        drives = self.loop.drives
        if drives is None:
            return self.plant.step(torque)
        command = (drives.command[row].copy() for row in (ANGLE, VELOCITY, STIFFNESS, DAMPING))
        return self.plant.step(torque, Drive(*command))  # type: ignore[call-arg]  # its takes_drives says so

    def _note_drives(self, signals: RobotSignals) -> None:
        """Record the torque that the drives of an external plant, if any, added to the torque sent to them."""
        drives = self.loop.drives
        if drives is None:
            return
        drives.acted[TORQUE] = self.loop.controller.state.feedback
        drives.acted[FEEDFORWARD] = self.loop.torques.feedforward
        drives.acted[DRIVE] = signals.torque - self.loop.controller.state.feedback - self.loop.torques.feedforward

    def require_finite(self) -> None:
        """Check that outputs of external sensors, controller and feedforward are finite; raises BadOutput."""
        if self.external.sensors:
            require_finite_state(self.sensors, "measure", self.observation)
        if self.external.controller:
            require_finite(self.controller, "act", "feedback", self.loop.controller.state.feedback)
            require_finite(self.controller, "act", "feedforward", self.loop.torques.feedforward)
        if self.external.feedforward:
            require_finite(self.feedforward, "predict", "torque", self.loop.torques.feedforward)


class Driver:
    """Driver of the loop of a scenario; a run of zero steps compiles its program."""

    def __init__(self, scenario: Scenario, guard: Guard | None = None):
        external = find_external(scenario)
        self.loop = loop = make_loop(scenario, external, guard)
        self.components = ExternalComponents(scenario, loop, external) if any(external) else None
        self.hooks = Hooks() if self.components is None else self.components.make_hooks()
        if guard is not None:
            self.hooks = self.hooks._replace(guard=Hook(guard.begin_step))
        self.taken = 0
        """Number of steps whose torque was applied to the plant, counted also if a component raised later."""
        self.state = view_state(loop.plant.state)
        legs, joints = loop.torques.total.shape
        self.run(*make_samples(1, legs, False, joints), steps=0)

    @property
    def divergence(self) -> str:
        """Cause of a divergence that an external plant reported; empty for built-in plants."""
        return "" if self.components is None else self.components.divergence

    def run(self, samples: Array, body_samples: Array, first: int = 0, steps: int | None = None) -> int:
        """Run the loop for ``steps`` steps, or until the arrays are full if None, and return why it stopped.

        It fills ``samples`` (columns, K, L) and ``body_samples`` (columns, K) from index ``first`` of axis K on.

        Returns RUNNING, DIVERGED or FELL. Raises the exception of a component, or BadOutput for an invalid output.
        """
        count = samples.shape[1] - first if steps is None else steps
        steps_taken, stop = step_loop(self.loop, self.hooks, self.taken, count, samples, body_samples, first)
        self.taken += steps_taken
        if stop == FAILED_COMPONENT:
            for hook in filter(None, self.hooks):
                hook.raise_error()
            if self.components is not None:
                self.components.require_finite()
        return stop
