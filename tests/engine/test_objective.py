"""``optimize=NAME``: the number that a job of a sweep returns to a sweeper that searches."""

import math

import numpy as np
from support.made_studies import made_run

from cmacexp.engine.objective import find_direction, read_objective


def test_a_metric_is_searched_in_the_direction_that_is_better():
    directions = {
        "feedforward_share": "maximize",
        "transfer_rmse_y": "minimize",
        "force_steady_state_error": "minimize",
    }
    assert {name: find_direction(name, None, searches=True) for name in directions} == directions
    assert find_direction("force_settled", "maximize", searches=True) == "maximize", "neither is better"
    assert find_direction("force_settled", None, searches=False) is None


def test_the_objective_is_the_last_value_and_counts_a_fall_as_the_worst(tmp_path):
    for name, value in {"force_rmse": 0.5, "force_steady_state_error": -0.2, "height_mean": 0.5}.items():
        metrics = {name: np.array([9.0, value])}
        done, fell = (made_run(tmp_path, status, metrics) for status in ("completed", "fell"))
        assert read_objective(name, done, None) == abs(value)
        assert read_objective(name, fell, "minimize") == read_objective(name, fell, None) == math.inf
        assert read_objective(name, fell, "maximize") == -math.inf
        assert read_objective("tilt_max", done, "minimize") == math.inf, "it has no such metric"
