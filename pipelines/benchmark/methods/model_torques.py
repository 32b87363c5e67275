"""Torques of the nominal model along the plan, by their causes."""

from dataclasses import replace

import numpy as np

from cmacexp.config.machine import RobotMachine
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.robot_dynamics import planned_torques
from cmacexp.planning.setup import Setup
from cmacexp.planning.trajectory import Motion
from cmacexp.typing import Array


def known_torque(setup: Setup) -> Array:
    """Torque (N, L, J) of the nominal model, N m, without what the controller adds to press with a force."""
    return InverseDynamics(InverseDynamics.Config(1.0, 1.0)).compute_torque(setup)


def added_torque(setup: Setup) -> Array:
    """What the controller adds, (N, L, J), N m: 0 unless ``reference=force_feedforward``."""
    whole = replace(setup, config=replace(setup.config, reference="aware"))
    return known_torque(whole) - known_torque(setup)


def rigid_torque(setup: Setup, still: bool) -> Array:
    """Torque (N, L, J) of masses and joints, with no load on the feet, N m; ``still``: at rest in each posture."""
    plan = setup.plan
    joints, sway = plan.joints, plan.sway
    if still:
        joints, sway = (Motion(each.position, *np.zeros((2, *each.position.shape))) for each in (joints, sway))
    if isinstance(setup.config.machine, RobotMachine):
        no_load = np.zeros_like(plan.force_desired)
        return planned_torques(setup.config, setup.mechanism, joints, sway, plan.force_desired, no_load)
    torque = np.zeros_like(joints.position)
    for k, i in np.ndindex(plan.support.shape):
        q, dq, ddq = (values[k, i] for values in joints)
        torque[k, i] = planned_torque(setup.mechanism, i, q, dq, ddq, 0.0)
    return torque
