"""A force sensor that cannot be right is found out and dropped; a sound one never is."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.rollout import roll_out

from cmacexp.control.fault_detection import expected_force
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import make_pose


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_the_expected_force_is_the_true_one_where_all_else_is_known(make_config, scenario):
    made = make_scenario(make_config(f"scenario={scenario}", "cycles=1"))
    stiffness, mechanism = made.setup.config.terrain.stiffness, made.setup.mechanism
    rollout = roll_out(made)
    columns, body = rollout.columns(), rollout.body_columns()
    for k in range(0, 600, 7):
        foot = np.stack([columns["x"][k], columns["y"][k]], axis=1)
        pose = make_pose(np.array([body[name][k] for name in ("height", "pitch", "roll")]))
        expected = [expected_force(stiffness, mechanism, i, foot, pose) for i in range(len(foot))]
        np.testing.assert_allclose(expected, columns["force"][k], atol=1e-8)


WALK = ["scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12", "plausibility=force"]
GAINS = ["force_control.elasticity=0.001", "force_control.admittance=0.001"]
FAULTS = [("zero", 0), ("last", 0), ("value", 40), ("bias", 10), ("noise", 20)]


@pytest.mark.parametrize(("kind", "value"), FAULTS, ids=[kind for kind, _ in FAULTS])
def test_a_fault_is_found_within_a_cycle_on_that_leg_alone(make_config, kind, value):
    fault = [f"sensors.force.fault.{key}" for key in (f"kind={kind}", f"value={value}", "legs=[3]", "start=7.1")]
    made = make_scenario(make_config(*WALK, *GAINS, "cycles=4", "sensors=force_stuck", *fault))
    assert roll_out(made).status == "completed"
    assert list(made.controller.dropped) == [3]
    assert 0 < made.controller.dropped[3] - 1420 <= 600


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_sound_sensor_is_kept_while_the_machine_learns(make_config, noise):
    sensors = ["sensors=noisy_force", f"sensors.force.noise_relative={noise}"]
    for scenario in ([*WALK, *GAINS], ["plausibility=force"]):
        made = make_scenario(make_config(*scenario, *sensors, "cycles=20"))
        assert roll_out(made).status == "completed"
        assert made.controller.dropped == {}


@pytest.mark.parametrize("method", ["stiffness", "damping", "combined", "explicit"])
def test_without_its_sensor_each_method_still_presses_with_the_desired_force(make_config, method):
    # Explicit control runs away within 0.1 s of a force that stays 0: the check must be quick.
    mass = ["machine.mass=1.0", "plausibility.patience=1"] if method == "explicit" else []
    config = make_config(
        "scenario=force_step", f"force_control={method}", *mass, "gait.cycle_time=20", "sensors=force_stuck",
        "sensors.force.fault.start=0", "plausibility=force",
    )  # fmt: skip
    made = make_scenario(config)
    force = roll_out(made).columns()["force"][-1, 0]
    assert list(made.controller.dropped) == [1]
    assert force == pytest.approx(1.0, rel=0.02)


def test_both_loops_drop_it_alike_and_the_trace_and_the_manifest_say_when(make_config, tmp_path):
    config = make_config(*WALK, *GAINS, "cycles=3", "sensors=force_stuck", "record=trace")
    fused, stepped = (roll_out(make_scenario(config), fused=f) for f in (True, False))
    assert fused.samples.tobytes() == stepped.samples.tobytes()
    run_scenario(config, tmp_path)
    (dropped,) = json.loads((tmp_path / "manifest.json").read_text())["dropped"]
    trace = pq.read_table(tmp_path / "trace.parquet").to_pandas()
    lost = trace[trace["force_trusted"] == 0]
    assert (dropped["leg"], dropped["step"]) == (1, lost["step"].min())
    assert set(lost["leg"]) == {1}
    assert len(lost) == 1800 - dropped["step"]


def test_at_a_relative_tolerance_of_1_a_sensor_stuck_at_zero_would_pass(make_config):
    with pytest.raises(BadInput, match=r"plausibility\.relative_tolerance=1\.0: must be at least 0 and below 1"):
        make_config("plausibility.relative_tolerance=1")
