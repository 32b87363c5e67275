"""Motion of a body that two feet carry at times: where they press, how it sways, and forces that balance it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import compose_config, make_mechanism
from support.robots import OWN, ROBOT

from cmacexp.planning import make_plan
from cmacexp.planning.body import find_pressure, find_sway

FEET = np.array([[[0.2, 0.1], [0.2, -0.1], [-0.2, 0.1], [-0.2, -0.1]]])
DIAGONAL = np.array([[1.0, 0.0, 0.0, 1.0]])
OWN_ROBOT = (*ROBOT, f"machine.path={OWN}")
GRAVITY = 9.81


def test_the_centre_of_pressure_of_two_feet_is_between_them_and_of_four_feet_where_it_is_wanted():
    wanted = np.array([[0.02, 0.03]])
    on_line = find_pressure(FEET, DIAGONAL, wanted)[0]
    assert on_line[1] == pytest.approx(on_line[0] * 0.1 / 0.2)
    assert np.linalg.norm(on_line - wanted) < 1.2 * abs(wanted[0] @ [0.1, -0.2]) / np.hypot(0.1, 0.2)
    assert_allclose(find_pressure(FEET, np.ones((1, 4)), wanted), wanted, atol=0.02)
    assert_allclose(find_pressure(FEET, np.ones((1, 4)), 0.0 * wanted), 0.0, atol=1e-15)


def test_a_swaying_body_presses_where_it_should():
    height, pressure = 0.3, np.random.default_rng(0).normal(size=(50, 2))
    sway = find_sway(pressure, height, 0.002)
    assert_allclose(sway.position - height / GRAVITY * sway.acceleration, pressure, atol=1e-9)
    assert_allclose(sway.velocity.sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize("gait", ["walk", "amble", "trot"])
def test_forces_of_a_gait_on_two_feet_balance_weight_and_moments(gait):
    config = compose_config([*OWN_ROBOT, f"gait={gait}"])
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config, mechanism, True)
    feet, force = plan.desired.position[..., [0, 2]] + mechanism.hips, plan.force_desired
    assert (plan.support.sum(axis=1) == 2).any()
    assert force.min() >= 0.0
    assert_allclose(force.sum(axis=1), plan.load.force)
    centre = (force[..., None] * feet).sum(axis=1) / force.sum(axis=1)[:, None]
    assert_allclose(centre, plan.load.centre, atol=1e-3)
    assert np.abs(np.diff(force, axis=0)).max() < 0.25 * mechanism.weight


@pytest.mark.ci
def test_stroke_and_cycle_follow_from_the_speed_of_a_robot():
    slow, fast = (compose_config([*OWN_ROBOT, "gait=trot", f"gait.speed={v}"]) for v in (0.2, 2.0))
    assert [slow.body_speed, fast.body_speed] == pytest.approx([0.2, 2.0], rel=1e-4)
    assert fast.gait.cycle_time < slow.gait.cycle_time
    assert fast.gait.lift < slow.gait.lift
