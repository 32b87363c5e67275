"""The closed loop with parts of any kind; for built-in parts it gives the bits of the fused loop.

External parts are called from here, once a step each; between the calls :func:`relay` runs the rest. What a part is
given is its own: it may keep it, and nothing that it writes into it reaches the loop.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.loop.compiled import FusedLoop
from cmacexp.loop.coroutine import STEP, External, Inputs, relay
from cmacexp.loop.samples import TRAVEL, make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.stop import RUNNING
from cmacexp.loop.validation import require_finite, take, take_action, take_measurement
from cmacexp.planning.columns import Y
from cmacexp.planning.setup import Reference
from cmacexp.plants.protocol import STATE, Measurement, state_of
from cmacexp.typing import Array


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written through."""
    view = values.view()
    view.flags.writeable = False
    return view


MOST_TOGETHER = 512
"""Steps that are prepared at a time."""
MOST_REMEMBERED = 64
"""Parts of a cycle whose rows of the plan are remembered."""

_reference: Callable[[tuple[object, ...]], Reference] = partial(tuple.__new__, Reference)
_measurement: Callable[[tuple[object, ...]], Measurement] = partial(tuple.__new__, Measurement)


def measurable(state: Sequence[Array]) -> Measurement:
    """The first arrays of the state of a plant, or of sensors, which are what can be measured."""
    return Measurement(*state[: len(STATE)])


def named(measurement: Measurement) -> Iterable[tuple[str, Array]]:
    """The arrays of a measurement with their names."""
    return zip(STATE, state_of(measurement), strict=True)


def _measurements(blocks: Measurement) -> list[Measurement]:
    """A measurement for every row of ``blocks`` (K, ...)."""
    return list(map(_measurement, zip(*map(list, state_of(blocks)), repeat(None))))


class SteppedLoop:
    """Plan, sensors, controller and plant in turn, one sampling period at a time.

    Args:
        scenario: the parts, reset.
        loop: its built-in parts, with stand-ins for the others.
        external: those others.
    """

    def __init__(self, scenario: Scenario, loop: FusedLoop, external: External):
        self.loop, self.external = loop, external
        self.plant, self.sensors = scenario.plant, scenario.sensors
        self.controller, self.feedforward = scenario.controller, scenario.feedforward
        self.plan = scenario.setup.plan
        self.rows: dict[tuple[int, int, bool], tuple[list[NDArray[Any]], ...]] = {}
        self.state = measurable(loop.plant_state)
        if external.plant:
            for own, first in zip(state_of(self.state), state_of(scenario.first), strict=True):
                own[...] = first
        self.travel = scenario.first.travel
        self.given = measurable(loop.seen)
        self.progress = np.zeros(3, dtype=np.int64)
        self.calls: tuple[Callable[[int], None], ...] = (self._measure, self._act, self._predict, self._step)
        self.trusts = external.controller and hasattr(scenario.controller, "force_trusted")
        self.begun = 0
        self._run(*make_samples(0, self.state.q.shape[0], False))

    @property
    def taken(self) -> int:
        """Steps whose torque the plant has taken, also when a part raised."""
        return self.begun + int(self.progress[0])

    def run(self, samples: Array, body_samples: Array) -> int:
        """Run as many steps as ``samples`` (steps, L, columns) and ``body_samples`` (steps, columns) have room for.

        Returns:
            RUNNING, or why it stopped.

        Raises:
            BadOutput: a part gave back what the loop cannot use; ``taken`` tells when.
        """
        period, done, stop = self.plan.support.shape[0], 0, RUNNING
        while stop == RUNNING and done < len(samples):
            steps = min(MOST_TOGETHER, period - self.taken % period, len(samples) - done)
            stop = self._run(samples[done : done + steps], body_samples[done : done + steps])
            done += steps
        return stop

    def _run(self, samples: Array, body_samples: Array) -> int:
        """:meth:`run` for some steps of one cycle."""
        progress, calls, self.body_samples = self.progress, self.calls, body_samples
        self.begun = self.taken
        progress[0] = 0
        inputs = self._prepare(len(samples))
        for pause in relay(*self.loop, self.external, self.progress, inputs, self.begun, samples, body_samples):
            calls[pause & 3](pause >> 2)
        self._require_finite(int(progress[2]) - 1)
        return int(progress[1])

    def _prepare(self, steps: int) -> Inputs:
        """Room for what external parts are given in the next steps, and the views of it that they get."""
        external = self.external

        def room(like: Array, needed: bool) -> Array:
            return np.empty((steps if needed else 0, *like.shape))

        true, seen = (
            Measurement(*(room(part, needed) for part in state_of(self.state)))
            for needed in (external.sensors, external.controller)
        )
        inputs = Inputs(true, seen, room(self.state.q, external.feedforward), room(self.state.q, external.plant))
        self.true, self.seen = _measurements(true), _measurements(seen)
        self.learning_error, self.torque = list(inputs.learning_error), list(inputs.torque)
        if external.controller or external.feedforward:
            self.references = self._references(steps)
        return inputs

    def _references(self, steps: int) -> list[Reference]:
        """What the plan says of the next steps."""
        sample, acting = self.begun % self.plan.support.shape[0], self.begun >= self.plan.start_step
        rows = self.rows.get((sample, steps, acting))
        if rows is None:
            plan, part = self.plan, slice(sample, sample + steps)
            tables = (plan.support, plan.reference[int(acting)], plan.desired, plan.joints, plan.force_desired)
            rows = tuple(list(read_only(table[part])) for table in tables)
            if len(self.rows) < MOST_REMEMBERED:
                self.rows[sample, steps, acting] = rows
        counts = range(self.begun, self.begun + steps), range(sample, sample + steps)
        return list(map(_reference, zip(*counts, repeat(acting, steps), *rows, strict=True)))

    def _measure(self, row: int) -> None:
        take_measurement(self.sensors, "measure", self.sensors.measure(self.true[row]), self.given)

    def _act(self, row: int) -> None:
        reference, state = self.references[row], self.loop.control_state
        action = self.controller.act(reference, self.seen[row])
        if self.trusts:
            state.fault_status.trusted[...] = self.controller.force_trusted  # type: ignore[attr-defined]
        if not take_action(self.controller, action, state.feedback, self.loop.torques.feedforward, state.reference):
            state.reference[...] = reference.values[:, : Y + 1]

    def _predict(self, row: int) -> None:
        torque = self.feedforward.predict(self.references[row], self.learning_error[row])
        take(self.feedforward, "predict", "torque", torque, self.loop.torques.feedforward)

    def _step(self, row: int) -> None:
        if self.travel is not None:
            self.body_samples[row, TRAVEL] = self.travel
        measured = self.plant.step(self.torque[row])
        take_measurement(self.plant, "step", measured, self.state)
        self.travel = measured.travel
        if row + self.begun == 0:
            self._require_finite(STEP)

    def _require_finite(self, what: int) -> None:
        """Say which value is not finite of what a part gave when the loop had paused for ``what``; -1 for none."""
        if what < 0:
            return
        state = self.loop.control_state
        feedback, feedforward = ("feedback", state.feedback), ("feedforward", self.loop.torques.feedforward)
        part, method, given = (
            (self.sensors, "measure", named(self.given)),
            (self.controller, "act", (feedback, feedforward)),
            (self.feedforward, "predict", (("torque", feedforward[1]),)),
            (self.plant, "step", named(self.state)),
        )[what]
        for name, values in given:
            require_finite(part, method, name, values)
