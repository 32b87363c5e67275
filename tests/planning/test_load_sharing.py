"""Load sharing: forces balance weight and moments and are the least that do; dynamic ones move all masses."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_mechanism

from cmacexp.planning import Motion, make_plan
from cmacexp.planning.body import dynamic_load
from cmacexp.planning.load_sharing import remove_pull, share_load
from cmacexp.planning.plan import LoadEstimate, adapt_plan

WEIGHT = 40.0
TINY = 1e-9
"""What counts as balanced, N and N m."""
WALK = "scenario=quadruped"
DYNAMIC = (WALK, "machine.weight=null", "force_control.load_sharing=dynamic", "gait.vertical=two_cubics")
TOUCH_DOWN = (0, 300, 480, 180)
"""Samples of the cycle, by leg."""


@pytest.fixture
def planned(make_config, plan_of):
    """Plan of a quadruped, its feet (N, L, 2) relative to the centre of gravity, and its mechanism."""

    def plan(*overrides):
        plan, mechanism = plan_of(*overrides), make_mechanism(make_config(*overrides).machine)
        return plan, mechanism.hips + plan.desired.position[..., :1] * [1.0, 0.0], mechanism

    return plan


def out_of_balance(force, feet, weight=WEIGHT):
    """Largest of weight (N) and moments (N m) that the forces (..., L) leave over, sample by sample."""
    moments = (force[..., None] * feet).sum(axis=-2)
    return np.max(np.abs([force.sum(axis=-1) - weight, moments[..., 0], moments[..., 1]]), axis=0)


def share(feet, willing=None):
    """Forces of one instant."""
    willing = np.ones(len(feet)) if willing is None else np.asarray(willing)
    down = np.ones((1, len(feet)), dtype=bool)
    return share_load(WEIGHT, np.asarray(feet)[None], down, willing[None])[0]


# The plan under a static load


@pytest.mark.parametrize(
    "gait",
    [
        ("gait.duty_factor=0.75",),
        ("gait.duty_factor=0.95", "gait.stroke=0.2", "machine.weight=49"),
        ("machine.legs.left_front.hip_x=0.25", "machine.legs.right_rear.hip_y=-0.2"),
        ("gait.duty_factor=0.9", "gait.touch_down=[0.1, 0.6, 0.0, 0.5]", "gait.load_ramp=0.15"),
    ],
    ids=" ".join,
)
def test_planned_forces_balance_weight_and_moments_and_press_only_and_in_support_only(planned, gait):
    plan, feet, mechanism = planned(WALK, *gait)
    assert out_of_balance(plan.force_desired, feet, mechanism.weight).max() < TINY
    assert plan.force_desired.min() >= -TINY
    assert not plan.force_desired[~plan.support].any()


def test_the_paper_s_walk_asks_of_each_foot_what_can_be_computed_by_hand(planned):
    plan = planned(WALK)[0]
    force, lift_off_3, lift_off_4 = plan.force_desired, 360, 60
    least = [force[lift_off_3, 1], force[lift_off_4, 0], force[plan.support].min()]
    assert_allclose(least, 10.0 / 7.0)
    for lifted, diagonal in ((0, 2), (1, 3), (2, 0), (3, 1)):
        assert_allclose(force[~plan.support[:, lifted], diagonal], WEIGHT / 2.0)


@pytest.mark.parametrize("ramp", [0.05, 0.15])
def test_a_ramp_takes_a_foot_from_nothing_to_all_where_the_others_balance_without_it(planned, ramp):
    """A rear foot lands as the front foot of its side lifts: three feet are down, whose forces leave no choice."""
    ramped, stepped = (planned(WALK, f"gait.load_ramp={each}")[0].force_desired for each in (ramp, 0.0))
    assert_array_equal(stepped, planned(WALK)[0].force_desired)
    changed = np.zeros(600, dtype=bool)
    for leg in (0, 1):
        landing = TOUCH_DOWN[leg] + np.arange(round(ramp / 0.005) + 1)
        assert ramped[landing[0], leg] == 0.0
        assert (np.diff(ramped[landing, leg]) > 0.0).all()
        changed[landing[:-1]] = True
    assert_allclose(ramped[~changed], stepped[~changed], atol=1e-6)


# The least squares


@st.composite
def stances(draw, count):
    """Feet (count, 2) with the centre of gravity inside their polygon: some positive forces balance on them."""
    coordinates = st.integers(-100, 100)
    feet = np.array(draw(st.lists(st.tuples(coordinates, coordinates), min_size=count, max_size=count))) / 100.0
    rows = np.column_stack([np.ones(count), feet])
    assume(np.linalg.svd(rows, compute_uv=False)[-1] > 0.1)  # neither on one line nor on one spot
    parts = np.array(draw(st.lists(st.integers(1, 20), min_size=count, max_size=count)))
    return feet - parts / parts.sum() @ feet


willing_feet = st.lists(st.floats(0.1, 1.0), min_size=4, max_size=4)
EVEN, AS_NUMBERED = [1.0] * 4, [0, 1, 2, 3]
TWO_WOULD_PULL = np.array([(-0.485, 0.493), (0.118, -0.099), (-0.098, 0.848), (-0.971, 0.776)])
TWO_OTHERS = np.array([(-0.773, -0.029), (0.070, 0.031), (-0.938, -0.726), (-0.455, -0.217)])


@given(stances(3), willing_feet)
def test_three_feet_carry_the_one_solution_whether_they_are_willing_or_not(feet, willing):
    expected = np.linalg.solve([np.ones(3), *feet.T], [WEIGHT, 0.0, 0.0])
    assert_allclose(share(feet, willing[:3]), expected, atol=1e-7)


@given(stances(4), willing_feet, st.permutations(range(4)))
@example(TWO_WOULD_PULL, EVEN, AS_NUMBERED)
@example(TWO_OTHERS, EVEN, AS_NUMBERED)
def test_four_feet_carry_the_least_squares_that_balance_however_they_are_numbered(feet, willing, order):
    """Least F^2 / willing: a linear function of the place gives it, where not below zero (Karush-Kuhn-Tucker)."""
    force, rows, willing = share(feet, willing), np.column_stack([np.ones(4), feet]), np.array(willing)
    assert force.min() >= -TINY
    assert out_of_balance(force, feet) < TINY
    presses = force > TINY
    assume(np.linalg.svd(rows[presses], compute_uv=False)[2:].min(initial=0.0) > 1e-3 or presses.all())
    linear = np.linalg.lstsq(rows[presses], (force / willing)[presses])[0]
    assert_allclose(willing * np.maximum(rows @ linear, 0.0), force, atol=1e-6)
    assert_allclose(share(feet[order], willing[order]), force[order], atol=1e-8)


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


def test_a_foot_that_would_pull_is_asked_for_nothing_and_the_sum_stays():
    forces = np.array([[20.0, 10.0, -5.0, 15.0], [10.0, 10.0, 10.0, 10.0]])
    assert_allclose(remove_pull(forces), [[20.0 * 8.0 / 9.0, 10.0 * 8.0 / 9.0, 0.0, 15.0 * 8.0 / 9.0], [10.0] * 4])


# A dynamic load


def find_momentum_force(mechanism, joints, body_mass, period):
    """Force (N,) and its moments (N, 2) about y and -x through the origin on the ground, by differences of momentum.

    Of a machine whose body stands still: moving at constant speed changes neither.
    """
    (l1, l2, m1, m2, *_), (hip_x, hip_y) = mechanism.legs.T, mechanism.hips.T
    thigh, shank = joints[..., 0], joints[..., 0] + joints[..., 1]
    knee = np.stack([hip_x + l1 * np.cos(thigh), hip_y + 0.0 * thigh, 0.5 - l1 * np.sin(thigh)], axis=2)
    foot = knee + np.stack([l2 * np.cos(shank), 0.0 * shank, -l2 * np.sin(shank)], axis=2)
    places = np.concatenate([0.0 * knee[:, :1] + [0.0, 0.0, 0.5], knee, foot], axis=1)
    acceleration = (np.roll(places, -1, axis=0) - 2.0 * places + np.roll(places, 1, axis=0)) / period**2
    inertia = np.r_[body_mass, m1, m2][:, None] * (acceleration + np.array([0.0, 0.0, 9.81]))
    moment = np.cross(places, inertia).sum(axis=1)
    return inertia[..., 2].sum(axis=1), np.stack([-moment[:, 1], moment[:, 0]], axis=1)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("body_mass", "overrides"), [(1.0, ("gait.load_ramp=0.12",)), (3.0, ("gait.duty_factor=0.85",))]
)
def test_dynamic_forces_give_all_masses_the_momentum_that_is_planned(planned, body_mass, overrides):
    """On hard ground: friction at the feet has no lever arm then, and the loads move no masses."""
    period = 0.001
    hard = ("terrain.stiffness=1e9", f"sampling_period={period}", f"machine.body_mass={body_mass}")
    plan, feet, mechanism = planned(*DYNAMIC, *hard, *overrides)
    force, moments = find_momentum_force(mechanism, plan.joints.position, body_mass, period)
    jumps = np.diff(plan.support, axis=0, prepend=plan.support[-1:]).any(axis=1)  # of an acceleration
    jumps |= (np.abs(plan.progress - 0.5) < 1e-9).any(axis=1)
    smooth = ~np.any([np.roll(jumps, shift) for shift in range(-2, 3)], axis=0)
    assert smooth.mean() > 0.95
    assert_allclose(plan.force_desired.sum(axis=1)[smooth], force[smooth], atol=1e-3)
    assert np.ptp(force[smooth]) > 5.0
    feasible = smooth & ((plan.force_desired > 0.0).sum(axis=1) >= 3)
    assert feasible.mean() > 0.8
    left_over = (plan.force_desired[..., None] * feet).sum(axis=1) - moments
    assert_allclose(left_over[feasible], 0.0, atol=1e-3)
    assert plan.force_desired.min() == 0.0
    assert not plan.force_desired[~plan.support].any()


def test_a_dynamic_load_on_soft_ground_depresses_it_and_is_the_weight_on_average(planned):
    masses = ("machine.leg.mass_1=0.3", "machine.leg.mass_2=0.1")
    plan, _, mechanism = planned(*DYNAMIC, *masses, "gait.load_ramp=0.12")
    assert mechanism.weight == pytest.approx(9.81 * (1.0 + 4 * 0.4))
    assert plan.load.force.mean() == pytest.approx(mechanism.weight, rel=2e-3)
    assert_allclose(plan.desired.position[plan.support, 1], 0.5 + plan.force_desired[plan.support] / 1e4, rtol=1e-12)
    landing = plan.support & (plan.progress == 0.0) & plan.support.all(axis=1)[:, None]
    assert landing.sum() == 2  # of the front feet; as a rear one lands another lifts
    assert_allclose(plan.force_desired[landing], 0.0, atol=1e-6)


def test_a_machine_at_rest_presses_with_its_weight_below_its_centre_of_mass(make_config):
    """Thighs level and forward, shanks down: by hand. Knees at 0.225 + 0.35 and -0.225 + 0.35 m, feet below them."""
    mechanism = make_mechanism(make_config(WALK).machine)
    desired, joints = (Motion(*np.zeros((3, 1, 4, 2))) for _ in range(2))
    desired.position[...], joints.position[..., 1] = [0.35, 0.35], np.pi / 2.0
    load = dynamic_load(mechanism, 1.0, desired, joints)
    assert_allclose(load.force, [49.05])
    assert_allclose(load.centre, [[4.0 * 0.35 / 5.0, 0.0]], atol=1e-12)


@pytest.fixture
def adapt(make_config):
    """The plan of a dynamic load, its mechanism, and how it adapts to what was met."""
    config = make_config(*DYNAMIC)
    mechanism = make_mechanism(config.machine)
    plan = make_plan(config, mechanism, False)
    return plan, mechanism, lambda *met: adapt_plan(config, mechanism, plan, LoadEstimate(*met))


@pytest.mark.parametrize(("weight", "x"), [(20.0, 0.0), (20.0, 0.03), (-5.0, 0.02)])
def test_an_adapted_plan_carries_the_weight_that_was_met_where_it_was_met(adapt, weight, x):
    """The measured centre is that of the load, forward of the body's own, over a cycle."""
    plan, mechanism, adapted_to = adapt
    adapted = adapted_to(weight, x, 0.0, 0.0, 0.0)
    force, feet = adapted.force_desired, mechanism.hips + adapted.desired.position[..., :1] * [1.0, 0.0]
    assert_allclose(force.sum(axis=1), plan.force_desired.sum(axis=1) + weight, rtol=1e-9)
    centre = (force[..., None] * feet).sum(axis=(0, 1)) / force.sum()
    assert_allclose(centre, plan.load.mean_centre + np.array([x, 0.0]), atol=5e-4)


def test_feet_of_an_adapted_plan_follow_the_slope_that_was_met(adapt):
    plan, mechanism, adapted_to = adapt
    level, sloped = (adapted_to(0.0, 0.0, 0.0, slope, 0.0) for slope in (0.0, 0.05))
    position, velocity, *_ = (b - a for a, b in zip(level.reference, sloped.reference, strict=True))
    feet = plan.desired.position[..., 0] + mechanism.hips[:, 0]
    assert_allclose(position[:, plan.support, 1], np.tile(-0.05 * feet[plan.support], (2, 1)), atol=1e-9)
    assert_allclose(velocity[:, plan.support, 1], -0.05 * level.reference.velocity[:, plan.support, 0], atol=1e-9)
