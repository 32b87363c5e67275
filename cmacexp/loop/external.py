"""The driver for external components: it gives the bits of the compiled driver where it calls built-in ones.

External components are called from here, once a step each; the rest of the step runs in a compiled generator.
Resuming that costs a tenth of a microsecond, calling a program some 10: numba unpacks every array of its arguments.
A component owns its inputs: it may keep them, and nothing that it writes into them reaches the loop.
"""

from collections.abc import Callable, Iterable
from functools import partial
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import Diverged
from cmacexp.feedforward import Learns, Observes
from cmacexp.jit.compiler import program
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.loop.guard import BEST_CYCLE, lets_act, lets_learn
from cmacexp.loop.samples import TRAVEL, make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.step import NO_METHOD, NOT_FINITE, STEP, STOP, TAKEN, Inputs, Loop, take_steps
from cmacexp.loop.stop import RUNNING
from cmacexp.loop.validation import require_finite, take, take_action, take_measurement
from cmacexp.planning.columns import ACTING, BEFORE, Y
from cmacexp.planning.setup import Reference
from cmacexp.plants.protocol import STATE, Measurement, get_state
from cmacexp.typing import Array, Weights

MOST_TOGETHER = 512
"""Steps whose inputs are allocated together."""

coroutine_loop = program(take_steps)

_make_reference: Callable[[tuple[object, ...]], Reference] = partial(tuple.__new__, Reference)
_make_measurement: Callable[[tuple[object, ...]], Measurement] = partial(tuple.__new__, Measurement)


class External(NamedTuple):
    """Which components are external."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """Of a built-in controller; an external controller calls its feedforward itself."""


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """A view of an array that cannot be written to."""
    view = values.view()
    view.flags.writeable = False
    return view


def _name(measurement: Measurement) -> Iterable[tuple[str, Array]]:
    return zip(STATE, get_state(measurement), strict=True)


def _split(rows: Measurement | None) -> list[Measurement]:
    """One measurement for each row of a measurement (K, ...)."""
    return [] if rows is None else list(map(_make_measurement, zip(*map(list, get_state(rows)), repeat(None))))


class ExternalDriver:
    """Runs external components, and built-in ones between them; taking no step compiles the program."""

    def __init__(self, scenario: Scenario, loop: Loop, external: External):
        self.loop, self.external, self.scenario = loop, external, scenario
        self.plant, self.sensors = scenario.plant, scenario.sensors
        self.controller, self.feedforward = scenario.controller, scenario.feedforward
        self.period = len(scenario.setup.plan.support)
        plan = scenario.setup.plan
        self.plan_rows = [
            list(
                zip(
                    *map(read_only, (plan.support, values, plan.desired, plan.joints, plan.force_desired)),
                    strict=True,
                )
            )
            for values in plan.reference
        ]
        """Fields of a reference but for the first three, of each sample in each stage."""
        self.state, self.observation = Measurement(*loop.plant_state[:7]), Measurement(*loop.observation[:7])
        if external.plant:
            for values, start in zip(get_state(self.state), get_state(scenario.first), strict=True):
                values[...] = start
        self.travel = scenario.first.travel
        self.progress = np.zeros(3, dtype=np.int64)
        self.has_fault_status = external.controller and hasattr(scenario.controller, "force_trusted")
        self.start = 0
        self.divergence = ""
        """Cause that the plant itself reported, if it has diverged."""
        legs, axes = self.state.q.shape
        self._run(*make_samples(0, legs, False, axes))

    @property
    def taken(self) -> int:
        """Steps whose torque the plant has taken, also when a component raised."""
        return self.start + int(self.progress[TAKEN])

    def run(self, samples: Array, body_samples: Array) -> int:
        """Take as many steps as ``samples`` (K, L, columns) and ``body_samples`` (K, columns) have rows.

        Returns RUNNING or why it stopped; raises BadOutput of a component, after ``taken`` steps.
        """
        done, stop = 0, RUNNING
        # An external component may take any time; MuJoCo would drop an interrupt in a function that it calls.
        with interrupt_held_back(self.loop.engine is not None):
            while stop == RUNNING and done < len(samples):
                steps = min(MOST_TOGETHER, self.period - self.taken % self.period, len(samples) - done)
                stop = self._run(samples[done : done + steps], body_samples[done : done + steps])
                done += steps
        return stop

    def _run(self, samples: Array, body_samples: Array) -> int:
        """:meth:`run` for some steps of one cycle."""
        self.start = self.taken
        self.progress[TAKEN], self.body_samples = 0, body_samples
        inputs, progress = self._make_inputs(len(samples)), self.progress
        calls = (self._measure, self._act, self._predict, self._step)
        weights = self._weights_before()
        for method, row in coroutine_loop(self.loop, inputs, progress, self.start, samples, body_samples):
            calls[method](row)
        if weights is not None and self.loop.guard is not None:
            kept, best = self.scenario.kept, int(self.loop.guard.counts[BEST_CYCLE])
            if best not in kept:
                self.scenario.kept = {0: kept.get(0, weights), best: weights}
        if progress[NOT_FINITE] != NO_METHOD:
            self._require_finite(int(progress[NOT_FINITE]))
        return int(progress[STOP])

    def _weights_before(self) -> Weights | None:
        """Weights of an external feedforward at the start of a cycle: a guard may find them the best so far."""
        asked = self.scenario.setup.config.record.weights and self.loop.feedforward is None
        starts = asked and self.loop.guard is not None and self.start % self.period == 0
        return self.feedforward.learnt() if starts and isinstance(self.feedforward, Learns) else None

    def _make_inputs(self, steps: int) -> Inputs:
        """Arrays for the inputs of external components in the next steps, and one view of them per step."""
        external = self.external

        def make_rows(like: Array) -> Array:
            return np.empty((steps, *like.shape))

        def make_measurement() -> Measurement:
            return Measurement(*map(make_rows, get_state(self.state)))

        inputs = Inputs(
            make_measurement() if external.sensors else None,
            make_measurement() if external.controller else None,
            make_rows(self.state.q) if external.feedforward else None,
            make_rows(self.state.q) if external.plant else None,
            isinstance(self.feedforward, Observes),
        )
        self.true, self.observed = _split(inputs.sensors), _split(inputs.controller)
        self.learning_error = [] if inputs.feedforward is None else list(inputs.feedforward)
        self.torque = [] if inputs.plant is None else list(inputs.plant)
        return inputs

    def _reference(self, row: int) -> Reference:
        """The reference of a step of these."""
        step = self.start + row
        sample, acting = step % self.period, bool(lets_act(self.loop.guard, self.loop.start_step, step))
        return _make_reference((step, sample, acting, *self.plan_rows[ACTING if acting else BEFORE][sample]))

    def _measure(self, row: int) -> None:
        take_measurement(self.sensors, "measure", self.sensors.measure(self.true[row]), self.observation)

    def _act(self, row: int) -> None:
        reference, state = self._reference(row), self.loop.control_state
        self._show(reference)
        travel = self.travel if self.external.plant else self.loop.travel
        observed = self.observed[row]._replace(travel=None if travel is None else travel.copy())
        action = self.controller.act(reference, observed)
        if self.has_fault_status:
            state.fault_status.trusted[...] = self.controller.force_trusted  # type: ignore[attr-defined]
        if not take_action(self.controller, action, state.feedback, self.loop.torques.feedforward, state.reference):
            state.reference[...] = reference.values[:, : Y + 1]
        if self.loop.guard is not None:  # what teaches is known to the controller alone
            state.learning_error[...] = state.feedback

    def _show(self, reference: Reference) -> None:
        """Show a feedforward that asks for it what the sensors show, and what the plant took."""
        if isinstance(self.feedforward, Observes):
            shown = Measurement(*(part.copy() for part in get_state(self.observation)))
            self.feedforward.observe(reference, shown, self.loop.torques.total.copy())

    def _predict(self, row: int) -> None:
        reference = self._reference(row)
        self._show(reference)
        if reference.acting and lets_learn(self.loop.guard):
            torque = self.feedforward.predict(reference, self.learning_error[row])
            take(self.feedforward, "predict", "torque", torque, self.loop.torques.feedforward)

    def _step(self, row: int) -> None:
        if self.travel is not None:
            self.body_samples[row, TRAVEL] = self.travel
        try:
            measured = self.plant.step(self.torque[row])
        except Diverged as error:
            self.divergence = str(error)
            self.state.q[...] = np.nan  # for which the check of this step stops the run
            return
        take_measurement(self.plant, "step", measured, self.state)
        self.travel = measured.travel
        if row + self.start == 0:
            self._require_finite(STEP)

    def _require_finite(self, method: int) -> None:
        """Refuse output of the component with this method that is not finite."""
        feedback, feedforward = self.loop.control_state.feedback, self.loop.torques.feedforward
        component, name, output = (
            (self.sensors, "measure", _name(self.observation)),
            (self.controller, "act", (("feedback", feedback), ("feedforward", feedforward))),
            (self.feedforward, "predict", (("torque", feedforward),)),
            (self.plant, "step", _name(self.state)),
        )[method]
        for field, values in output:
            require_finite(component, name, field, values)
