"""What a robot measures by itself: no truth reaches its control, and the estimate is near it."""

import numpy as np
import pytest
from support.doors import make_scenario, roll_out
from support.robots import OWN, ROBOT

from cmacexp.sensors import ProprioceptiveSensors

WALK = (*ROBOT, f"machine.path={OWN}", "sensors=proprioceptive", "sampling_period=0.001")
SHORT = ("gait.cycle_time=0.6", "gait.lift=0.02")
EXACT = (
    *(f"sensors.{name}.noise=0" for name in ("position", "velocity", "torque", "tilt", "heading")),
    *(
        f"sensors.{name}=0"
        for name in ("gyroscope.noise", "accelerometer.noise", "position.quantum", "velocity.delay")
    ),
    *(f"sensors.{name}=0" for name in ("encoder_offset", "torque_gain_error", "tilt_bias", "heading_drift")),
    *("sensors.accelerometer_bias=0", "sensors.force_lag=0"),
)
"""Without imperfections."""


class Blinding(ProprioceptiveSensors):
    """Sensors that replace all that is true by NaN, before they measure, until the plant moves on."""

    def measure(self, true):
        for values in (*self.plant.state[:7], self.plant.engine.travel, *true[:8]):
            values[...] = np.nan
        return super().measure(true)


@pytest.mark.ci
def test_a_robot_walks_with_the_same_bits_where_all_that_it_does_not_measure_is_unknown(make_config):
    config = make_config(*WALK, *SHORT, "cycles=2", "learning.start_cycle=1", "learning.guard=none")
    blind = Blinding(config.sensors)
    scenario = make_scenario(config, sensors=blind)
    blind.plant = scenario.plant
    unknown, known = roll_out(scenario).columns(), roll_out(make_scenario(config)).columns()
    assert np.isnan(unknown["q1"]).all()
    assert len(known["q1"]) == 1200
    for name in ("tau_feedback_1", "tau_feedforward_3", "force_measured", "y_measured", "x_reference"):
        assert np.abs(known[name]).max() > 0.0
        np.testing.assert_array_equal(unknown[name], known[name])


@pytest.mark.ci
@pytest.mark.parametrize("overrides", [(), ("plant=mujoco_robot_rigid",), ("controller=drives",)])
def test_without_imperfections_the_estimate_is_near_the_truth(make_config, overrides):
    run = roll_out(make_scenario(make_config(*WALK, *overrides, "cycles=1", "feedforward=none", *EXACT)))
    body, legs = run.body_columns(), run.columns()
    for name, most in {"height": 1e-3, "height_rate": 0.03, "cog_x": 2e-3, "cog_y": 1e-3, "yaw": 1e-12}.items():
        assert np.abs(body[f"{name}_measured"] - body[name])[500:].max() < most, name
    stands = legs["force"] > 10.0
    assert np.abs(legs["force_measured"] - legs["force"])[stands].mean() < 3.0


@pytest.mark.ci
def test_in_a_trot_the_force_counts_the_momentum_of_the_joints(make_config):
    trot = ("controller=drives", "gait=trot", "gait.speed=0.3", "cycles=3", "feedforward=none", *EXACT)
    legs = roll_out(make_scenario(make_config(*WALK, *trot))).columns()
    stands = legs["force"] > 10.0
    assert np.abs(legs["force_measured"] - legs["force"])[stands].mean() < 5.0  # 9 without it


@pytest.mark.ci
def test_a_dead_torque_sensor_leaves_its_leg_without_force(make_config):
    dead = [f"sensors.torque.fault.{each}" for each in ("kind=zero", "legs=[2]")]
    measured = roll_out(make_scenario(make_config(*WALK, *SHORT, "cycles=1", *EXACT, *dead))).columns()[
        "force_measured"
    ]
    assert measured[100:, 1].max() < 8.0 < measured[100:, 0].max()
