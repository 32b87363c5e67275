"""How metrics appear in tables: which are shown, in which unit, of a long table which rows."""

from types import SimpleNamespace

import numpy as np
import pytest

from cmacexp.metrics.leg import FORCE
from cmacexp.metrics.registry import (
    ALL_METRICS,
    END_ROWS,
    MAIN,
    MIDDLE_ROWS,
    MOST_ROWS,
    SHOWN,
    find_numeric,
    make_rows,
    shorten,
)

FACTORS = {("m", "mm"): 1e3, ("rad", "mrad"): 1e3, ("", "%"): 1e2}
"""From the unit of the files to the one that is shown, where they differ."""
MAIN_METRICS = """
    transfer_rmse_x transfer_rmse_y transfer_rmse_z transfer_rmse joint_rmse force_rmse force_rmse_three_feet
    force_settled force_steady_state_error force_overshoot force_settling_time force_itae feedforward_share
    height_mean tilt_max true_stability_margin_min
"""
OF_ONE_LEG = {"force_settled", "force_steady_state_error", "force_overshoot", "force_settling_time", "force_itae"}


def test_metrics_are_shown_in_their_units_by_the_factor_between_them():
    for name, shown in SHOWN.items():
        assert shown.factor == FACTORS.get((ALL_METRICS[name].unit, shown.unit), 1.0), name
    assert list(MAIN) == MAIN_METRICS.split()
    assert {name for name, shown in SHOWN.items() if not shown.over_legs} == OF_ONE_LEG <= FORCE.keys()


@pytest.mark.parametrize("more", [0, 1, 40, 977])
def test_a_long_table_shows_its_ends_and_some_rows_evenly_between(more):
    rows = list(range(MOST_ROWS + more))
    shown = shorten(rows)
    if not more:
        assert shown == rows
        return
    assert (shown[:END_ROWS], shown[-END_ROWS:]) == (rows[:END_ROWS], rows[-END_ROWS:])
    gaps = {
        after - before
        for before, after in zip(shown[END_ROWS - 1 :], shown[END_ROWS : END_ROWS + MIDDLE_ROWS + 1], strict=False)
    }
    assert max(gaps) - min(gaps) <= 1


def test_a_column_is_of_numbers_if_all_its_cells_are():
    assert find_numeric([["1", "8", "8", "none"], ["2.5e-3 N", "-", "on", "none"]]) == {0, 1}
    with pytest.raises(ValueError, match="shorter"):
        find_numeric([["1", "2"], ["1"]])


def test_a_table_has_the_metrics_of_legs_in_space_if_one_run_is_of_a_robot():
    def run(**pooled):
        arrays = {name: np.array([value]) for name, value in pooled.items()}
        outcome = SimpleNamespace(status="completed", cause="")
        return SimpleNamespace(
            settings={}, outcome=outcome, cycles_done=1, pooled=arrays, final=lambda name: pooled.get(name, np.nan)
        )

    planar, robot = run(transfer_rmse_x=0.002), run(transfer_rmse_x=0.004, transfer_rmse=0.005)
    assert "best_transfer_rmse" not in make_rows([planar], [])[0]
    rows = make_rows([planar, robot], [])
    np.testing.assert_equal([row["final_transfer_rmse"] for row in rows], [np.nan, 0.005])
    np.testing.assert_equal([row["best_transfer_rmse"] for row in rows], [np.nan, 0.005])
