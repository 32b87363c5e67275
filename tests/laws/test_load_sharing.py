"""Laws of load sharing: forces balance weight and moments, and are the least that do."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize

from cmacexp.planning.load_sharing import share_load
from cmacexp.planning.machine import make_mechanism

WEIGHT = 40.0
TINY = 1e-9
"""What counts as balanced, N and N m."""


@pytest.fixture
def planned(make_config, plan_of):
    """Plan of a quadruped, and its feet (N, L, 2) relative to the centre of gravity."""

    def plan(*overrides):
        overrides = ("scenario=quadruped", *overrides)
        mechanism, plan = make_mechanism(make_config(*overrides).machine), plan_of(*overrides)
        feet = np.broadcast_to(mechanism.hips, (*plan.support.shape, 2)).copy()
        feet[..., 0] += plan.desired[..., 0]
        return plan, feet

    return plan


def out_of_balance(force, feet, weight=WEIGHT):
    """Largest of weight (N) and moments (N m) that the forces (..., L) leave over, sample by sample."""
    moments = (force[..., None] * feet).sum(axis=-2)
    return np.max(np.abs([force.sum(axis=-1) - weight, moments[..., 0], moments[..., 1]]), axis=0)


def share(feet, willing=None, weight=WEIGHT):
    """Forces of one instant."""
    willing = np.ones(len(feet)) if willing is None else np.asarray(willing)
    down = np.ones((1, len(feet)), dtype=bool)
    return share_load(weight, np.asarray(feet)[None], down, willing[None])[0]


# The plan


GAITS = [
    ("gait.duty_factor=0.75",),
    (),
    ("gait.duty_factor=0.85",),
    ("gait.duty_factor=0.9", "gait.stroke=0.2"),
    ("gait.duty_factor=0.95", "machine.weight=49"),
    ("machine.legs.left_front.hip_x=0.25", "machine.legs.right_rear.hip_y=-0.2"),
    ("gait.duty_factor=0.9", "gait.touch_down=[0.1, 0.6, 0.0, 0.5]"),
    ("gait.load_ramp=0.05",),
    ("gait.duty_factor=0.9", "gait.load_ramp=0.15"),
]


@pytest.mark.parametrize("gait", GAITS, ids=" ".join)
def test_desired_forces_balance_weight_and_moments_at_every_step(planned, gait):
    plan, feet = planned(*gait)
    weight = 49.0 if "machine.weight=49" in gait else WEIGHT
    assert out_of_balance(plan.force_desired, feet, weight).max() < TINY


@pytest.mark.parametrize("gait", GAITS, ids=" ".join)
def test_feet_are_asked_to_press_only_and_in_support_only(planned, gait):
    plan, _ = planned(*gait)
    assert plan.force_desired.min() >= -TINY
    assert not plan.force_desired[~plan.support].any()


def test_at_lift_off_of_foot_3_foot_2_is_to_carry_10_sevenths_of_a_newton(planned):
    plan, _ = planned()
    lift_off_3, lift_off_4 = 360, 60
    assert_array_equal(plan.support[[359, 360], 2], [True, False])
    assert plan.force_desired[lift_off_3, 1] == pytest.approx(10.0 / 7.0, abs=TINY)
    assert plan.force_desired[lift_off_4, 0] == pytest.approx(10.0 / 7.0, abs=TINY)
    supporting = plan.force_desired[plan.support]
    assert supporting.min() == pytest.approx(10.0 / 7.0, abs=TINY)  # the least of the cycle


def test_the_diagonal_foot_carries_half_the_weight_while_another_is_lifted(planned):
    plan, _ = planned()
    for lifted, diagonal in ((0, 2), (1, 3), (2, 0), (3, 1)):
        same_side_or_end = plan.force_desired[~plan.support[:, lifted]]
        assert_allclose(same_side_or_end[:, diagonal], WEIGHT / 2.0)


# Against general solvers


@st.composite
def stances(draw, count):
    """Feet (count, 2) with the centre of gravity inside their polygon: some positive forces balance on them."""
    coordinates = st.integers(-100, 100)
    feet = np.array(draw(st.lists(st.tuples(coordinates, coordinates), min_size=count, max_size=count))) / 100.0
    rows = np.column_stack([np.ones(count), feet])
    assume(np.linalg.svd(rows, compute_uv=False)[-1] > 0.1)  # neither on one line nor on one spot
    parts = np.array(draw(st.lists(st.integers(1, 20), min_size=count, max_size=count)))
    return feet - parts / parts.sum() @ feet


def of_minimum_norm(feet):
    """Balancing forces of least sum F^2, pulling or not."""
    return np.linalg.lstsq([np.ones(len(feet)), *np.transpose(feet)], [WEIGHT, 0.0, 0.0])[0]


def least_squares_by_solver(feet, willing):
    """Forces of least sum F^2 / willing that balance and do not pull, by sequential quadratic programming."""
    rows = np.array([np.ones(len(feet)), *feet.T])
    wanted = np.array([1.0, 0.0, 0.0])
    found = minimize(
        lambda f: (f * f / willing).sum(),
        np.full(len(feet), 1.0 / len(feet)),
        jac=lambda f: 2.0 * f / willing,
        bounds=[(0.0, None)] * len(feet),
        constraints={"type": "eq", "fun": lambda f: rows @ f - wanted, "jac": lambda f: rows},
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    assert found.success
    return WEIGHT * found.x


willing_feet = st.lists(st.floats(0.1, 1.0), min_size=4, max_size=4)


@given(stances(3), willing_feet)
def test_three_feet_carry_the_one_solution_whether_they_are_willing_or_not(feet, willing):
    expected = np.linalg.solve([np.ones(3), *feet.T], [WEIGHT, 0.0, 0.0])
    assert_allclose(share(feet, willing[:3]), expected, atol=1e-7)
    assert share(feet).min() >= 0.0


@given(stances(4))
def test_four_feet_carry_the_solution_of_minimum_norm_where_none_would_pull(feet):
    expected = of_minimum_norm(feet)
    assume(expected.min() >= 0.0)
    assert_allclose(share(feet), expected, atol=1e-7)


@given(stances(4), willing_feet)
def test_four_feet_carry_what_a_general_solver_finds(feet, willing):
    assert_allclose(share(feet, willing), least_squares_by_solver(feet, np.array(willing)), atol=2e-3)


@given(stances(4))
def test_four_feet_balance_and_do_not_pull(feet):
    force = share(feet)
    assert force.min() >= -TINY
    assert out_of_balance(force, feet) < TINY


TWO_WOULD_PULL = [
    [(-0.485, 0.493), (0.118, -0.099), (-0.098, 0.848), (-0.971, 0.776)],
    [(-0.773, -0.029), (0.070, 0.031), (-0.938, -0.726), (-0.455, -0.217)],
]


@pytest.mark.parametrize("feet", TWO_WOULD_PULL, ids=["one", "other"])
def test_where_two_feet_would_pull_the_rest_still_balances(feet):
    feet = np.array(feet)
    assert (of_minimum_norm(feet) < 0.0).sum() == 2
    force = share(feet)
    assert out_of_balance(force, feet) < TINY
    assert force.min() >= -TINY
    assert_allclose(force, least_squares_by_solver(feet, np.ones(4)), atol=2e-3)


@given(stances(4), st.permutations(range(4)))
def test_the_numbers_of_the_feet_do_not_matter(feet, order):
    assert_allclose(share(feet[order]), share(feet)[order], atol=1e-8)


def test_a_foot_that_is_not_willing_carries_nothing():
    feet = [(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.35, -0.2)]
    force = share(feet, [1.0, 1.0, 0.0, 1.0])
    assert force[2] == 0.0
    assert_allclose(force[[0, 1, 3]], share([feet[0], feet[1], feet[3]]))


@pytest.mark.parametrize("feet", [[(0.3, 0.2), (-0.2, -0.2)], [(0.3, 0.2), (0.2, -0.2), (-0.3, 0.1)],
                                  [(0.3, 0.2), (0.2, -0.2), (-0.3, 0.2), (-0.35, -0.2)]], ids=len)  # fmt: skip
def test_forces_do_not_depend_on_the_unit_of_length(feet):
    """Nor does it, which of the conditions follow from the others, as on two feet."""
    for unit in (1e-4, 1e4):
        assert_allclose(share(unit * np.array(feet)), share(feet), rtol=1e-9)


# The ramp

RAMPS = [0.05, 0.1, 0.15]
FRONT, REAR = (0, 1), (2, 3)
TOUCH_DOWN = (0, 300, 480, 180)


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("leg", FRONT)
def test_a_front_foot_takes_its_load_from_nothing_to_all_over_the_ramp(planned, ramp, leg):
    samples = round(ramp / 0.005)
    ramped = planned(f"gait.load_ramp={ramp}")[0].force_desired
    stepped = planned()[0].force_desired
    landing = (TOUCH_DOWN[leg] + np.arange(samples + 1)) % 600
    assert ramped[landing[0], leg] == 0.0
    assert (np.diff(ramped[landing, leg]) > 0.0).all()
    assert_allclose(ramped[landing[-1]], stepped[landing[-1]])


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("leg", REAR)
def test_a_rear_foot_without_which_nothing_balances_takes_its_load_at_once(planned, ramp, leg):
    """It lands as the front foot of its side lifts: three feet are down, whose forces leave no choice."""
    ramped = planned(f"gait.load_ramp={ramp}")[0].force_desired
    stepped = planned()[0].force_desired
    landing = TOUCH_DOWN[leg] + np.arange(60)
    assert_allclose(ramped[landing], stepped[landing], atol=1e-6)


def test_without_a_ramp_nothing_changes_and_after_it_all_is_as_without(planned):
    plain = planned()[0].force_desired
    assert_array_equal(planned("gait.load_ramp=0.0")[0].force_desired, plain)
    ramped = planned("gait.load_ramp=0.1")[0].force_desired
    after = np.ones(600, dtype=bool)
    for begin in TOUCH_DOWN:
        after[(begin + np.arange(20)) % 600] = False
    assert_allclose(ramped[after], plain[after], atol=TINY)
