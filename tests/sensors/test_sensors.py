"""Sensors: each imperfection by itself, the kinematics of what is measured, both loops, trace, and bad input."""

import itertools
import json
import re

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.command import ROOT
from support.rollout import roll_out

from cmacexp.commands.score import score
from cmacexp.data.signals import BODY_SIGNALS, select_signals
from cmacexp.experiment.run import run_scenario
from cmacexp.loop.scenario import make_scenario
from cmacexp.sensors.channel import FAULTS, WITHOUT_VALUE, normal, uniform
from cmacexp.sensors.protocol import SIGNALS, PerfectSensors

REAL = "sensors=real"


def tell(make_config, values, *overrides, scenario="one_leg"):
    """What the force sensors (steps, L) tell of ``values`` (steps, L)."""
    made = make_scenario(make_config(f"scenario={scenario}", REAL, *overrides))
    first = made.first
    return np.array([made.sensors.measure(first._replace(force=np.array(row, dtype=float))).force for row in values])


def tell_one(make_config, values, *overrides):
    return tell(make_config, np.reshape(values, (-1, 1)), *overrides)[:, 0].tolist()


# Chance


def test_normal_numbers_are_white_and_have_mean_0_and_variance_1():
    drawn = np.array([[normal(key, step) for step in range(20000)] for key in (7, 8)])
    assert np.abs(drawn.mean(axis=1)).max() < 0.03
    assert np.abs(drawn.var(axis=1) - 1.0).max() < 0.04
    assert abs((drawn**4).mean() - 2.9) < 0.12  # of a sum of twelve uniform numbers; 3 for a Gaussian
    for lag in (1, 2, 3, 8, 600):
        assert abs((drawn[:, lag:] * drawn[:, :-lag]).mean()) < 0.025
    assert abs((drawn[0] * drawn[1]).mean()) < 0.03


def test_uniform_numbers_fill_their_range_evenly():
    drawn = np.array([uniform(3, step) for step in range(20000)])
    counts, _ = np.histogram(drawn, bins=20, range=(0.0, 1.0))
    assert counts.sum() == 20000
    assert ((counts - 1000.0) ** 2 / 1000.0).sum() < 45.0  # chi-squared of 19, one chance in a thousand


# One imperfection at a time, by hand


def test_sensors_without_imperfections_change_no_bit(make_config):
    perfect, real = (roll_out(make_scenario(make_config("cycles=2", f"sensors={s}"))) for s in ("perfect", "real"))
    assert perfect.samples.tobytes() == real.samples.tobytes()


def test_delay_gives_the_value_of_so_many_samples_ago_and_the_first_before(make_config):
    assert tell_one(make_config, [5, 6, 7, 8, 9], "sensors.force.delay=2") == [5, 5, 5, 6, 7]


def test_bias_and_quantum(make_config):
    told = tell_one(make_config, [0.0, 0.9, 1.2, -1.0], "sensors.force.bias=0.2", "sensors.force.quantum=0.5")
    assert told == [0.0, 1.0, 1.5, -1.0]


def test_a_filter_follows_the_reading_with_a_first_order_lag_from_the_first_one_on(make_config):
    half = f"sensors.force.lag={0.005 / np.log(2.0)}"
    assert tell_one(make_config, [1, 5, 5, 5], half) == pytest.approx([1, 3, 4, 4.5])
    assert tell_one(make_config, [1, 5, 5, 5], half, "sensors.force.start=0.01") == pytest.approx([1, 5, 5, 5])
    assert tell_one(make_config, [1, 5, 9, 9], half, "sensors.force.start=0.01") == pytest.approx([1, 5, 7, 8])


def test_imperfections_begin_at_their_start(make_config):
    told = tell_one(make_config, [1, 1, 1, 1], "sensors.force.bias=1", "sensors.force.start=0.01")
    assert told == [1, 1, 2, 2]


def test_noise_is_absolute_or_in_proportion_and_of_the_seed(make_config):
    still = np.full(4000, 10.0)
    for setting, deviation in (("noise=0.5", 0.5), ("noise_relative=0.2", 2.0)):
        told, again, other = (
            np.array(tell_one(make_config, still, f"sensors.force.{setting}", f"seed={seed}")) for seed in (1, 1, 2)
        )
        assert told.std() == pytest.approx(deviation, rel=0.05)
        assert told.mean() == pytest.approx(10.0, abs=0.1)
        assert (told == again).all()
        assert abs(np.corrcoef(told, other)[0, 1]) < 0.06
    assert not any(tell_one(make_config, np.zeros(100), "sensors.force.noise_relative=0.2"))


def test_a_lost_sample_reads_the_last_good_one_or_zero(make_config):
    values = np.arange(1.0, 2001.0)
    held = np.array(tell_one(make_config, values, "sensors.force.dropout=0.3"))
    lost = held != values
    assert lost.mean() == pytest.approx(0.3, abs=0.04)
    assert (held[1:][lost[1:]] == held[:-1][lost[1:]]).all()
    zero = np.array(tell_one(make_config, values, "sensors.force.dropout=0.3", "sensors.force.dropout_reads=zero"))
    assert (zero[lost] == 0.0).all()
    assert (zero[~lost] == values[~lost]).all()


def documented_faults():
    """Kinds of docs/sensors.md, with the readings that stand there from the start of the fault on."""
    rows = re.findall(r"^\| `(\w+)` \|[^|]+\| ([-\d. ]+|random) \|$", (ROOT / "docs/sensors.md").read_text(), re.M)
    return {kind: readings for kind, readings in rows if kind not in SIGNALS}


def test_the_documentation_lists_every_fault():
    assert list(documented_faults()) == [kind for kind in FAULTS if kind != "none"]


@pytest.mark.parametrize(
    ("kind", "readings"), [row for row in documented_faults().items() if row[1] != "random"], ids=lambda v: v[:5]
)
def test_a_fault_reads_what_the_documentation_says(make_config, kind, readings):
    value = [] if kind in WITHOUT_VALUE else ["sensors.force.fault.value=40"]
    overrides = [f"sensors.force.fault.kind={kind}", "sensors.force.fault.start=0.01", *value]
    assert tell_one(make_config, [1, 2, 3, 4, 5], *overrides) == [1, 2, *map(float, readings.split())]


def test_noise_as_a_fault_comes_on_top_of_that_of_a_sound_sensor(make_config):
    faulty = ["sensors.force.fault.kind=noise", "sensors.force.fault.value=3", "sensors.force.noise=4"]
    told = np.array(tell_one(make_config, np.zeros(4000), *faulty))
    assert told.std() == pytest.approx(5.0, rel=0.05)


def test_only_the_named_legs_are_altered(make_config):
    overrides = [
        "sensors.force.bias=1", "sensors.force.legs=[1,3]", "sensors.force.fault.kind=zero",
        "sensors.force.fault.legs=[4]",
    ]  # fmt: skip
    assert tell(make_config, [[10, 20, 30, 40]], *overrides, scenario="quadruped").tolist() == [[11, 20, 31, 0]]


# Kinematics


def test_a_point_mass_measures_where_it_is_and_how_fast(make_config):
    made = make_scenario(make_config("scenario=force_step", REAL, "sensors.position.bias=0.5"))
    seen = made.sensors.measure(made.first._replace(dq=np.array([[0.25, -0.5]])))
    assert seen.foot.tolist() == seen.q.tolist() == (made.first.q + 0.5).tolist()
    assert seen.velocity.tolist() == seen.dq.tolist() == [[0.25, -0.5]]


# Trace


def test_true_and_measured_values_stand_beside_each_other(make_config, tmp_path):
    overrides = ["sensors.position.bias=0.001", "sensors.tilt_rate.bias=0.5", "sensors.force.bias=2"]
    config = make_config("scenario=quadruped", REAL, *overrides, "cycles=1", "record=trace")
    run_scenario(config, tmp_path)
    legs, body = (pq.read_table(tmp_path / f"{name}.parquet").to_pandas() for name in ("trace", "body"))
    assert legs.columns[25:].tolist() == [f"{name}_measured" for name in ("x", "y", "vx", "vy", "q1", "q2")]
    np.testing.assert_allclose(legs.q2_measured - legs.q2, 0.001)
    np.testing.assert_allclose(legs.force_measured - legs.force, 2.0)
    assert body.columns[len(select_signals(BODY_SIGNALS)) :].tolist() == [
        *("pitch_rate", "roll_rate", "pitch_rate_measured", "roll_rate_measured")
    ]  # fmt: skip
    np.testing.assert_allclose(body.pitch_rate[1:], np.diff(body.pitch) / 0.005, atol=1e-12)
    before = (tmp_path / "metrics.parquet").read_bytes()
    score(tmp_path)
    assert (tmp_path / "metrics.parquet").read_bytes() == before


def test_perfect_sensors_add_no_columns(make_config, tmp_path):
    run_scenario(make_config("cycles=1", REAL, "sensors.force.bias=1", "record=trace"), tmp_path)
    names = pq.read_schema(tmp_path / "trace.parquet").names
    assert [name for name in names if name.endswith("_measured")] == ["force_measured"]


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
def test_an_automatic_lead_counts_the_samples_from_torque_to_feedback(make_config, tmp_path, overrides, lead):
    config = make_config(*overrides, "learning.lead=auto", "cycles=1", "record=trace")
    run_scenario(config, tmp_path)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert (manifest["learning_lead"], manifest["config"]["learning"]["lead"]) == (lead, "auto")
    assert make_scenario(config).feedforward.params.learning.lead == lead


class LateSensors(PerfectSensors):
    """They declare how late they are."""

    def feedback_delay(self, uses_velocity):
        return 2 if uses_velocity else 0


def test_custom_sensors_declare_by_how_much_they_delay_the_feedback(make_config):
    config = make_config("learning=lasting")
    sensors = LateSensors(config.sensors)
    assert make_scenario(config, sensors=sensors).setup.lead == 3
    sensors.feedback_lag = lambda uses_velocity: 0.02
    setup = make_scenario(config, sensors=sensors).setup
    assert (setup.lead, setup.rate) == (5, 50 / 256 / 9)


# Bad input


def test_stuck_and_lossy_sensors_may_be_those_of_different_legs(make_config):
    for lossy, stuck in itertools.permutations((1, 2), 2):
        overrides = [
            f"sensors.force.legs=[{lossy}]",
            f"sensors.force.fault.legs=[{stuck}]",
            "sensors.force.dropout=0.1",
        ]
        make_config("scenario=quadruped", REAL, *overrides, "sensors.force.fault.kind=zero")
