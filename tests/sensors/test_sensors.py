"""Sensors: each imperfection by itself, a channel for each reading, and what follows from what is read."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import (
    foot_position,
    foot_velocity,
    get_leg,
    make_scenario,
    new_measurement,
    roll_out,
    trigonometry,
)

from cmacexp.plants import Measurement
from cmacexp.protocols import SIGNALS
from cmacexp.sensors import PerfectSensors
from cmacexp.sensors.kernels import normal

REAL = "sensors=real"
SHORT = ("gait.cycle_time=0.2", "gait.lift=0.005")
"""A plan that is made at once."""
LEGS = 4


@pytest.fixture
def read_force(make_config):
    """Readings of the force sensors (steps, L) for values (steps, L), or of one leg (steps,), under settings."""

    def readings(values, *settings, scenario="one_leg"):
        settings = [f"sensors.force.{setting}" if setting[:4] != "seed" else setting for setting in settings]
        made = make_scenario(make_config(f"scenario={scenario}", REAL, *SHORT, *settings))
        values = np.asarray(values, dtype=float).reshape(len(values), -1)
        read = np.array([made.sensors.measure(made.first._replace(force=row)).force for row in values])
        return read[:, 0] if scenario == "one_leg" else read

    return readings


# Chance


def test_normal_numbers_are_white_and_have_mean_0_and_variance_1():
    drawn = np.array([[normal(key, step) for step in range(20000)] for key in (7, 8)])
    assert np.abs(drawn.mean(axis=1)).max() < 0.03
    assert np.abs(drawn.var(axis=1) - 1.0).max() < 0.04
    assert abs((drawn**4).mean() - 2.9) < 0.12  # of a sum of twelve uniform numbers; 3 for a Gaussian
    for lag in (1, 2, 3, 8, 600):
        assert abs((drawn[:, lag:] * drawn[:, :-lag]).mean()) < 0.025
    assert abs((drawn[0] * drawn[1]).mean()) < 0.03


# One imperfection at a time, by hand

HALF = f"lag={0.005 / np.log(2.0)}"
LATER = "start=0.01"


@pytest.mark.parametrize(
    ("settings", "values", "readings"),
    [
        (["delay=2"], [5, 6, 7, 8, 9], [5, 5, 5, 6, 7]),
        (["bias=0.2", "quantum=0.5"], [0.0, 0.9, 1.2, -1.0], [0.0, 1.0, 1.5, -1.0]),
        ([HALF], [1, 5, 5, 5], [1, 3, 4, 4.5]),
        ([HALF, LATER], [1, 5, 9, 9], [1, 5, 7, 8]),
        (["bias=1", LATER], [1, 1, 1, 1], [1, 1, 2, 2]),
        (["noise_relative=0.2"], [0, 0, 0], [0, 0, 0]),
        (["fault.kind=zero", "fault.start=0.01"], [1, 2, 3, 4, 5], [1, 2, 0, 0, 0]),
        (["fault.kind=last", "fault.start=0.01"], [1, 2, 3, 4, 5], [1, 2, 3, 3, 3]),
        (["fault.kind=value", "fault.value=40", "fault.start=0.01"], [1, 2, 3, 4, 5], [1, 2, 40, 40, 40]),
        (["fault.kind=bias", "fault.value=40", "fault.start=0.01"], [1, 2, 3, 4, 5], [1, 2, 43, 44, 45]),
    ],
    ids=lambda value: " ".join(map(str, value)),
)
def test_an_imperfection_reads_what_can_be_computed_by_hand(read_force, settings, values, readings):
    assert read_force(values, *settings) == pytest.approx(readings)


@pytest.mark.parametrize(
    ("settings", "deviation"),
    [
        (["noise=0.5"], 0.5),
        (["noise_relative=0.2"], 2.0),
        (["noise=4", "fault.kind=noise", "fault.value=3"], 5.0),
    ],
)
def test_noise_has_the_deviation_that_is_set_and_is_of_the_seed(read_force, settings, deviation):
    one, again, other = (read_force(np.full(2000, 10.0), *settings, f"seed={seed}") for seed in (1, 1, 2))
    assert one.std() == pytest.approx(deviation, rel=0.05)
    assert one.mean() == pytest.approx(10.0, abs=0.05 * deviation)
    assert_array_equal(one, again)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.06


def test_a_lost_sample_reads_the_last_good_one_or_zero(read_force):
    values = np.arange(1.0, 2001.0)
    held, zero = read_force(values, "dropout=0.3"), read_force(values, "dropout=0.3", "dropout_reads=zero")
    lost = held != values
    assert lost.mean() == pytest.approx(0.3, abs=0.04)
    assert_array_equal(held[1:][lost[1:]], held[:-1][lost[1:]])
    assert_array_equal(zero, np.where(lost, 0.0, values))


def test_only_the_named_legs_are_altered(read_force):
    settings = ("bias=1", "dropout=1e-9", "legs=[1,3]", "fault.kind=zero", "fault.legs=[4]")
    assert read_force([[10, 20, 30, 40]], *settings, scenario="quadruped").tolist() == [[11, 20, 31, 0]]


# A channel for each reading

OF_LEGS = {"force": "force", "position": "q", "velocity": "dq"}
OF_BODY = {
    "height": ("body", 0),
    "tilt": ("body", [1, 2]),
    "height_rate": ("body_rate", 0),
    "tilt_rate": ("body_rate", [1, 2]),
}
FIELDS = ("force", "q", "dq", "body", "body_rate")
"""What has channels; feet follow from joints."""


@pytest.fixture
def sensing(make_config):
    """Sensors of a quadruped, and its mechanism."""

    def make(*overrides):
        made = make_scenario(make_config("scenario=quadruped", "feedforward=none", REAL, *SHORT, *overrides))
        return made.sensors, made.setup.mechanism

    return make


def random_measurement(seed):
    rng = np.random.default_rng(seed)
    return Measurement(*(rng.uniform(0.5, 1.5, values.shape) for values in new_measurement(LEGS)[:7]))


def errors(sensors, true):
    """Reading less true value, by field."""
    read = sensors.measure(true)
    return {name: getattr(read, name) - getattr(true, name) for name in FIELDS}


@pytest.mark.parametrize("name", SIGNALS)
def test_a_bias_changes_the_readings_of_its_signal_and_leg_alone(sensing, name):
    field, places = OF_BODY[name] if name in OF_BODY else (OF_LEGS[name], 2)
    legs = [] if name in OF_BODY else [f"sensors.{name}.legs=[3]"]
    sensors, _ = sensing(f"sensors.{name}.bias=0.25", *legs)
    for step in range(2):
        for other, found in errors(sensors, random_measurement(step)).items():
            expected = np.zeros_like(found)
            if other == field:
                expected[places] = 0.25
            assert_allclose(found, expected, atol=1e-15)


def test_every_reading_has_noise_of_its_own_and_is_its_own_true_value_of_earlier(sensing):
    noisy, _ = sensing(*(f"sensors.{name}.noise=1" for name in SIGNALS))
    true = [random_measurement(step) for step in range(6)]
    drawn = [np.concatenate([e.ravel() for e in errors(noisy, each).values()]) for each in true]
    assert len(np.unique(np.round(drawn, 9))) == 6 * (LEGS * 5 + 6)
    late, _ = sensing(*(f"sensors.{name}.delay=2" for name in SIGNALS))
    for step, now in enumerate(true):
        read = late.measure(now)
        for name in FIELDS:
            assert_array_equal(getattr(read, name), getattr(true[max(step - 2, 0)], name))


@pytest.mark.parametrize("altered", ["position", "velocity"])
def test_feet_follow_from_the_joints_that_are_read(sensing, altered):
    sensors, mechanism = sensing(f"sensors.{altered}.bias=0.1")
    true = random_measurement(0)
    read = sensors.measure(true)
    for i in range(LEGS):
        leg, trig = get_leg(mechanism, i), trigonometry(*read.q[i])
        assert_allclose(read.foot[i], foot_position(leg, trig) if altered == "position" else true.foot[i])
        assert_allclose(read.velocity[i], foot_velocity(leg, trig, *read.dq[i]))


def test_a_point_mass_measures_where_it_is_and_how_fast(make_config):
    made = make_scenario(make_config("scenario=force_step", REAL, "sensors.position.bias=0.5"))
    seen = made.sensors.measure(made.first._replace(dq=np.array([[0.25, -0.5]])))
    assert seen.foot.tolist() == seen.q.tolist() == (made.first.q + 0.5).tolist()
    assert seen.velocity.tolist() == seen.dq.tolist() == [[0.25, -0.5]]


# In a run


def test_sensors_without_imperfections_change_no_bit(make_config):
    perfect, real = (
        roll_out(make_scenario(make_config("cycles=3", *SHORT, f"sensors={s}"))) for s in ("perfect", "real")
    )
    assert perfect.samples.tobytes() == real.samples.tobytes()


@pytest.mark.ci
def test_true_and_measured_values_stand_beside_each_other_in_the_trace(stored):
    biases = ("sensors.position.bias=0.001", "sensors.tilt_rate.bias=0.5", "sensors.force.bias=2")
    run = stored("scenario=quadruped", "cycles=1", "gait.cycle_time=1", REAL, *biases)
    legs, body = run.trace, run.body
    measured = [name for table in (legs, body) for name in table.columns if name.endswith("_measured")]
    assert {*measured} == {f"{name}_measured" for name in
                           ("x", "y", "vx", "vy", "q1", "q2", "force", "pitch_rate", "roll_rate")}  # fmt: skip
    assert_allclose(legs.q2_measured - legs.q2, 0.001)
    assert_allclose(legs.force_measured - legs.force, 2.0)
    assert_allclose(body.pitch_rate_measured - body.pitch_rate, 0.5)
    assert_allclose(body.pitch_rate[1:], np.diff(body.pitch) / 0.005, atol=1e-12)


# A lead that is worked out


@pytest.mark.parametrize(
    ("overrides", "lead"),
    [
        ([], 1),
        (["actuator.delay=2"], 3),
        ([REAL, "sensors.velocity.delay=1", "actuator.delay=1"], 3),
        ([REAL, "sensors.position.delay=3"], 1),
        ([REAL, "sensors.velocity.lag=0.01", "actuator.lag=0.02", "actuator.delay=1"], 6),
        ([REAL, "sensors.position.lag=0.02"], 1),
        ([REAL, "sensors.position.delay=3", "controller.velocity_gain=0"], 4),
    ],
)
def test_an_automatic_lead_counts_the_samples_from_torque_to_feedback(make_config, overrides, lead):
    made = make_scenario(make_config(*overrides, *SHORT, "learning.lead=auto"))
    assert (made.setup.lead, made.feedforward.params.learning.lead) == (lead, lead)


def test_custom_sensors_declare_by_how_much_they_delay_the_feedback(make_config):
    config = make_config("learning=lasting", *SHORT)
    sensors = PerfectSensors(config.sensors)
    sensors.feedback_delay = lambda uses_velocity: 2 if uses_velocity else 0
    assert make_scenario(config, sensors=sensors).setup.lead == 3
    sensors.feedback_lag = lambda uses_velocity: 0.02
    setup = make_scenario(config, sensors=sensors).setup
    assert (setup.lead, setup.rate) == (5, 50 / 256 / 9)
