"""Metrics of legs that move in space: laws that join them with those of a plane."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.made_traces import measure

from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.registry import LEG_METRICS

CYCLE, ROWS, LEGS = "TTTSSSS", 14, 2
JOINTS = (1, 2, 3)


@pytest.fixture(scope="module")
def columns():
    """Every column of a robot's trace that a metric may read, at random."""
    rng = np.random.default_rng(5)
    names = ["force", "force_desired", *(f"{axis}{of}" for axis in "xyz" for of in ("", "_desired"))]
    names += [f"q{n}{of}" for n in JOINTS for of in ("", "_desired")]
    names += [f"tau_{of}_{n}" for n in JOINTS for of in ("feedback", "feedforward", "force")]
    return {name: rng.normal(size=(ROWS, LEGS)) for name in names}


@pytest.fixture
def of_robot(columns):
    """Metrics of a robot, some columns replaced."""
    return lambda **other: measure(CYCLE, rows=ROWS, legs=LEGS, in_space=True, **{**columns, **other})


def test_a_robot_has_the_metrics_of_every_machine_and_then_its_own(of_robot):
    assert list(of_robot()) == ["cycle", "leg", *LEG_METRICS, *SPATIAL]
    assert not SPATIAL.keys() & measure(CYCLE).keys()


def test_squared_distances_are_the_sum_of_those_along_the_axes(of_robot):
    found = of_robot()
    along = sum(found[f"transfer_rmse_{axis}"] ** 2 for axis in "xyz")
    assert_allclose(found["transfer_rmse"] ** 2, along, rtol=1e-12)


def test_across_the_machine_is_no_special_direction(columns, of_robot):
    found, other = (
        of_robot(),
        of_robot(**{a + of: columns[b + of] for a, b in ("xz", "zx") for of in ("", "_desired")}),
    )
    for phase in ("transfer", "support"):
        assert_array_equal(other[f"{phase}_rmse_z"], found[f"{phase}_rmse_x"])
    assert_allclose(other["transfer_rmse"], found["transfer_rmse"], rtol=1e-14)


def test_no_joint_is_special_and_joints_that_err_alike_have_that_error(columns, of_robot):
    families = ("q{}", "q{}_desired", "tau_feedback_{}", "tau_feedforward_{}", "tau_force_{}")
    turned = {name.format(n): columns[name.format(n % 3 + 1)] for name in families for n in JOINTS}
    found, other = of_robot(), of_robot(**turned)
    for name in ("joint_rmse", "feedback_rms", "feedforward_rms", "torque_peak", "feedforward_share"):
        assert_allclose(other[name], found[name], rtol=1e-14, err_msg=name)
    beside = {f"q{n}": columns[f"q{n}_desired"] + 0.02 * (-1.0) ** n for n in JOINTS}
    assert_allclose(of_robot(**beside)["joint_rmse"], 0.02, rtol=1e-12)


def test_what_the_plan_knows_of_the_torque_is_no_feedback_but_drives_the_joints(columns, of_robot):
    """As much more J^T F_d within the feedback changes nothing but the peak."""
    names = [f"tau_{of}_{n}" for of in ("feedback", "force") for n in JOINTS]
    found, other = of_robot(), of_robot(**{name: columns[name] + 100.0 for name in names})
    assert (other["torque_peak"] > found["torque_peak"] + 90.0).all()
    for name in set(found) - {"torque_peak"}:
        assert_allclose(other[name], found[name], rtol=1e-9, err_msg=name)


def test_a_third_joint_at_rest_takes_its_part_of_the_mean(columns):
    """The sum of squares is that of the plane, over three joints instead of two."""
    rest = {f"tau_{of}_3": 0.0 for of in ("feedback", "feedforward")} | {f"tau_force_{n}": 0.0 for n in JOINTS}
    own = {"rows": ROWS, "legs": LEGS, **columns, **rest}
    plane, space = measure(CYCLE, **own), measure(CYCLE, in_space=True, **own)
    for name in ("feedback_rms", "feedforward_rms", "feedback_change"):
        assert_allclose(space[name], plane[name] * np.sqrt(2.0 / 3.0), rtol=1e-12)
    for name in ("torque_peak", "feedforward_share", "transfer_rmse_x", "force_rmse"):
        assert_allclose(space[name], plane[name], rtol=1e-14)
