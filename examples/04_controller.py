"""A controller of your own: inverse dynamics along the plan, springs and dampers at the joints."""

import numpy as np

import cmacexp
from cmacexp.control import Action
from cmacexp.models.leg import Leg, inverse_dynamics, trigonometry


class ComputedTorque:
    """A controller component; docs/components.md lists names and shapes of its inputs."""

    def __init__(self, stiffness: float = 20.0, damping: float = 2.0):
        self.stiffness, self.damping = stiffness, damping  # N m/rad, N m s/rad

    def reset(self, setup, feedforward):
        """Prepare for a run."""
        self.legs = [Leg(*row) for row in setup.mechanism.legs]

    def act(self, reference, measurement):
        """Return feedback and feedforward torque of one step, N m."""
        q, dq, ddq = reference.joint_motion
        feedback = self.stiffness * (q - measurement.q) + self.damping * (dq - measurement.dq)
        model = np.empty_like(feedback)
        for i, leg in enumerate(self.legs):
            trig = trigonometry(*measurement.q[i])
            model[i] = inverse_dynamics(leg, trig, *measurement.dq[i], *ddq[i], reference.force_desired[i])
        return Action(feedback, model)


run = cmacexp.run(["scenario=one_leg"], "outputs/examples/controller", controller=ComputedTorque(stiffness=30.0))
print(run)
print(f"steady-state force error: {run.metrics.force_steady_state_error.iloc[-1]:.4%}")
