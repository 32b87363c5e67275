"""Laws of the detection of faulty force sensors, and of the force that control uses instead."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmacexp.control.fault_detection import FaultDetection, new_fault_status, update_status
from cmacexp.control.hybrid_kernels import METHODS, control_force
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import LEVEL

PARAMS = FaultDetection(enabled=True, tolerance=0.5, relative_tolerance=0.1, patience=4.0)


def allowed(expected):
    return PARAMS.tolerance + PARAMS.relative_tolerance * expected


@given(st.floats(0.0, 50.0), st.floats(-1.0, 1.0))
def test_a_sensor_within_the_tolerance_stays_trusted_without_a_trace(expected, share):
    status = new_fault_status(3)
    for step in range(20):
        assert update_status(PARAMS, status, 1, expected + 0.999 * share * allowed(expected), expected)
        assert status.statistic.tolist() == [0.0, 0.0, 0.0]
        assert status.steps.tolist() == [0.0, step + 1.0, 0.0]
    assert status.trusted.tolist() == [1.0, 1.0, 1.0]


@given(st.floats(0.0, 50.0), st.floats(2.0, 1e6), st.sampled_from([1.0, -1.0]))
def test_no_deviation_however_large_is_found_before_patience_is_over(expected, times, way):
    """Twice the tolerance and all above count alike: after as many samples as patience allows, and one."""
    status, measured = new_fault_status(2), expected + 1.001 * way * times * allowed(expected)
    trusted = [update_status(PARAMS, status, 0, measured, expected) for _ in range(8)]
    assert trusted == [True] * 4 + [False] * 4
    assert status.steps.tolist() == [4.0, 0.0]
    assert status.trusted.tolist() == [0.0, 1.0]


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=60))
def test_the_statistic_is_the_largest_sum_of_the_last_excesses(deviations):
    """Page 1954: the sum of excesses, at most 1 each, since the sample from which on it is largest; or 0."""
    status, excess = new_fault_status(1), np.minimum(np.abs(deviations) - 1.0, 1.0)
    for k, deviation in enumerate(deviations):
        trusted = update_status(PARAMS, status, 0, 5.0 + deviation * allowed(5.0), 5.0)
        largest = max(0.0, *(excess[j : k + 1].sum() for j in range(k + 1)))
        assert status.statistic[0] == pytest.approx(largest, abs=1e-9)
        if not trusted:
            assert largest > PARAMS.patience - 1e-9
            break


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
def test_the_measured_force_is_used_until_its_sensor_is_excluded_and_for_ever_without_detection(
    make_config, scenario, method
):
    controller = make_scenario(make_config(f"scenario={scenario}", "feedforward=none")).controller
    mechanism = controller.params.mechanism
    pose = LEVEL._replace(height=mechanism.hip_height)
    foot = np.full((len(mechanism.legs), 2), mechanism.hip_height + 0.02)
    for enabled in (True, False):
        gains, detection = controller.params.gains._replace(stiffness=300.0), PARAMS._replace(enabled=enabled)
        params = controller.params._replace(method=METHODS[method], gains=gains, fault_detection=detection)
        status = new_fault_status(len(foot))
        used = [control_force(params, status, 0, 99.0, 7.0, foot, pose) for _ in range(6)]
        instead = 7.0 if method in ("stiffness", "combined") else 300.0 * 0.02
        expected = [99.0] * 4 + [instead] * 2 if enabled else [99.0] * 6
        assert used == pytest.approx(expected)
        assert status.trusted[0] == (0.0 if enabled else 1.0)
