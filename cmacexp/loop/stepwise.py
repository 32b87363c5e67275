"""A loop that is stepped from outside: the caller supplies the feedforward torque of every step.

A compiled generator pauses between the halves of a step: resuming it is ten times as fast as entering a program. A
reset restores the initial state and reuses all objects.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmacexp.errors import BadOutput, CmacexpError, require
from cmacexp.jit.compiler import kernel, program
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.loop.adaptation import Adaptation
from cmacexp.loop.builtin import External, find_external, make_loop
from cmacexp.loop.driver import list_rows
from cmacexp.loop.parts import Hooks, Loop
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.state import Snapshot, list_arrays
from cmacexp.loop.step import act, check, sense
from cmacexp.loop.stop import RUNNING, STATUSES, describe_stop, stop_reason
from cmacexp.planning.reference import BEFORE, ControlReference, Motion
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.protocols import Measurement, view_state
from cmacexp.sensors.estimator import Proprioception
from cmacexp.sensors.real import make_keys
from cmacexp.typing import Array, Mask, Status

BUILT_IN = Hooks()
"""No hooks, since all components are built in."""
OUTSIDE = External(plant=False, sensors=False, controller=False, feedforward=True)
"""Flags of a loop whose feedforward torque comes from the caller."""


@kernel
def pause_in_steps(loop: Loop, start: int, samples: Array, body_samples: Array) -> Iterator[tuple[int, int]]:
    """Run built-in components like :func:`cmacexp.loop.step.take_steps`, but pause in each step before its torques.

    It fills ``samples`` (columns, K, L) and ``body_samples`` (columns, K). Each pause yields the number of completed
    steps and RUNNING; the last one yields the reason of the stop instead.
    """
    # No local variable holds arrays: each pause would save them, which doubles the time of compiling.
    period = loop.plan.support.shape[0]
    sample = start % period
    step_count = 0
    status = RUNNING
    if start == 0:
        status = stop_reason(loop.limits, 0, loop.plant.state)
    while status == RUNNING and step_count < samples.shape[1]:
        sense(loop, BUILT_IN, start + step_count, sample)
        yield step_count, RUNNING
        act(loop, BUILT_IN, start + step_count, sample, step_count, samples, body_samples)
        step_count += 1
        sample = sample + 1 if sample + 1 < period else 0
        status = check(None, loop.limits, sample, loop.plant.state)
    yield step_count, status


pausing_loop = program(pause_in_steps)


class LoopState(NamedTuple):
    """State of the loop at the start of a step. Its arrays belong to the loop; the next step overwrites them."""

    step: int
    """Number of the step in the run, from 0."""
    sample: int
    """Number of the step in its cycle, 0 to N - 1."""
    status: str
    """``running``, ``completed``, ``fell`` or ``diverged``; further steps are possible only while running."""
    cause: str
    """Cause of a fall or divergence, with step and time; else empty."""
    state: Measurement
    """True state of the machine."""
    observed: Measurement
    """Measured state, the input of the controller; not updated after the last step."""
    support: Mask
    """(L,): planned phase, True in support."""
    control: ControlReference
    """Reference of the controller, (L, J) and (L,)."""
    foot_motion: Motion
    """Desired motion of the feet, (L, J)."""
    force_desired: Array
    """(L,): desired contact force, N."""
    learning_error: Array
    """(L, J): learning error J^T U of the last step, N m, from which a feedforward would learn."""
    feedback: Array
    """(L, J): feedback torque of the last step, N m, as applied to the plant or as sent to drives."""


class OpenLoop:
    """A loop without feedforward, stepped by the caller; :func:`cmacexp.open_loop` makes one from overrides.

    Raises CmacexpError if a component is external, and the exception of a component whose reset failed.

    Attributes:
        setup: config, machine and plan.
        shape: (L, J), legs and joints per leg: the shape of a torque.
        moment: present state of the loop.
        sampling_period: sampling period, s.
        period: steps per cycle, N.
        steps: steps of the whole run.
        torque_limits: (J,): largest torque of the joints of a leg, N m; infinite for unlimited joints.
    """

    def __init__(self, scenario: Scenario):
        if scenario.fault is not None:
            raise scenario.fault
        if any(find_external(scenario)):
            raise CmacexpError("only built-in plants, sensors and controllers can be stepped from outside")
        scenario.begin()
        self.setup = setup = scenario.setup
        config = setup.config
        self.shape = setup.mechanism.shape
        self.sampling_period = config.sampling_period
        self.period = config.steps_per_cycle
        self.steps = config.cycles * self.period
        self._loop = make_loop(scenario, OUTSIDE)
        self.torque_limits = self._loop.actuator.limit
        self._plant = scenario.plant if isinstance(scenario.plant, MujocoPlant) else None
        self._adaptation = None if self._loop.meter is None else Adaptation(setup, self._loop.meter)
        self._planned = list_rows(setup.plan, BEFORE)
        self._state = view_state(self._loop.plant.state, self._loop.plant.travel)
        observation = self._loop.sensors.observation
        self._observed = view_state(observation, observation.travel)
        self._samples = make_samples(self.period, self.shape[0], False, self.shape[1])
        self._start = Snapshot(item.array for item in list_arrays(self._loop) if item.role is not None)
        if self._plant is not None:
            self._plant.hold()
        self.moment = self.reset()

    _pauses: Iterator[tuple[int, int]]
    """Generator that pauses in each step of the present cycle."""

    def reset(self, seed: int | None = None) -> LoopState:
        """Return to the start of the run.

        ``seed``, below 2^32, selects the sensor noise; None keeps the present seed. Raises BadInput for other seeds.
        """
        require(seed is None or 0 <= seed < 2**32, "seed", seed, "must be at least 0 and below 2^32")
        with interrupt_held_back():  # MuJoCo would lose an interrupt raised in one of its callbacks
            if self._plant is not None:
                self._plant.put()
            self._start.restore()
            if self._adaptation is not None:
                self._adaptation.reset()
            sensing = self._loop.sensors.params
            if isinstance(sensing, Proprioception):
                sensing = sensing.sensing
            if seed is not None and sensing is not None:
                sensing.keys[...] = make_keys(len(sensing.keys), seed)
            self._cycle = 0
            self._begin_cycle()
            return self._pause()

    def step(self, torque: ArrayLike) -> LoopState:
        """Take a step with a feedforward ``torque`` (L, J), N m; raises BadOutput, or CmacexpError after the end."""
        if self.moment.status != "running":
            raise CmacexpError(f"the run has {self.moment.status}: reset() starts it again")
        values = np.asarray(torque, dtype=float)
        if values.shape != self.shape or not np.isfinite(values).all():
            raise BadOutput(f"torque {values}: must be finite numbers of shape {self.shape}")
        self._loop.torques.feedforward[...] = values
        if self._plant is None:
            return self._pause()
        with interrupt_held_back():  # as above
            return self._pause()

    def _pause(self) -> LoopState:
        """Run to the start of the next step, or to the end, and return the state."""
        step_count, stop = next(self._pauses)
        step = self._cycle * self.period + step_count
        if stop != RUNNING:
            reported = "" if self._plant is None else self._plant.divergence
            cause = describe_stop(self._loop.limits, stop, step, self.sampling_period, self._state, reported)
            return self._note(step, STATUSES[stop], cause)
        if step == self.steps:
            return self._note(step, Status.COMPLETED)
        if step_count == self.period:
            self._cycle += 1
            self._begin_cycle()
            return self._pause()
        return self._note(step, "running")

    def _begin_cycle(self) -> None:
        if self._adaptation is not None:
            if self._cycle > 0:
                self._adaptation.end_cycle()
            self._adaptation.update_plan(self._cycle + 1)
        start = self._cycle * self.period
        self._pauses = pausing_loop(self._loop, start, *self._samples)

    def _note(self, step: int, status: str, cause: str = "") -> LoopState:
        sample = step % self.period
        support, reference, foot_motion, _, force_desired = self._planned[sample]
        self.moment = LoopState(
            step=step,
            sample=sample,
            status=status,
            cause=cause,
            state=self._state,
            observed=self._observed,
            support=support,
            control=reference,
            foot_motion=foot_motion,
            force_desired=force_desired,
            learning_error=self._loop.controller.state.learning_error,
            feedback=self._loop.controller.state.feedback,
        )
        return self.moment
