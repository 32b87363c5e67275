"""What studies measure, against mathematics by hand: equations, events, counts, and runs that failed."""

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.made_studies import made_row

from cmacexp.study import Results, at_most
from pipelines import sensors
from pipelines.assumptions import TAKEN, Conclusion, count_changes, ratio
from pipelines.common_worlds import TESTED, TUNED
from pipelines.feedforwards_measures import CMAC, ILC, MLP, RBF, cycles_to
from pipelines.feedforwards_worlds import EARLY, at_best_rate
from pipelines.force_methods import predicted_force
from pipelines.lead_design import nearest
from pipelines.one_leg_learning_trace import feedback_force, learned_error, reference_depth, weight_at_foot
from pipelines.quadruped_walking_events import Walk, contacts, four_feet
from pipelines.robots_runs import FEEDFORWARDS, FURTHER, LEARNERS, MODELS, ROBOTS
from pipelines.robots_runs import runs as runs_of_robots
from pipelines.when_learning_holds import CRITERIA, FINDINGS, LEG

INF = math.inf


# Statics of one leg


def config(method="combined", factor=1.0):
    links = {"length_1": 0.35, "length_2": 0.35, "mass_1": 0.5, "mass_2": 0.5, "knee": "back"}
    gains = {"method": method, "desired_force": 1.0, "force_gain": 100.0, "elasticity": 0.1, "admittance": 0.1}
    return {
        "controller": {"position_gain": 100.0, "velocity_gain": 5.0},
        "force_control": gains,
        "terrain": {"assumed_stiffness": 10.0, "stiffness": 10.0 * factor},
        "machine": {"leg": links},
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
    assert weight_at_foot(rows, config()) == pytest.approx(0.5 * 9.81 * motion[2] @ down)


@pytest.mark.parametrize(
    ("loops", "expected"),
    [("GOOD FAST", 0.05), ("PEAKED FAST UNSTABLE", 2.0), ("PEAKED", INF), ("UNSTABLE", INF)],
)
def test_the_nearest_bandwidth_is_that_of_a_stable_loop_whose_resonance_is_low(loops, expected):
    rows = {
        "GOOD": (1.05, 10.5, 10.0, True), "PEAKED": (1.20, 10.5, 10.0, True), "FAST": (1.05, 30.0, 10.0, True),
        "UNSTABLE": (1.05, 10.5, 10.0, False),
    }  # fmt: skip
    columns = ("resonance", "bandwidth", "open_bandwidth", "stable")
    table = pd.DataFrame([rows[name] for name in loops.split()], columns=columns)
    assert nearest(table) == pytest.approx([expected])


# The walk


class Leg(dict):
    """Columns of a leg, at its hip."""

    def __init__(self, support, hip, **columns):
        super().__init__(columns)
        self.support, self.hip = support, hip


def a_walk(change=lambda force: force) -> Walk:
    """Two cycles of a wave gait of 30 steps of 0.1 s, duty factor 0.8: 10 N in support as planned, then changed."""
    step = np.arange(30)
    support = np.stack([(step - touch_down) % 30 < 24 for touch_down in (0, 15, 24, 9)], axis=1)
    desired = np.where(support, 10.0, 0.0)
    two = [np.tile(each, (2, 1)).T for each in (support, desired, change(desired.copy()))]
    hips = ((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2))
    legs = [Leg(on, hip, force_desired=d, force=f) for on, d, f, hip in zip(*two, hips, strict=True)]
    walk = Walk(SimpleNamespace(legs=legs, time=0.1 * np.arange(60), cycle=np.arange(60) // 30 + 1))
    return walk


def with_force(rows, leg, value):
    def change(force):
        force[rows, leg - 1] = value
        return force

    return a_walk(change)


def test_contacts_are_those_of_the_forces():
    planned = contacts(a_walk(), 2)
    assert planned == pytest.approx({"duty_factor_off": 0.0, "wave_off": 0.0, "two_feet": 0.0}, abs=1e-12)
    early = contacts(with_force(slice(24, 30), 4, 0.0), 2)  # foot 4 also lets go while foot 1 is aloft
    assert (early["duty_factor_off"], early["two_feet"]) == pytest.approx((0.2, 0.2))
    late = contacts(with_force(slice(24, 27), 1, 10.0), 2)
    assert late["wave_off"] == pytest.approx(0.05)  # 1.5 of 30 steps


def test_load_between_the_diagonals_is_distinguished_from_other_errors():
    rocks = a_walk(lambda force: force + np.where((force > 0).all(axis=1)[:, None], [1.0, -1.0, -1.0, 1.0], 0.0))
    assert four_feet(rocks, 2) == pytest.approx({"four_feet": 1.0, "diagonal": 1.0})
    sinks = a_walk(lambda force: np.where(force > 0.0, force + 1.0, 0.0))
    assert four_feet(sinks, 2) == pytest.approx({"four_feet": 24 / (24 + 72), "diagonal": 0.0})  # by steps and feet


# Learning


def in_plane(*errors, asked=None, **settings):
    """A run with these errors of the foot, at 3 : 4 in x and y."""
    sides = {f"transfer_rmse_{side}": part * np.array(errors) for side, part in (("x", 0.6), ("y", 0.8))}
    return made_row(sides, asked, **settings)


def test_learnt_is_the_first_cycle_from_which_errors_stay_small():
    errors = np.array([[9.0, 2.0, 9.0, 2.0, 1.0], [1.0] * 5, [9.0] * 5, [9.0, 1.0, 1.0, INF, INF]])
    np.testing.assert_array_equal(cycles_to(errors, 2.0), [4.0, 1.0, INF, INF])


def test_a_rate_is_chosen_in_worlds_that_it_is_not_tested_in():
    """The rate 2 is best in the worlds of the tests, but 1 is in those it is chosen in."""
    found = {(CMAC, 1): (4.0, 9.0), (CMAC, 2): (5.0, 1.0), (RBF, 1): (3.0, 6.0), (MLP, 1): (3.0, 90.0),
             (ILC, 1): (3.0, 12.0)}  # fmt: skip
    rows = [
        in_plane(*[1e-3 * error] * 6, kind=kind, start="anew", cycles=6, world=worlds[0], seed=worlds[0],
                 **{"learning.rate": rate, "learning.start_cycle": 2})
        for (kind, rate), errors in found.items() for worlds, error in zip((TUNED, TESTED), errors, strict=True)
    ]  # fmt: skip
    assert at_best_rate(Results(rows), EARLY) == pytest.approx([9.0 / 6.0])


# What counts


def test_a_broken_sensor_is_rejected_some_samples_after_its_failure_and_a_sound_one_wrongly():
    def run(*dropped, kind="zero"):
        own = {"sampling_period": 0.005, "sensors": {"force": {"fault": {"kind": kind, "legs": [2], "start": 1.0}}}}
        manifest = {"dropped": [{"leg": leg, "step": step} for leg, step in dropped]}
        return SimpleNamespace(config=own, manifest=manifest)

    assert [sensors.rejected_after(run(each)) for each in ((2, 230), (1, 230))] == [30, INF]
    assert sensors.rejected_sound(run((2, 230), (3, 250))) == 1
    assert sensors.rejected_sound(run((2, 230), kind="none")) == 1


def test_a_conclusion_changes_if_it_differs_from_that_with_the_values_taken_and_the_same_seed():
    small = Conclusion("x error", ratio("transfer_rmse_x", None), at_most(0.1))
    given = {TAKEN: (0.1, 0.3), "stroke": (0.1, 0.3), "lift 1": (0.3, 0.1), "lift 2": (0.3, 0.3)}
    rows = [
        made_row({"transfer_rmse_x": [2.0, 1.0, last]}, variant=variant, seed=seed, cycles=3)
        for variant, lasts in given.items()
        for seed, last in enumerate(lasts)
    ]
    np.testing.assert_array_equal(count_changes(small, Results(rows)), [2, 1])


@pytest.mark.ci
def test_no_robot_is_tuned(monkeypatch):
    """All walk with the same overrides but for the name of the machine."""
    monkeypatch.setattr("pipelines.robots_runs.find_model", lambda name, path: path)
    named = [text for robots in (ROBOTS, FURTHER) for texts in robots.values() for text in texts]
    assert all(text.startswith("machine=") for text in named)
    found = [request for request in runs_of_robots(quick=False) if request.labels["part"] == FEEDFORWARDS]
    for kind in MODELS | LEARNERS:
        own = [set(request.overrides) for request in found if request.labels["kind"] == kind]
        assert len(own) == len(ROBOTS)
        assert all(len(texts - set.intersection(*own)) == 1 for texts in own)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_a_confusion_matrix_counts_every_setting_that_learns_once(criterion):
    """What a predictor says (1: bounded, 0: undecided, -1: grows), and whether it was so; NaN: no learning."""
    outcomes = [(1.0, 1.0)] * 8 + [(-1.0, 0.0)] * 6 + [(1.0, 0.0)] + [(-1.0, 1.0)] * 2
    outcomes += [(0.0, 1.0)] * 2 + [(np.nan, 0.0), (1.0, np.nan)]
    rows = [
        made_row({}, measures={"learns": float(np.isfinite(held)), "held": held, **dict.fromkeys(CRITERIA, said)},
                 machine=LEG)
        for said, held in outcomes
    ]  # fmt: skip
    matrix = FINDINGS[f"matrix_{criterion}"].judge(Results(rows)).measured
    counts = [(round(20 * each.interval.value), each.interval.count) for each in matrix]
    assert counts == [(8, 20), (1, 20), (6, 20), (2, 20), (3, 20)]
    (right,) = FINDINGS[criterion].judge(Results(rows)).measured
    assert (right.interval.value, right.interval.count) == (14 / 17, 17)
