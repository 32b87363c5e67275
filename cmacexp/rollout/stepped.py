"""The closed loop step by step, for parts of any kind; for built-in parts it gives the bits of the fused loop."""

import numpy as np

from cmacexp.arrays import Array
from cmacexp.control.actuator import actuate, new_actuator
from cmacexp.control.protocol import Reference
from cmacexp.planning.plan import Plan
from cmacexp.rollout.layout import has_measured, write_measured, write_samples
from cmacexp.rollout.stop import RUNNING, Guard, stop_reason
from cmacexp.scenario import Scenario


def reference_at(plan: Plan, step: int) -> Reference:
    """What the plan says of ``step``."""
    sample = step % plan.support.shape[0]
    acting = step >= plan.start_step
    return Reference(
        step,
        sample,
        acting,
        plan.support[sample],
        plan.reference[int(acting), sample],
        plan.desired[sample],
        plan.joints[sample],
        plan.force_desired[sample],
    )


class SteppedLoop:
    """Plan, sensors, controller and plant in turn, one sampling period at a time.

    Args:
        scenario: the parts, reset.
        guard: tells when to stop.
    """

    def __init__(self, scenario: Scenario, guard: Guard):
        self.scenario = scenario
        self.guard = guard
        self.state = scenario.first
        self.taken = 0
        config = scenario.setup.config
        self.actuator = new_actuator(config.actuator, config.sampling_period, len(scenario.first.force))

    def run(self, samples: Array, body_samples: Array) -> int:
        """Run as many steps as ``samples`` (steps, L, columns) and ``body_samples`` (steps, columns) have room for.

        ``taken`` counts the steps whose torque the plant has taken, also when a part raises.

        Returns:
            RUNNING, or why it stopped.
        """
        scenario, plan = self.scenario, self.scenario.setup.plan
        torque = np.zeros((samples.shape[1], 2))
        first = self.state
        if self.taken == 0:
            status = stop_reason(self.guard, 0, first.q, first.dq, first.foot, first.force, first.body)
            if status != RUNNING:
                return status
        for k in range(samples.shape[0]):
            true = self.state
            seen = scenario.sensors.measure(true)
            reference = reference_at(plan, self.taken)
            action = scenario.controller.act(reference, seen)
            # Copies: what a part gives may be its own table, and the limit shortens torques in place.
            feedback, feedforward = (np.array(part, dtype=float) for part in action[:2])
            fed = reference.values if action.reference is None else action.reference
            actuate(self.actuator, self.taken, feedback, feedforward, torque)
            write_samples(
                samples, body_samples, k, true.foot, true.velocity, true.q, true.dq,
                true.force, seen.force, fed, feedback, feedforward, true.body,
            )  # fmt: skip
            if has_measured(samples):
                write_measured(samples, body_samples, k, seen, true.body_rate)
            self.state = new = scenario.plant.step(torque)
            self.taken += 1
            sample = self.taken % plan.support.shape[0]
            status = stop_reason(self.guard, sample, new.q, new.dq, new.foot, new.force, new.body)
            if status != RUNNING:
                return status
        return RUNNING
