"""Torques that follow from the plan alone: they accelerate each leg as planned."""

import numpy as np
from numpy.testing import assert_allclose
from support.doors import forward_dynamics, get_leg, make_scenario, trigonometry

from cmacexp.feedforward import NoFeedforward
from cmacexp.feedforward.kernels import feedforward_step


def test_inverse_dynamics_accelerates_every_leg_as_planned_at_every_sample(make_config):
    """Against the force of the desired depression; without a feedforward there is no torque."""
    scenario = make_scenario(make_config("scenario=quadruped", "feedforward=inverse_dynamics"))
    plan, mechanism, output = scenario.setup.plan, scenario.setup.mechanism, np.zeros((4, 2))
    depression = np.maximum(0.0, plan.desired.position[..., 1] - mechanism.hip_height)  # of y
    pressed = scenario.setup.config.assumed_stiffness * depression
    for sample in range(3, len(plan.support), 60):
        feedforward_step(scenario.feedforward.params, sample, sample, np.ones((4, 2)), output)
        for i, (q, dq, ddq) in enumerate(zip(*(values[sample] for values in plan.joints), strict=True)):
            leg, trig = get_leg(mechanism, i), trigonometry(*q)
            assert_allclose(forward_dynamics(leg, trig, *dq, *output[i], pressed[sample, i]), ddq, atol=1e-9)
    nothing = NoFeedforward(NoFeedforward.Config())
    nothing.reset(scenario.setup)
    feedforward_step(nothing.params, 7, 7, np.ones((4, 2)), output)
    assert not output.any()
