"""The paper's one leg and its force step, from the command line: the figures that the project stands for."""

import pandas as pd
import pytest
from support.command import cmacexp


@pytest.fixture(scope="module")
def metrics(tmp_path_factory):
    kept: dict[tuple[str, ...], pd.DataFrame] = {}

    def run(*overrides: str) -> pd.DataFrame:
        if overrides not in kept:
            folder = tmp_path_factory.mktemp("numbers")
            done = cmacexp(*overrides, "record=trace", f"hydra.run.dir={folder}", folder=folder)
            assert done.returncode == 0, done.stderr
            kept[overrides] = pd.read_parquet(folder / "metrics.parquet").set_index("cycle")
        return kept[overrides]

    return run


def test_literal_reference_settles_within_5_percent_but_no_nearer_than_its_bias(metrics):
    table = metrics("scenario=one_leg", "cycles=10", "reference=literal")
    assert abs(table.force_steady_state_error[5]) < 0.05
    assert table.force_steady_state_error[10] == pytest.approx(0.01 / 0.205, abs=0.005)


def test_aware_reference_removes_the_bias(metrics):
    assert abs(metrics("scenario=one_leg", "reference=aware").force_steady_state_error[5]) < 0.005


def test_force_feedforward_holds_the_force_with_a_smaller_share(metrics):
    table = metrics("scenario=one_leg", "reference=force_feedforward")
    assert abs(table.force_steady_state_error[5]) < 0.005
    assert table.feedforward_share[5] < metrics("scenario=one_leg", "reference=aware").feedforward_share[5]


def test_on_a_smooth_path_exact_inverse_dynamics_is_below_cmac_in_every_cycle(metrics):
    smooth = ("scenario=one_leg", "gait.vertical=two_cubics", "reference=aware")
    exact, learned = metrics(*smooth, "feedforward=inverse_dynamics"), metrics(*smooth)
    assert (exact.transfer_rmse_x < 1e-3).all()
    assert (exact.transfer_rmse_y < 3e-3).all()
    assert (exact.force_steady_state_error.abs() < 1e-3).all()
    assert (exact.transfer_rmse_x < learned.transfer_rmse_x).all()
    assert (exact.transfer_rmse_y < learned.transfer_rmse_y).all()


def test_on_the_jumping_path_cmac_overtakes_exact_inverse_dynamics(metrics):
    exact = metrics("scenario=one_leg", "feedforward=inverse_dynamics").loc[5]
    learned = metrics("scenario=one_leg").loc[5]
    assert learned.transfer_rmse_x < exact.transfer_rmse_x
    assert learned.transfer_rmse_y < exact.transfer_rmse_y


METHODS = {
    "stiffness": ("scenario=force_step", "force_control=stiffness"),
    "damping": ("scenario=force_step", "force_control=damping"),
    "combined": ("scenario=force_step", "force_control=combined"),
    "explicit": ("scenario=force_step", "force_control=explicit", "machine.mass=1.0"),
}


@pytest.mark.parametrize("method", METHODS)
def test_force_step_settles_at_the_desired_force(metrics, method):
    row = metrics(*METHODS[method]).loc[1]
    assert row.force_settled == pytest.approx(1.0, abs=1e-3)
    assert row.force_ripple < 1e-3


def test_combined_overshoots_least_of_those_that_settle_within_a_second(metrics):
    rows = {method: metrics(*overrides).loc[1] for method, overrides in METHODS.items()}
    quick = {method: row.force_overshoot for method, row in rows.items() if row.force_settling_time < 1.0}
    assert set(quick) == {"stiffness", "combined", "explicit"}
    assert min(quick, key=quick.get) == "combined"


def test_explicit_limit_cycles_with_half_a_kilogram(metrics):
    row = metrics("scenario=force_step", "force_control=explicit").loc[1]
    assert row.force_ripple > 0.5
    assert pd.isna(row.force_settling_time)


@pytest.mark.parametrize(("method", "factor"), [("stiffness", 420 / 320), ("combined", 430 / 330), ("damping", 1.0)])
def test_ground_twice_as_stiff_as_assumed(metrics, method, factor):
    overrides = (
        "scenario=force_step",
        f"force_control={method}",
        "terrain.stiffness=20",
        "terrain.assumed_stiffness=10",
    )
    assert metrics(*overrides).loc[1].force_settled == pytest.approx(factor, abs=1e-3)
