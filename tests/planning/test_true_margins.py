"""The true stability margin: of the centre of gravity of all masses among the feet that carry load."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import Load, legs_under_body

from cmacexp.planning.stability import Masses, centre_of_gravity, margins, true_margins

HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])
LENGTH, KNEE_MASS, FOOT_MASS, BODY_MASS = 0.35, 0.5, 0.7, 1.2
NOTHING, PAYLOAD = Load(0.0, 0.0, 0.0), Load(10.0, 0.1, -0.05)


def masses(body_mass=None, payload=NOTHING, carried=True):
    mechanism = legs_under_body([(LENGTH, LENGTH, KNEE_MASS, FOOT_MASS, 1.0)] * 4, 0.5, HIPS.tolist(), 40.0)
    return Masses(mechanism, body_mass, payload, np.array([carried]))


def found(of, x=(0.0, 0.0, 0.0, 0.0), force=(10.0, 10.0, 10.0, 10.0), pitch=0.0, roll=0.0):
    """Margins of a machine whose feet are 0.5 m below the hips' plane."""
    legs = {"x": np.array([x]), "y": np.full((1, 4), 0.5), "q1": np.full((1, 4), 0.5 * np.pi)}
    body = {"pitch": np.array([pitch]), "roll": np.array([roll])}
    return true_margins(of, legs | {"force": np.array([force])}, body)[0]


def test_a_level_body_has_the_margins_of_its_feet_that_carry():
    x = (0.05, -0.02, 0.01, 0.1)
    feet = HIPS + np.stack([x, np.zeros(4)], axis=1)
    assert_allclose(found(masses(), x), margins(feet))
    assert_allclose(found(masses(), x, force=(10.0, 0.0, 10.0, 20.0)), margins(feet[[0, 2, 3]]))
    assert np.isnan(found(masses(), x, force=(10.0, 0.0, 0.0, 20.0))).all()


@pytest.mark.parametrize(("pitch", "roll"), [(0.1, 0.0), (0.0, 0.2)])
def test_a_tilted_body_moves_over_its_feet(pitch, roll):
    along, across = 0.5 * np.sin(pitch), 0.5 * np.sin(roll)
    front, rear = (0.225 * np.cos(pitch) + sign * along for sign in (-1, 1))
    nearest = min(front, 0.225 * np.cos(roll) - across)
    assert_allclose(found(masses(), pitch=pitch, roll=roll), [nearest, front, rear])


def test_a_payload_pulls_the_centre_of_gravity_to_it_once_it_is_there():
    assert found(masses(payload=PAYLOAD))[1] == pytest.approx(0.225 - 0.1 * 10.0 / 50.0)
    assert found(masses(payload=PAYLOAD, carried=False))[1] == pytest.approx(0.225)


def test_legs_load_a_body_that_moves():
    knee, foot = LENGTH * np.array([np.cos(0.3), -np.sin(0.3)]), np.array([0.2, -0.4])
    mass = BODY_MASS + 4.0 * (KNEE_MASS + FOOT_MASS)
    legs = 4.0 * (KNEE_MASS * knee + FOOT_MASS * foot) / mass
    feet = np.stack([HIPS[:, 0] + foot[0], HIPS[:, 1], np.full(4, foot[1])])[..., None]
    centre = centre_of_gravity(masses(BODY_MASS), np.full((4, 1), 0.3), feet)
    assert_allclose(centre[:, 0], [legs[0], 0.0, legs[1]], atol=1e-15)
    loaded = centre_of_gravity(masses(BODY_MASS, Load(9.81 * mass, 0.0, 0.0)), np.full((4, 1), 0.3), feet)
    assert_allclose(loaded, 0.5 * centre)
