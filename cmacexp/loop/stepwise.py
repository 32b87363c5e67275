"""A loop that is stepped from outside: whoever steps it gives the feedforward torque of every step.

A compiled generator pauses between the halves of a step: resuming it takes a tenth of the time of entering a program.
Returning to the start restores the state and makes nothing anew.
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
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.state import Snapshot, list_arrays
from cmacexp.loop.step import Hooks, Loop, act, check, sense
from cmacexp.loop.stop import RUNNING, STATUSES, describe_stop, stop_reason
from cmacexp.planning.reference import BEFORE, ControlReference, Motion
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.protocols import Measurement, view_state
from cmacexp.sensors.estimator import Proprioception
from cmacexp.sensors.real import make_keys
from cmacexp.typing import Array, Mask, Status

BUILT_IN = Hooks()
"""None, of built-in components."""
OUTSIDE = External(plant=False, sensors=False, controller=False, feedforward=True)


@kernel
def pause_in_steps(loop: Loop, start: int, samples: Array, body_samples: Array) -> Iterator[tuple[int, int]]:
    """:func:`cmacexp.loop.step.take_steps` of built-in components, with a pause in each step before the torques.

    It fills ``samples`` (columns, K, L) and ``body_samples`` (columns, K). It yields the number of steps taken and
    RUNNING at each pause; at the end once more, with why the loop stopped.
    """
    # No local variable holds arrays: each pause would save them, which doubles the time of compiling.
    period = loop.support.shape[0]
    sample = start % period
    taken = 0
    status = RUNNING
    if start == 0:
        status = stop_reason(loop.limits, 0, loop.plant_state)
    while status == RUNNING and taken < samples.shape[1]:
        sense(loop, BUILT_IN, start + taken, sample)
        yield taken, RUNNING
        act(loop, BUILT_IN, start + taken, sample, taken, samples, body_samples)
        taken += 1
        sample = sample + 1 if sample + 1 < period else 0
        status = check(None, loop.limits, sample, loop.plant_state)
    yield taken, status


pausing_loop = program(pause_in_steps)


class LoopState(NamedTuple):
    """What is known at the start of a step. The arrays are those of the loop, which the next step overwrites."""

    step: int
    """Counts from 0 over the run."""
    sample: int
    """Counts from 0 within the cycle; 0 to N - 1."""
    status: str
    """``running``, ``completed``, ``fell`` or ``diverged``; steps follow only while it runs."""
    cause: str
    """Why it fell or diverged, with step and time; else empty."""
    state: Measurement
    """The machine as it is."""
    observed: Measurement
    """What the controller sees of it; after the last step still what it saw before."""
    support: Mask
    """(L,): planned phase, true in support."""
    control: ControlReference
    """What the controller follows, (L, J) and (L,)."""
    foot_motion: Motion
    """Where the feet should be, (L, J)."""
    force_desired: Array
    """(L,): N."""
    learning_error: Array
    """(L, J): what a feedforward would learn from, J^T U of the last step, N m."""
    feedback: Array
    """(L, J): torque of the controller in the last step, as it acted, or as it was sent to drives, N m."""


class OpenLoop:
    """A scenario without feedforward, at its start; :func:`cmacexp.open_loop` makes one of built-in components.

    Raises CmacexpError if a component is external, and whatever a component raised at its start.

    Attributes:
        setup: config, machine and plan.
        shape: (L, J), legs and joints of each, the shape of a torque.
        moment: the present one.
        sampling_period: s.
        period: steps of a cycle, N.
        steps: of the whole run.
        torque_limits: (J,): largest torque of the joints of a leg, N m; infinite where nothing limits it.
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
        self.sampling_period, self.period = config.sampling_period, config.steps_per_cycle
        self.steps = config.cycles * self.period
        self._loop = make_loop(scenario, OUTSIDE)
        self.torque_limits = self._loop.actuator.limit
        self._plant = scenario.plant if isinstance(scenario.plant, MujocoPlant) else None
        self._adaptation = None if self._loop.meter is None else Adaptation(setup, self._loop.meter)
        self._planned = list_rows(setup.plan, BEFORE)
        self._state = view_state(self._loop.plant_state, self._loop.travel)
        observation = self._loop.observation
        self._observed = view_state(observation, observation.travel)
        self._samples = make_samples(self.period, self.shape[0], False, self.shape[1])
        self._start = Snapshot(each.array for each in list_arrays(self._loop) if each.role is not None)
        if self._plant is not None:
            self._plant.hold()
        self.moment = self.reset()

    _pauses: Iterator[tuple[int, int]]
    """Its pauses, in the steps of the present cycle."""

    def reset(self, seed: int | None = None) -> LoopState:
        """Return to the start of the run; ``seed`` of the noise of the sensors, None: as before; raises BadInput."""
        require(seed is None or 0 <= seed < 2**32, "seed", seed, "must be at least 0 and below 2^32")
        with interrupt_held_back():  # MuJoCo would drop an interrupt in a function that it calls
            if self._plant is not None:
                self._plant.put()
            self._start.restore()
            if self._adaptation is not None:
                self._adaptation.reset()
            sensing = self._loop.sensing
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
        given = np.asarray(torque, dtype=float)
        if given.shape != self.shape or not np.isfinite(given).all():
            raise BadOutput(f"torque {given}: must be finite numbers of shape {self.shape}")
        self._loop.torques.feedforward[...] = given
        if self._plant is None:
            return self._pause()
        with interrupt_held_back():  # as above
            return self._pause()

    def _pause(self) -> LoopState:
        """Run to the start of the next step, or to the end."""
        taken, stop = next(self._pauses)
        step = self._cycle * self.period + taken
        if stop != RUNNING:
            reported = "" if self._plant is None else self._plant.divergence
            cause = describe_stop(self._loop.limits, stop, step, self.sampling_period, self._state, reported)
            return self._note(step, STATUSES[stop], cause)
        if step == self.steps:
            return self._note(step, Status.COMPLETED)
        if taken == self.period:
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
        sample, control = step % self.period, self._loop.control_state
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
            learning_error=control.learning_error,
            feedback=control.feedback,
        )
        return self.moment
