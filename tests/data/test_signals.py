"""The table of signals is the only place that declares a column."""

import numpy as np

from cmacexp.data.signals import ARRAYS, BODY_SIGNALS, LEG_SIGNALS, MEMORY_SIGNALS, select_signals
from cmacexp.loop.samples import ALL_SAMPLES, BODY_SAMPLES, SAMPLES, WIDE_BODY_SAMPLES, WIDE_SAMPLES
from cmacexp.plants.protocol import STATE, Measurement, get_state, new_measurement
from cmacexp.sensors.kernels import Observation, new_observation
from cmacexp.sensors.protocol import SIGNALS


def names(signals):
    return [signal.name for signal in signals]


def test_a_name_stands_once_in_its_table():
    for table in (LEG_SIGNALS, BODY_SIGNALS, MEMORY_SIGNALS):
        assert len(set(names(table))) == len(table)


def test_a_measurement_has_the_arrays_of_the_table():
    fields = list(ARRAYS)[: list(ARRAYS).index("travel") + 1]
    assert fields == list(Measurement._fields)
    for name, values in new_measurement(4, 3)._asdict().items():
        assert values is None or np.shape(values)[-1] == len(ARRAYS[name]) or name == "force"


def test_an_observation_has_the_arrays_of_a_measurement_and_the_geometry_of_its_legs():
    assert Observation._fields == (*STATE, "geometry")
    shapes = [values.shape for values in get_state(new_measurement(4))]
    assert [values.shape for values in new_observation(4)] == [*shapes, (4, 4)]


def test_the_arrays_hold_signals_that_the_loop_samples():
    sampled = {*ALL_SAMPLES, *WIDE_BODY_SAMPLES}
    assert {name for array in ARRAYS.values() for name in array} <= sampled


def test_the_signals_that_sensors_alter_are_those_of_the_sensors():
    assert {name for signal in (*LEG_SIGNALS, *BODY_SIGNALS) for name in signal.altered_by} == set(SIGNALS)


def test_samples_of_every_run_come_before_those_that_sensors_add():
    assert WIDE_SAMPLES[: len(SAMPLES)] == SAMPLES
    assert WIDE_BODY_SAMPLES[: len(BODY_SAMPLES)] == BODY_SAMPLES


def test_a_run_has_measured_columns_of_what_its_sensors_alter():
    assert names(select_signals(LEG_SIGNALS)) == names(LEG_SIGNALS)[:-1]
    added = select_signals(LEG_SIGNALS, {"force", "velocity"}, watched=True)[len(LEG_SIGNALS) - 1 :]
    measured = [f"{name}_measured" for name in ("vx", "vy", "dq1", "dq2")]
    assert names(added) == [*measured, "force_trusted"]
    assert [signal.unit for signal in added] == ["m/s", "m/s", "rad/s", "rad/s", ""]
    rates = names(select_signals(BODY_SIGNALS, {"height_rate"}))[-2:]
    assert rates == ["height_rate", "height_rate_measured"]
