"""Laws of the metrics of a body, and of true margins that are added to an earlier trace."""

import numpy as np
import pyarrow as pa
import pytest
from cmacexp.metrics.earlier_body import add_true_margins
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.config import to_plain
from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.trace import assemble, assemble_body
from cmacexp.metrics import compute_body
from cmacexp.models.body import Load
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.true_margins import Masses, true_margins

COLUMNS = ("height", "pitch", "roll", "stability_margin", "margin_front", "margin_rear", *TRUE_MARGINS)
SHORT = ("scenario=quadruped", "feedforward=none", "gait.cycle_time=0.2", "cycles=1", "gait.lift=0.005")
PAYLOAD = ("payload.weight=5", "payload.x=0.05", "payload.y=-0.03", "payload.time=0.1")


def drawn(seed, rows):
    rng = np.random.default_rng(seed)
    return pa.table({name: rng.normal(size=rows) for name in COLUMNS})


@given(st.integers(0, 2**32 - 1), st.integers(8, 21))
def test_metrics_of_a_body_are_those_of_each_cycle_alone(seed, rows):
    """Of a last cycle that is short too."""
    body = drawn(seed, rows)
    found = compute_body(body, 7, first_cycle=3)
    assert found["cycle"].to_pylist() == list(range(3, 3 + -(-rows // 7)))
    for cycle, start in enumerate(range(0, rows, 7)):
        alone, metrics = body.slice(start, 7).to_pandas(), found.slice(cycle, 1).to_pydict()
        assert metrics["height_mean"][0] == pytest.approx(alone["height"].mean())
        assert metrics["height_min"][0] == alone["height"].min()
        assert metrics["height_max"][0] == alone["height"].max()
        assert metrics["tilt_max"][0] == max(alone["pitch"].abs().max(), alone["roll"].abs().max())
        for margin in COLUMNS[3:]:
            assert metrics[f"{margin}_min"][0] == alone[margin].min()


@pytest.mark.parametrize("payload", [(), PAYLOAD])
def test_true_margins_added_to_a_trace_are_those_that_a_run_computes(make_config, payload):
    """A config of a version without payload is that of a machine that carries none."""
    config = make_config(*SHORT, *payload)
    scenario = make_scenario(config)
    rollout = roll_out(scenario)
    legs = assemble(rollout.plan, rollout.columns(), config.sampling_period)
    body = assemble_body(scenario.setup, rollout.body_columns(), rollout.columns(), moves=False)
    plain = to_plain(config)
    if not payload:
        del plain["payload"]
    earlier = body.drop_columns(list(TRUE_MARGINS))
    added = add_true_margins(earlier, legs, plain)
    assert add_true_margins(body, legs, plain) is body
    for name in TRUE_MARGINS:
        assert_array_equal(added[name].to_numpy(), body[name].to_numpy())
    assert np.isfinite(body[TRUE_MARGINS[0]].to_numpy()).any()
    assert_allclose(added["height"].to_numpy(), body["height"].to_numpy())


@pytest.mark.parametrize("yaw", [None, 0.0, 0.01])
@pytest.mark.parametrize("carries", [True, False])
def test_legs_count_for_the_margins_where_the_plant_moves_the_body(make_config, yaw, carries):
    """Which has turned then; a payload counts from its time on."""
    config, rng = make_config("scenario=quadruped", *(PAYLOAD if carries else ())), np.random.default_rng(0)
    mechanism, rows = make_mechanism(config.machine), 30
    of_legs = {"x": rng.normal(0.0, 0.05, (rows, 4)), "y": rng.normal(0.5, 0.01, (rows, 4))}
    of_legs |= {"q1": rng.normal(1.0, 0.1, (rows, 4)), "force": rng.normal(5.0, 4.0, (rows, 4))}
    of_body = {"pitch": rng.normal(0.0, 0.05, rows), "roll": rng.normal(0.0, 0.05, rows)}
    body = pa.table({"step": np.arange(rows), **of_body})
    if yaw is not None:
        body = body.append_column("yaw", pa.array(np.full(rows, yaw)))
    plain = to_plain(config)
    if not carries:
        del plain["payload"]
    added = add_true_margins(body, pa.table({name: values.ravel() for name, values in of_legs.items()}), plain)
    load = Load(5.0, 0.05, -0.03) if carries else Load(0.0, 0.0, 0.0)
    masses = Masses(mechanism, config.machine.body_mass if yaw else None, load, np.arange(rows) >= 20)
    expected = true_margins(masses, of_legs, of_body)
    assert_allclose([added[name].to_numpy() for name in TRUE_MARGINS], expected.T)
    assert np.isfinite(expected).any()


def test_cycles_count_from_1_unless_another_is_the_first():
    assert compute_body(drawn(0, 15), 7)["cycle"].to_pylist() == [1, 2, 3]
