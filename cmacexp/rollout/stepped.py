"""The closed loop with parts of any kind; for built-in parts it gives the bits of the fused loop.

Foreign parts are called from here, once a step each; between the calls :func:`relay` runs the rest. What a part is
given is its own: it may keep it, and nothing that it writes into it reaches the loop.
"""

from collections.abc import Callable

import numpy as np

from cmacexp.answers import require_finite, take, take_action, take_measurement
from cmacexp.arrays import Array
from cmacexp.control.protocol import Reference
from cmacexp.plants.protocol import Measurement
from cmacexp.rollout.fused import FusedLoop
from cmacexp.rollout.layout import BODY_SAMPLES, SAMPLES
from cmacexp.rollout.relay import Exchange, Foreign, relay
from cmacexp.scenario import Scenario

MEASURED = len(Measurement._fields)
"""Of the first arrays of a plant's state, those that can be measured."""


def read_only(values: Array) -> Array:
    """A view that cannot be written through."""
    view = values.view()
    view.flags.writeable = False
    return view


class SteppedLoop:
    """Plan, sensors, controller and plant in turn, one sampling period at a time.

    Args:
        scenario: the parts, reset.
        loop: its built-in parts, with stand-ins for the others.
        foreign: those others.
    """

    def __init__(self, scenario: Scenario, loop: FusedLoop, foreign: Foreign):
        self.loop, self.foreign = loop, foreign
        self.plant, self.sensors = scenario.plant, scenario.sensors
        self.controller, self.feedforward = scenario.controller, scenario.feedforward
        legs, plan = scenario.setup.mechanism.legs.shape[0], scenario.setup.plan
        self.start_step, self.period = plan.start_step, plan.support.shape[0]
        self.rows = tuple(map(read_only, (plan.support, plan.desired, plan.joints, plan.force_desired)))
        self.fed = [read_only(stage) for stage in plan.reference]
        self.state = Measurement(*loop.plant_state[:MEASURED])
        take_measurement(scenario.plant, "reset", scenario.first, self.state)
        self.exchange = Exchange(
            Measurement(*(np.zeros_like(part) for part in self.state)),
            np.zeros((legs, 4)),
            np.zeros(3, dtype=np.int64),
        )
        seen = self.exchange.seen if foreign.sensors else self.state
        self.true_copies = [part.copy for part in self.state]
        self.seen_copies = [part.copy for part in seen]
        self.calls: tuple[Callable[[int], None], ...] = (self._measure, self._act, self._predict, self._step)
        self.begun = 0
        self.run(np.zeros((0, legs, len(SAMPLES))), np.zeros((0, len(BODY_SAMPLES))))

    @property
    def taken(self) -> int:
        """Steps whose torque the plant has taken, also when a part raised."""
        return self.begun + int(self.exchange.progress[0])

    def run(self, samples: Array, body_samples: Array) -> int:
        """Run as many steps as ``samples`` (steps, L, columns) and ``body_samples`` (steps, 3) have room for.

        Returns:
            RUNNING, or why it stopped.

        Raises:
            BadAnswer: a part gave back what the loop cannot use; ``taken`` tells when.
        """
        progress, calls = self.exchange.progress, self.calls
        self.begun = self.taken
        progress[0] = 0
        for pause in relay(self.loop, self.foreign, self.exchange, self.begun, samples, body_samples):
            calls[pause & 3](pause >> 2)
        self._require_finite(int(progress[2]) - 1)
        return int(progress[1])

    def _reference(self, step: int) -> Reference:
        """What the plan says of ``step``."""
        sample, acting = step % self.period, step >= self.start_step
        support, desired, joints, force = self.rows
        return Reference(
            step,
            sample,
            acting,
            support[sample],
            self.fed[acting][sample],
            desired[sample],
            joints[sample],
            force[sample],
        )

    def _measure(self, step: int) -> None:
        seen = self.sensors.measure(Measurement(*[copy() for copy in self.true_copies]))
        take_measurement(self.sensors, "measure", seen, self.exchange.seen)

    def _act(self, step: int) -> None:
        reference = self._reference(step)
        action = self.controller.act(reference, Measurement(*[copy() for copy in self.seen_copies]))
        state = self.loop.control_state
        if not take_action(self.controller, action, state.feedback, self.loop.torques.feedforward, state.reference):
            state.reference[...] = self.fed[reference.acting][reference.sample, :, :2]

    def _predict(self, step: int) -> None:
        torque = self.feedforward.predict(self._reference(step), self.loop.control_state.taught.copy())
        take(self.feedforward, "predict", "torque", torque, self.loop.torques.feedforward)

    def _step(self, step: int) -> None:
        measured = self.plant.step(self.loop.torques.total.copy())
        take_measurement(self.plant, "step", measured, self.state)
        if step == 0:
            self._require_finite(3)

    def _require_finite(self, what: int) -> None:
        """Say which value is not finite of what a part gave when the loop had paused for ``what``; -1 for none."""
        if what < 0:
            return
        state = self.loop.control_state
        feedback, feedforward = ("feedback", state.feedback), ("feedforward", self.loop.torques.feedforward)
        part, method, given = (
            (self.sensors, "measure", self.exchange.seen._asdict().items()),
            (self.controller, "act", (feedback, feedforward)),
            (self.feedforward, "predict", (("torque", feedforward[1]),)),
            (self.plant, "step", self.state._asdict().items()),
        )[what]
        for name, values in given:
            require_finite(part, method, name, values)
