"""Measures of force control methods, by hand."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from cmacexp.study.interval import UNPAIRED
from pipelines.force_methods import (
    apparent_stiffness,
    end_speed,
    over_best_other,
    predicted_force,
    rest_error,
    settled_force,
)


def config(method: str, factor: float):
    return {
        "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
        "force_control": {"method": method, "force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1},
        "terrain": {"assumed_stiffness": 10.0, "stiffness": 10.0 * factor},
    }


def test_predicted_force_by_hand():
    """Eq. 8: F = K_a K_n D_r / (K_n + K_a + K_a K_n P_fn), with D_r made for 10 N/m."""
    depression = 1 / 10 + 1 / 100 + 0.1
    by_hand = 100 * 20 * depression / (20 + 100 + 100 * 20 * 0.1)
    assert predicted_force(config("stiffness", 2.0)) == pytest.approx(by_hand)
    assert predicted_force(config("combined", 1.0)) == 1.0
    assert predicted_force(config("damping", 2.0)) == predicted_force(config("explicit", 4.0)) == 1.0


def test_apparent_stiffness_by_hand():
    def at_rest(force, depth):
        return pd.DataFrame({"force": [0.0, force], "y": [0.45, depth]})

    assert apparent_stiffness(at_rest(1.0, 0.6), at_rest(1.09, 0.591)) == pytest.approx(10.0)


def a_run(settled, ripple, status="completed"):
    return SimpleNamespace(
        status=status,
        config={"force_control": {"desired_force": 2.0}},
        metrics=pd.DataFrame({"force_settled": [settled], "force_ripple": [ripple]}),
        trace=pd.DataFrame({"vy": [1.0, -0.25]}),
    )


def test_a_run_is_judged_by_its_second_half_and_at_its_end():
    assert settled_force(a_run(2.6, 0.8)) == pytest.approx(1.3)
    assert rest_error(a_run(2.6, 0.8)) == pytest.approx(0.5)  # 0.3 off, 0.4 of ripple
    assert end_speed(a_run(2.0, 0.0)) == 0.25


def test_a_run_that_ended_before_is_infinitely_wrong():
    diverged = a_run(2.0, 0.0, "diverged")
    assert settled_force(diverged) == rest_error(diverged) == end_speed(diverged) == np.inf


class Made:
    """Results with a value and an error at rest for each method, the same from two heights."""

    def __init__(self, **methods):
        self.values, self.errors = zip(*methods.values(), strict=True)
        self.rows = [SimpleNamespace(settings={"method": name}) for name in methods]

    def by(self, key):
        return {0.05: self, 0.1: self}

    def at(self, cycle, metric):
        return np.array(self.values, dtype=float)

    def measure(self, name):
        return np.array(self.errors, dtype=float)


def test_combined_is_compared_with_the_best_of_those_that_come_to_rest():
    others = {"stiffness": (4.0, 0.0), "damping": (8.0, 0.0), "explicit": (1.0, 0.9)}
    assert over_best_other(Made(**others, combined=(2.0, 0.0)), "force_itae").tolist() == 2 * [0.5]
    assert over_best_other(Made(**others, combined=(2.0, 0.5)), "force_itae").tolist() == 2 * [np.inf]
    assert over_best_other(Made(stiffness=(4.0, 0.9), combined=(2.0, 0.0)), "force_itae").tolist() == 2 * [UNPAIRED]
