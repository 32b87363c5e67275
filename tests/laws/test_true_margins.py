"""Stability margins: of a polygon of support; the true one of all masses among the feet that carry load."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.walks import HIPS

from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import Load
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import legs_under_body
from cmacexp.planning.stability import margins
from cmacexp.planning.true_margins import Masses, centre_of_gravity, true_margins

LENGTH, KNEE_MASS, FOOT_MASS, BODY_MASS = 0.35, 0.5, 0.7, 1.2
LEG = (LENGTH, LENGTH, KNEE_MASS, FOOT_MASS, 1.0)
NOTHING = Load(0.0, 0.0, 0.0)


def masses(body_mass=None, payload=NOTHING, carried=True):
    mechanism = legs_under_body([LEG] * 4, 0.5, HIPS.tolist(), 40.0)
    return Masses(mechanism, body_mass, payload, np.array([carried]))


def found(of, x=(0.0, 0.0, 0.0, 0.0), force=(10.0, 10.0, 10.0, 10.0), pitch=0.0, roll=0.0):
    """Margins of a machine whose feet are 0.5 m below the hips' plane."""
    legs = {
        "x": np.array([x]),
        "y": np.full((1, 4), 0.5),
        "q1": np.full((1, 4), 0.5 * np.pi),
        "force": np.array([force]),
    }
    return true_margins(of, legs, {"pitch": np.array([pitch]), "roll": np.array([roll])})[0]


def test_a_level_body_on_all_feet_has_the_margins_of_its_feet():
    x = (0.05, -0.02, 0.01, 0.1)
    assert_allclose(found(masses(), x), margins(HIPS + np.stack([x, np.zeros(4)], axis=1)))


def test_only_feet_that_carry_count():
    assert_allclose(found(masses(), force=(10.0, 0.0, 10.0, 20.0)), margins(HIPS[[0, 2, 3]]))
    assert np.isnan(found(masses(), force=(10.0, 0.0, 0.0, 20.0))).all()


@pytest.mark.parametrize(("pitch", "roll"), [(0.1, 0.0), (0.0, 0.2)])
def test_a_tilted_body_moves_over_its_feet(pitch, roll):
    nearest, front, rear = found(masses(), pitch=pitch, roll=roll)
    along, across = 0.5 * np.sin(pitch), 0.5 * np.sin(roll)
    assert front == pytest.approx(0.225 * np.cos(pitch) - along)
    assert rear == pytest.approx(0.225 * np.cos(pitch) + along)
    assert nearest == pytest.approx(min(front, 0.225 * np.cos(roll) - across))


def test_a_payload_pulls_the_centre_of_gravity_to_it_once_it_is_there():
    payload = Load(10.0, 0.1, -0.05)
    assert found(masses(payload=payload))[1] == pytest.approx(0.225 - 0.1 * 10.0 / 50.0)
    assert found(masses(payload=payload, carried=False))[1] == pytest.approx(0.225)


def test_legs_load_a_body_that_moves():
    knee, foot = LENGTH * np.array([np.cos(0.3), -np.sin(0.3)]), np.array([0.2, -0.4])
    legs = 4.0 * (KNEE_MASS * knee + FOOT_MASS * foot) / (BODY_MASS + 4.0 * (KNEE_MASS + FOOT_MASS))
    feet = np.stack([HIPS[:, 0] + foot[0], HIPS[:, 1], np.full(4, foot[1])])[..., None]
    centre = centre_of_gravity(masses(BODY_MASS), np.full((4, 1), 0.3), feet)
    assert_allclose(centre[:, 0], [legs[0], 0.0, legs[1]], atol=1e-15)
    weight = GRAVITY * (BODY_MASS + 4.0 * (KNEE_MASS + FOOT_MASS))
    loaded = centre_of_gravity(masses(BODY_MASS, Load(weight, 0.0, 0.0)), np.full((4, 1), 0.3), feet)
    assert_allclose(loaded, 0.5 * centre)


def test_the_centre_of_gravity_is_that_of_mujoco(make_config):
    pytest.importorskip("mujoco")
    scenario = make_scenario(make_config("scenario=quadruped", "plant=mujoco_quadruped", "feedforward=none"))
    setup, plant = scenario.setup, scenario.plant
    for _ in range(20):
        now = plant.step(np.arange(8.0).reshape(4, 2))
    assert now.travel is not None
    feet = np.stack([HIPS[:, 0] + now.foot[:, 0], HIPS[:, 1], -now.foot[:, 1]])[..., None]
    of = Masses(setup.mechanism, setup.config.machine.body_mass, NOTHING, np.array([False]))
    centre = centre_of_gravity(of, now.q[:, :1], feet)[:, 0]
    turn = plant.data.xmat[1].reshape(3, 3)
    assert_allclose(centre, turn.T @ (plant.data.subtree_com[1] - plant.data.xpos[1]), atol=1e-12)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_foot_on_an_edge_or_within_changes_no_margin(scale):
    corners = scale * np.array([[0.3, 0.2], [0.25, -0.2], [-0.3, 0.1], [-0.2, -0.3]])
    for more in ((corners[0] + corners[1]) / 2.0, 0.25 * corners[2] + 0.75 * corners[3], np.zeros(2)):
        assert_allclose(margins(np.vstack([corners, more])), margins(corners), rtol=1e-9)
