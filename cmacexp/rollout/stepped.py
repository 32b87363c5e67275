"""The closed loop step by step, for parts of any kind; for built-in parts it gives the bits of the fused loop."""

import numpy as np

from cmacexp.arrays import Array
from cmacexp.control.actuator import saturate
from cmacexp.control.protocol import Reference
from cmacexp.planning.plan import Plan
from cmacexp.rollout.layout import RUNNING, stop_reason, write_samples
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
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self.state = scenario.first
        limit = scenario.setup.config.actuator.torque_limit
        self.limit = float("inf") if limit is None else limit

    def run(self, start: int, samples: Array) -> tuple[int, int]:
        """As :func:`cmacexp.rollout.fused.fused_loop`."""
        scenario, plan = self.scenario, self.scenario.setup.plan
        torque = np.zeros((samples.shape[1], 2))
        for k in range(samples.shape[0]):
            true = self.state
            seen = scenario.sensors.measure(true)
            reference = reference_at(plan, start + k)
            action = scenario.controller.act(reference, seen)
            saturate(self.limit, action.feedback, action.feedforward, torque)
            write_samples(
                samples, k, true.foot, true.velocity, true.q, true.dq,
                true.force, seen.force, reference.values, action.feedback, action.feedforward,
            )  # fmt: skip
            self.state = scenario.plant.step(torque)
            status = stop_reason(self.state.q, self.state.dq, self.state.foot, self.state.force)
            if status != RUNNING:
                return k + 1, status
        return samples.shape[0], RUNNING
