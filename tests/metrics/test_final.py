"""The final value of a metric: a median over the last cycles, of any machine."""

import numpy as np

from cmacexp.metrics.registry import TRANSFER, compute_final, find_history


def test_the_final_value_is_the_median_of_the_last_cycles_or_of_all_if_there_are_fewer():
    values = np.array([9.0, 1.0, 2.0, 6.0])
    assert (compute_final(values), compute_final(values, 3), compute_final(values, 1)) == (4.0, 2.0, 6.0)


def test_the_transfer_error_is_the_column_of_a_robot_and_the_distance_in_the_plane_of_others():
    planar = {"transfer_rmse_x": np.array([3.0]), "transfer_rmse_y": np.array([4.0])}
    assert find_history(planar, TRANSFER) == [5.0]
    assert find_history({**planar, TRANSFER: np.array([6.0])}, TRANSFER) == [6.0]
    assert find_history({}, TRANSFER).size == find_history({}, "force_rmse").size == 0
