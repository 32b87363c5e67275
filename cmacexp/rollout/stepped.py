"""The closed loop step by step, for parts of any kind; for built-in parts it gives the bits of the fused loop."""

import numpy as np

from cmacexp.arrays import Array
from cmacexp.control.actuator import saturate
from cmacexp.control.protocol import Reference
from cmacexp.planning.plan import Plan
from cmacexp.rollout.layout import write_samples
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
        limit = scenario.setup.config.actuator.torque_limit
        self.limit = float("inf") if limit is None else limit

    def run(self, start: int, samples: Array, body_samples: Array) -> tuple[int, int]:
        """As :func:`cmacexp.rollout.fused.fused_loop`."""
        scenario, plan = self.scenario, self.scenario.setup.plan
        torque = np.zeros((samples.shape[1], 2))
        for k in range(samples.shape[0]):
            true = self.state
            seen = scenario.sensors.measure(true)
            reference = reference_at(plan, start + k)
            action = scenario.controller.act(reference, seen)
            fed = reference.values if action.reference is None else action.reference
            saturate(self.limit, action.feedback, action.feedforward, torque)
            write_samples(
                samples, body_samples, k, true.foot, true.velocity, true.q, true.dq,
                true.force, seen.force, fed, action.feedback, action.feedforward, true.body,
            )  # fmt: skip
            self.state = new = scenario.plant.step(torque)
            after = (start + k + 1) % plan.support.shape[0]
            status = stop_reason(self.guard, after, new.q, new.dq, new.foot, new.force, new.body)
            if status != RUNNING:
                return k + 1, status
        return samples.shape[0], RUNNING
