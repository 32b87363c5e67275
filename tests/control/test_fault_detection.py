"""A force sensor that cannot be right is found out and dropped; a sound one never is."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from support.doors import make_pose, make_scenario, roll_out

from cmacexp.control.hybrid_kernels import (
    METHODS,
    FaultDetection,
    control_force,
    expected_force,
    new_fault_status,
    update_status,
)

PARAMS = FaultDetection(enabled=True, tolerance=0.5, relative_tolerance=0.1, patience=4.0)


deviations = st.lists(st.one_of(st.floats(-3.0, 3.0), st.floats(1e3, 1e6)), min_size=1, max_size=40)
"""From the expected force, over what is allowed."""


@given(deviations, st.floats(0.0, 50.0))
@example([0.99, -0.99] * 20, 5.0)
@example([1e6] * 8, 5.0)
def test_the_statistic_is_the_largest_sum_of_the_last_excesses(deviations, expected):
    """Page 1954: the sum of excesses, at most 1 each, since the sample from which on it is largest; or 0.

    So none within the tolerance leaves a trace, and none however large is found before patience is over.
    """
    status, excess = new_fault_status(3), np.minimum(np.abs(deviations) - 1.0, 1.0)
    for k, deviation in enumerate(deviations):
        measured = expected + deviation * (PARAMS.tolerance + PARAMS.relative_tolerance * expected)
        trusted = update_status(PARAMS, status, 1, measured, expected)
        largest = max(0.0, *(excess[j : k + 1].sum() for j in range(k + 1)))
        assert status.statistic == pytest.approx([0.0, largest, 0.0], abs=1e-9)
        assert trusted == (largest <= 4.0) or 0.0 < abs(largest - 4.0) < 1e-9
        assert status.trusted.tolist() == [1.0, float(trusted), 1.0]
        assert status.steps.tolist() == [0.0, k + float(trusted), 0.0]
        if not trusted:
            break
    else:
        return
    assert not update_status(PARAMS, status, 1, expected, expected)
    assert status.steps.tolist() == [0.0, k, 0.0]


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_the_measured_force_is_used_until_its_sensor_is_excluded_and_for_ever_without_detection(
    make_config, scenario
):
    """Then the desired force is, or that of the ground at the measured depth where no other term knows of it."""
    controller = make_scenario(make_config(f"scenario={scenario}", "feedforward=none")).controller
    mechanism, pose = controller.params.mechanism, make_pose(np.array([0.5, 0.0, 0.0]))
    foot = np.full((len(mechanism.legs), 2), mechanism.hip_height + 0.02)
    for enabled, method in [(on, method) for on in (True, False) for method in METHODS]:
        gains, detection = controller.params.gains._replace(stiffness=300.0), PARAMS._replace(enabled=enabled)
        params = controller.params._replace(method=METHODS[method], gains=gains, fault_detection=detection)
        status = new_fault_status(len(foot))
        used = [control_force(params, status, 0, 99.0, 7.0, foot, pose) for _ in range(6)]
        instead = 7.0 if method in ("stiffness", "combined") else 300.0 * 0.02
        assert used == pytest.approx([99.0] * 4 + [instead] * 2 if enabled else [99.0] * 6)
        assert status.trusted[0] == (0.0 if enabled else 1.0)


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_the_expected_force_is_the_true_one_where_all_else_is_known(make_config, scenario):
    short = ("feedforward=none", "cycles=1", "gait.cycle_time=0.2", "gait.lift=0.01")
    made = make_scenario(make_config(f"scenario={scenario}", *short))
    stiffness, mechanism, run = made.setup.config.terrain.stiffness, made.setup.mechanism, roll_out(made)
    x_y_force = [run.columns()[name] for name in ("x", "y", "force")]
    bodies = run.body_samples[:, :3] if scenario == "quadruped" else [made.first.body] * run.steps
    for x, y, force, body in zip(*x_y_force, bodies, strict=True):
        pose, feet = make_pose(body), np.stack([x, y], axis=1)
        expected = [expected_force(stiffness, mechanism, i, feet, pose) for i in range(len(feet))]
        assert_allclose(expected, force, atol=1e-8)
    assert force.any()


# In whole runs

WALK = (
    *("scenario=quadruped", "learning.lead=1", "gait.load_ramp=0.12", "plausibility=force"),
    *("force_control.elasticity=0.001", "force_control.admittance=0.001"),
)


@pytest.mark.ci
@pytest.mark.parametrize(("kind", "value"), [("zero", 0), ("last", 0), ("value", 40), ("bias", 10), ("noise", 20)])
def test_a_fault_is_found_within_a_cycle_on_that_leg_alone(make_config, kind, value):
    """From the second cycle on, while the machine learns."""
    fault = [f"sensors.force.fault.{key}" for key in (f"kind={kind}", f"value={value}", "legs=[3]", "start=4.1")]
    made = make_scenario(make_config(*WALK, "cycles=3", "sensors=force_stuck", *fault))
    assert roll_out(made).status == "completed"
    assert list(made.controller.dropped) == [3]
    assert 0 < made.controller.dropped[3] - 820 <= 600


@pytest.mark.ci
def test_a_noisy_sound_sensor_is_kept_while_the_machine_learns(make_config):
    for scenario in (WALK, ["plausibility=force"]):
        sensors = ("sensors=noisy_force", "sensors.force.noise_relative=0.2")
        made = make_scenario(make_config(*scenario, *sensors, "cycles=8"))
        assert roll_out(made).status == "completed"
        assert made.controller.dropped == {}


@pytest.mark.ci
@pytest.mark.parametrize("method", METHODS)
def test_without_its_sensor_each_method_still_presses_with_the_desired_force(make_config, method):
    # Explicit control runs away within 0.1 s of a force that stays 0: the check must be quick.
    mass = ["machine.mass=1.0", "plausibility.patience=1"] if method == "explicit" else []
    fault = ("sensors=force_stuck", "sensors.force.fault.start=0", "plausibility=force")
    step = ("scenario=force_step", f"force_control={method}", "gait.cycle_time=10", *mass)
    made = make_scenario(make_config(*step, *fault))
    force = roll_out(made).columns()["force"][-1, 0]
    assert list(made.controller.dropped) == [1]
    assert force == pytest.approx(1.0, rel=0.02)


@pytest.mark.ci
def test_the_trace_and_the_manifest_say_when_a_sensor_was_dropped(stored):
    fault = ("sensors=force_stuck", "sensors.force.fault.start=1")
    run = stored("scenario=one_leg", "cycles=1", "plausibility=force", *fault)
    (dropped,), lost = run.manifest["dropped"], run.trace[run.trace["force_trusted"] == 0]
    assert (dropped["leg"], dropped["step"]) == (1, lost["step"].min())
    assert len(lost) == len(run.trace) - dropped["step"]
