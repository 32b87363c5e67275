"""What studies measure, against mathematics by hand."""

import math

import numpy as np
import pandas as pd
import pytest

from cmacexp.study import Results
from pipelines.force_methods import predicted_force
from pipelines.lead_design import find_nearest
from pipelines.one_leg_learning_trace import (
    feedback_force,
    learned_error,
    read_signals,
    reference_depth,
    weight_at_foot,
)


def config(method="combined", factor=1.0):
    links = {"length_1": 0.35, "length_2": 0.35, "mass_1": 0.5, "mass_2": 0.5, "knee": "back"}
    gains = {"method": method, "desired_force": 1.0, "force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1}
    return {
        "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
        "force_control": gains,
        "terrain": {"assumed_stiffness": 10.0, "stiffness": 10.0 * factor},
        "machine": {"leg": links},
        "plant": {},
    }


def test_forces_at_rest_are_those_of_eq_8_and_13():
    """Eq. 8: F = K_a K_n D_r / (K_n + K_a + K_a K_n P_fn), with D_r made for 10 N/m."""
    by_hand = 100 * 20 * (1 / 10 + 1 / 100 + 0.1) / (20 + 100 + 100 * 20 * 0.1)
    assert predicted_force(config("stiffness", 2.0)) == pytest.approx(by_hand)
    assert predicted_force(config()) == predicted_force(config("explicit", 4.0)) == 1.0
    assert reference_depth(config()) == pytest.approx(0.215)
    assert learned_error(config()) == pytest.approx(0.215 / 0.205 - 1.0)
    assert feedback_force(config(), 7.4) == pytest.approx((21.5 + 7.4) / 21.5)


def test_weight_at_the_foot_is_that_of_virtual_work():
    """A foot that moves by dy under the weight of knee and foot, with x held, does the work of both weights."""
    angles = np.array([2.2, -1.2])

    def place(q):
        """Foot, and height of both masses together."""
        knee = 0.35 * np.array([np.cos(q[0]), np.sin(q[0])])
        foot = knee + 0.35 * np.array([np.cos(q.sum()), np.sin(q.sum())])
        return np.array([*foot, knee[1] + foot[1]])

    motion = np.array([(place(angles + step) - place(angles - step)) / 2e-6 for step in 1e-6 * np.eye(2)]).T
    down = np.linalg.solve(motion[:2], [0.0, 1.0])  # joint rates that move the foot straight down
    rows = pd.DataFrame({"phase": ["support"] * 40, "progress": 0.6, "q1": angles[0], "q2": angles[1]})
    assert weight_at_foot(read_signals(rows), config()) == pytest.approx(0.5 * 9.81 * motion[2] @ down)


@pytest.mark.parametrize(
    ("loops", "expected"),
    [("GOOD FAST", 0.05), ("PEAKED FAST UNSTABLE", 2.0), ("PEAKED", math.inf), ("UNSTABLE", math.inf)],
)
def test_the_nearest_bandwidth_is_that_of_a_stable_loop_whose_resonance_is_low(loops, expected):
    rows = {
        "GOOD": (0.05, 0.05), "PEAKED": (0.20, 0.05), "FAST": (0.05, 2.0), "UNSTABLE": (math.inf, math.inf),
    }  # fmt: skip
    table = pd.DataFrame([rows[name] for name in loops.split()], columns=("excess", "distance"))
    results = Results([], {"lead_design": table.assign(gain=1.0)})
    assert find_nearest(results, only_one=True) == find_nearest(results) == pytest.approx([expected])
