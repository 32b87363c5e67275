"""The controller of drives with loops of their own: what it sends, and what teaches."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import compose_config, make_scenario, roll_out
from support.robots import OWN, RIGID, ROBOT, SHORT
from support.views import ROBOT_HIPS, make_chain

from cmacexp.control import DriveController
from cmacexp.control import drive_kernels as drives
from cmacexp.control.hybrid_kernels import new_hybrid_state
from cmacexp.planning import ControlReference

AHEAD = 0.001
WALK = (*ROBOT, f"machine.path={OWN}", "controller=drives", *SHORT, "record=trace")


def test_a_command_leads_the_foot_along_its_reference_and_missing_force_teaches():
    chains = np.array([make_chain(side) for _, side in np.sign(ROBOT_HIPS)])
    angles = np.tile([0.1, 0.7, -1.4], (1, 4, 1))
    behind = np.broadcast_to(np.reshape([0.01, 0.2], (2, 1, 1, 1)), (2, 1, 4, 3))
    params = drives.DriveParams(ROBOT_HIPS, chains, angles, behind, 80.0, 6.0, 0.5, 0.25, np.full(4, 60.0), AHEAD)
    observation = SimpleNamespace(q=np.zeros((4, 3)), dq=np.zeros((4, 3)), force=np.full(4, 30.0))
    place, velocity = np.array([0.03, 0.29, -0.02]), np.array([0.4, -0.2, 0.1])
    pressed = np.full(4, 40.0)
    reference = ControlReference(np.tile(place, (4, 1)), np.tile(velocity, (4, 1)), None, pressed, pressed)
    state, command = new_hybrid_state(4, 3), np.zeros((6, 4, 3))
    support = np.array([True, True, False, False])
    drives.command_drives(params, state, command, 0, support, reference, observation)
    lacking = 0.25 * 40.0 + 0.75 * 60.0 - 30.0
    for i, chain in enumerate(chains):
        kinematics = drives.chain_kinematics(chain, *command[drives.ANGLE, i])
        jacobian = np.stack(kinematics[1:], axis=1)
        assert_allclose(kinematics.foot, place + AHEAD * velocity, atol=1e-6)
        assert_allclose(jacobian @ command[drives.VELOCITY, i], velocity, atol=1e-12)
        assert_allclose(state.feedback[i], 40.0 * jacobian[1])
        at_sample = command[drives.ANGLE, i] - AHEAD * command[drives.VELOCITY, i]
        law = 80.0 * (at_sample - 0.01) + 6.0 * (command[drives.VELOCITY, i] - 0.2)
        assert_allclose(state.learning_error[i], law + (0.5 * lacking * jacobian[1] if support[i] else 0.0))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("estimator", "share"),
    [("sensors=perfect", 1.0), ("sensors=proprioceptive", 1.0 - np.exp(-0.4)), ("plant=unitree", 1.0 - np.exp(-0.4))],
)
def test_desired_forces_pass_the_filter_of_the_estimated_ones(estimator, share):
    setup = make_scenario(compose_config([*WALK, "sampling_period=0.002"])).setup
    config = compose_config([*WALK, "sampling_period=0.002", estimator])
    controller = DriveController(config.controller)
    controller.reset(replace(setup, config=config), None)
    assert controller.params.force_share == pytest.approx(share)


class Outside(DriveController):
    """The same by its ``act``."""


@pytest.mark.ci
@pytest.mark.parametrize("plant", [RIGID, "plant=mujoco_robot"])
def test_a_controller_of_ones_own_walks_on_drives_with_the_same_bits(plant):
    config = compose_config([*WALK, plant, "plant.delay=1", "plant.bus.loss=0.01", "actuator.lag=0.005"])
    own = Outside(config.controller)
    own_run, built_in = (roll_out(make_scenario(config, **given)).columns() for given in ({"controller": own}, {}))
    for name, values in built_in.items():
        assert_allclose(own_run[name], values, rtol=0.0, atol=0.0, err_msg=name)
    assert np.abs(built_in["tau_feedback_2"] - built_in["tau_force_2"]).max() > 0.1
