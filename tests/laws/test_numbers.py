"""The paper's one leg and its force step: the figures that the project stands for."""

import pytest

pytestmark = pytest.mark.ci
LEG = ("scenario=one_leg",)
SMOOTH = (*LEG, "gait.vertical=two_cubics", "reference=aware")
EXACT = "feedforward=inverse_dynamics"
STEP = "scenario=force_step"
METHODS = {
    "stiffness": (STEP, "force_control=stiffness"),
    "damping": (STEP, "force_control=damping"),
    "combined": (STEP,),
    "explicit": (STEP, "force_control=explicit", "machine.mass=1.0"),
}


@pytest.fixture(scope="module")
def metrics(stored):
    """Metrics of a run that stores little, by cycle."""
    return lambda *overrides: stored(*overrides, "record=metrics").metrics.set_index("cycle")


def test_literal_reference_settles_within_5_percent_but_no_nearer_than_its_bias(metrics):
    error = metrics(*LEG, "cycles=10", "reference=literal").force_steady_state_error
    assert abs(error[5]) < 0.05
    assert error[10] == pytest.approx(0.01 / 0.205, abs=0.005)


def test_aware_reference_removes_the_bias_and_force_feedforward_with_a_smaller_share(metrics):
    aware, ahead = (metrics(*LEG, f"reference={name}").loc[5] for name in ("aware", "force_feedforward"))
    assert abs(aware.force_steady_state_error) < 0.005
    assert abs(ahead.force_steady_state_error) < 0.005
    assert ahead.feedforward_share < aware.feedforward_share


def test_on_a_smooth_path_exact_inverse_dynamics_is_below_cmac_in_every_cycle(metrics):
    exact, learned = metrics(*SMOOTH, EXACT), metrics(*SMOOTH)
    for name, limit in (("transfer_rmse_x", 1e-3), ("transfer_rmse_y", 3e-3)):
        assert (exact[name] < limit).all()
        assert (exact[name] < learned[name]).all()
    assert (exact.force_steady_state_error.abs() < 1e-3).all()


def test_on_the_jumping_path_cmac_overtakes_exact_inverse_dynamics(metrics):
    exact, learned = metrics(*LEG, EXACT).loc[5], metrics(*LEG).loc[5]
    assert learned.transfer_rmse_x < exact.transfer_rmse_x
    assert learned.transfer_rmse_y < exact.transfer_rmse_y


def test_a_force_step_settles_at_the_desired_force_and_combined_overshoots_least_of_the_quick(metrics):
    rows = {method: metrics(*overrides).loc[1] for method, overrides in METHODS.items()}
    for row in rows.values():
        assert row.force_settled == pytest.approx(1.0, abs=1e-3)
        assert row.force_ripple < 1e-3
    quick = {method: row.force_overshoot for method, row in rows.items() if row.force_settling_time < 1.0}
    assert set(quick) == {"stiffness", "combined", "explicit"}
    assert min(quick, key=quick.get) == "combined"


def test_explicit_limit_cycles_with_half_a_kilogram(metrics):
    row = metrics(STEP, "force_control=explicit").loc[1]
    assert row.force_ripple > 0.5
    assert row.force_settling_time != row.force_settling_time  # NaN


@pytest.mark.parametrize(("method", "factor"), [("stiffness", 420 / 320), ("combined", 430 / 330), ("damping", 1.0)])
def test_ground_twice_as_stiff_as_assumed(metrics, method, factor):
    found = metrics(*METHODS[method], "terrain.stiffness=20", "terrain.assumed_stiffness=10")
    assert found.loc[1].force_settled == pytest.approx(factor, abs=1e-3)
