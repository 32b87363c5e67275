"""Laws of the channels of sensors: each reading has a channel of its own, on every leg and of the body."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.loop.scenario import make_scenario
from cmacexp.models.leg import foot_position, foot_velocity, trigonometry
from cmacexp.models.mechanism import get_leg
from cmacexp.plants.protocol import Measurement, new_measurement
from cmacexp.sensors.protocol import SIGNALS

LEGS = 4
SHORT = ("scenario=quadruped", "feedforward=none", "gait.cycle_time=0.2", "gait.lift=0.005")
OF_LEGS = {"force": "force", "position": "q", "velocity": "dq"}
OF_BODY = {
    "height": ("body", [0]),
    "tilt": ("body", [1, 2]),
    "height_rate": ("body_rate", [0]),
    "tilt_rate": ("body_rate", [1, 2]),
}
FIELDS = ("force", "q", "dq", "body", "body_rate")
"""What has channels; feet follow from joints."""


def make_sensors(make_config, *overrides):
    return make_scenario(make_config(*SHORT, "sensors=real", *overrides)).sensors


def random_measurement(seed):
    rng = np.random.default_rng(seed)
    shapes = [values.shape for values in new_measurement(LEGS)[:-1]]
    return Measurement(*(rng.uniform(0.5, 1.5, shape) for shape in shapes))


def errors(sensors, true):
    """Reading less true value, by field."""
    read = sensors.measure(true)
    return {name: getattr(read, name) - getattr(true, name) for name in FIELDS}


def test_the_signals_are_all_here():
    assert set(SIGNALS) == {*OF_LEGS, *OF_BODY}


@pytest.mark.parametrize("leg", range(1, LEGS + 1))
@pytest.mark.parametrize("name", OF_LEGS)
def test_a_bias_of_one_leg_changes_its_readings_alone(make_config, name, leg):
    sensors = make_sensors(make_config, f"sensors.{name}.bias=0.25", f"sensors.{name}.legs=[{leg}]")
    for step in range(2):
        for field, found in errors(sensors, random_measurement(step)).items():
            expected = np.zeros_like(found)
            if field == OF_LEGS[name]:
                expected[leg - 1] = 0.25
            assert_allclose(found, expected, atol=1e-15)


@pytest.mark.parametrize("name", OF_BODY)
def test_a_bias_of_the_body_changes_its_signal_alone(make_config, name):
    sensors = make_sensors(make_config, f"sensors.{name}.bias=-0.5")
    field, places = OF_BODY[name]
    for other, found in errors(sensors, random_measurement(0)).items():
        expected = np.zeros_like(found)
        if other == field:
            expected[places] = -0.5
        assert_allclose(found, expected, atol=1e-15)


def test_no_two_readings_share_their_noise(make_config):
    sensors = make_sensors(make_config, *(f"sensors.{name}.noise=1" for name in SIGNALS))
    drawn = [np.concatenate([e.ravel() for e in errors(sensors, random_measurement(k)).values()]) for k in range(3)]
    assert len(np.unique(np.round(drawn, 9))) == 3 * (LEGS * 5 + 6)


def test_every_reading_is_its_own_true_value_of_earlier(make_config):
    sensors = make_sensors(make_config, *(f"sensors.{name}.delay=2" for name in SIGNALS))
    true = [random_measurement(step) for step in range(6)]
    for step in range(6):
        read = sensors.measure(true[step])
        for name in FIELDS:
            assert_array_equal(getattr(read, name), getattr(true[max(step - 2, 0)], name))


@pytest.mark.parametrize("altered", ["position", "velocity"])
def test_feet_follow_from_the_joints_that_are_read(make_config, altered):
    made = make_scenario(make_config(*SHORT, "sensors=real", f"sensors.{altered}.bias=0.1"))
    true = random_measurement(0)
    read = made.sensors.measure(true)
    for i in range(LEGS):
        leg, trig = get_leg(made.setup.mechanism, i), trigonometry(*read.q[i])
        foot = foot_position(leg, trig) if altered == "position" else true.foot[i]
        assert_allclose(read.foot[i], foot)
        assert_allclose(read.velocity[i], foot_velocity(leg, trig, *read.dq[i]))
