"""``optimize=NAME``: the number that a job of a sweep returns to a sweeper that searches."""

import math

import numpy as np
import pytest
from support.doors import BadInput

from cmacexp.experiment.objective import describe_best, find_direction, read_objective
from cmacexp.report.run_summary import RunSummary


def test_a_metric_is_searched_in_the_direction_that_is_better():
    for name, direction in {
        "feedforward_share": "maximize",
        "transfer_rmse_y": "minimize",
        "force_steady_state_error": "minimize",
    }.items():
        assert find_direction(name, None, searches=True) == direction
        other = ({"maximize", "minimize"} - {direction}).pop()
        with pytest.raises(BadInput, match="direction"):
            find_direction(name, other, searches=True)
    assert find_direction("force_settled", "maximize", searches=True) == "maximize", "neither is better"
    for name, asked in {"force_settled": "direction", None: "optimize"}.items():
        with pytest.raises(BadInput, match=asked):
            find_direction(name, None, searches=True)
        assert find_direction(name, None, searches=False) is None


def test_the_objective_is_the_last_value_and_counts_a_fall_as_the_worst(tmp_path):
    values = {"force_rmse": 0.5, "force_steady_state_error": -0.2, "feedforward_share": 0.7, "height_mean": 0.5}
    metrics = {name: np.array([9.0, value]) for name, value in values.items()}
    done, fell = (RunSummary(tmp_path, status, "", cycles=2, metrics=metrics) for status in ("completed", "fell"))
    for name, value in values.items():
        assert read_objective(name, done, None) == abs(value)
        assert read_objective(name, fell, "minimize") == read_objective(name, fell, None) == math.inf
        assert read_objective(name, fell, "maximize") == -math.inf
    assert read_objective("tilt_max", done, "minimize") == math.inf, "it has no such metric"
    assert describe_best("force_rmse", "minimize", [fell], []).startswith("none")
