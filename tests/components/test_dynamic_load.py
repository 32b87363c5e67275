"""Laws of dynamic load sharing: desired forces are what gravity and the momentum of all masses ask for."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmacexp.planning.body_load import dynamic_load
from cmacexp.planning.load_sharing import remove_pull
from cmacexp.planning.machine import make_mechanism

SMOOTH = ("gait.vertical=two_cubics",)
DYNAMIC = ("scenario=quadruped", "machine.weight=null", "force_control.load_sharing=dynamic", *SMOOTH)
RAMP = ("gait.load_ramp=0.12",)


@pytest.fixture(scope="module")
def planned(make_config, plan_of):
    """Plan and mechanism of a quadruped."""

    def plan(*overrides):
        overrides = (*DYNAMIC, *overrides)
        return plan_of(*overrides), make_mechanism(make_config(*overrides).machine)

    return plan


def masses(mechanism, joints, body_mass):
    """Mass (M,), kg, and position (N, M, 3), m, of every point mass: forward, left and above the ground."""
    weights, places = [body_mass], [np.tile([0.0, 0.0, mechanism.hip_height], (len(joints), 1))]
    for (l1, l2, m1, m2, _), (x, y), q in zip(mechanism.legs, mechanism.hips, np.moveaxis(joints, 1, 0), strict=True):
        knee = np.stack([x + l1 * np.cos(q[:, 0]), np.full(len(q), y), 0.5 - l1 * np.sin(q[:, 0])], axis=1)
        shank = np.stack([np.cos(q[:, 0] + q[:, 1]), np.zeros(len(q)), -np.sin(q[:, 0] + q[:, 1])], axis=1)
        weights += [m1, m2]
        places += [knee, knee + l2 * shank]
    return np.array(weights), np.stack(places, axis=1)


def smooth_samples(plan, reach):
    """Samples that no jump of an acceleration is near to: change of phase, mid transfer."""
    events = np.diff(plan.support, axis=0, prepend=plan.support[-1:]).any(axis=1)
    events |= (np.abs(plan.progress - 0.5) < 1e-9).any(axis=1)
    near = np.convolve(np.r_[events[-reach:], events, events[:reach]], np.ones(2 * reach + 1), mode="valid") > 0
    return ~near


def of_momentum(weights, places, period):
    """Force (N,) and its moments (N, 2) about y and -x through the origin on the ground, by differences of momentum.

    Of a machine whose body stands still: moving at constant speed changes neither.
    """
    acceleration = (np.roll(places, -1, axis=0) - 2.0 * places + np.roll(places, 1, axis=0)) / period**2
    inertia = weights[:, None] * (acceleration + np.array([0.0, 0.0, 9.81]))
    moment = np.cross(places, inertia).sum(axis=1)
    return inertia[..., 2].sum(axis=1), np.stack([-moment[:, 1], moment[:, 0]], axis=1)


@pytest.mark.parametrize("overrides", [(), RAMP, ("machine.body_mass=3", "gait.duty_factor=0.85")], ids=" ".join)
def test_forces_give_all_masses_the_momentum_that_is_planned(planned, overrides):
    """On hard ground: friction at the feet has no lever arm then, and the loads move no masses."""
    period = 0.001
    plan, mechanism = planned(*overrides, f"sampling_period={period}", "terrain.stiffness=1e9")
    weights, places = masses(mechanism, plan.joints[..., :2], 3.0 if "machine.body_mass=3" in overrides else 1.0)
    force, moments = of_momentum(weights, places, period)
    feet = mechanism.hips + plan.desired[..., [0]] * [1.0, 0.0]
    fine = smooth_samples(plan, 2)
    assert fine.mean() > 0.95
    assert_allclose(plan.force_desired.sum(axis=1)[fine], force[fine], atol=1e-3)
    feasible = fine & ((plan.force_desired > 0.0).sum(axis=1) >= 3)
    left_over = (plan.force_desired[..., None] * feet).sum(axis=1) - moments
    assert_allclose(left_over[feasible], 0.0, atol=1e-3)
    assert feasible.mean() > 0.8
    assert np.ptp(force[fine]) > 5.0


def test_a_machine_at_rest_presses_with_its_weight_below_its_centre_of_mass(make_config):
    """Thighs level and forward, shanks down: by hand. Knees at 0.225 + 0.35 and -0.225 + 0.35 m, feet below them."""
    mechanism = make_mechanism(make_config("scenario=quadruped").machine)
    desired, joints = np.zeros((1, 4, 6)), np.zeros((1, 4, 6))
    desired[..., :2], joints[..., 1] = [0.35, 0.35], np.pi / 2.0
    load = dynamic_load(mechanism, 1.0, desired, joints)
    assert_allclose(load.force, [49.05])
    assert_allclose(load.centre, [[4.0 * 0.35 / 5.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("overrides", [(), RAMP, ("gait.duty_factor=0.85",)], ids=" ".join)
def test_feet_are_asked_to_press_only_and_in_support_only(planned, overrides):
    force, support = planned(*overrides)[0].force_desired, planned(*overrides)[0].support
    assert force.min() == 0.0
    assert not force[~support].any()


def test_a_foot_that_would_pull_is_asked_for_nothing_and_the_sum_stays():
    forces = np.array([[20.0, 10.0, -5.0, 15.0], [10.0, 10.0, 10.0, 10.0]])
    assert_allclose(remove_pull(forces), [[20.0 * 8.0 / 9.0, 10.0 * 8.0 / 9.0, 0.0, 15.0 * 8.0 / 9.0], [10.0] * 4])


def test_a_ramp_takes_a_foot_from_nothing_and_the_depression_follows_the_force(planned):
    plan, _ = planned(*RAMP)
    touch_down = plan.support & (plan.progress == 0.0)
    choice = plan.support.all(axis=1)
    assert (touch_down & choice[:, None]).sum() == 2  # the front feet; when a rear foot touches down another lifts
    assert_allclose(plan.force_desired[touch_down & choice[:, None]], 0.0, atol=1e-6)
    assert_allclose(plan.desired[plan.support, 1], 0.5 + plan.force_desired[plan.support] / 1e4, rtol=1e-12)


def test_without_a_weight_of_its_own_a_quadruped_weighs_what_its_masses_do(make_config):
    config = make_config("scenario=quadruped", "machine.weight=null", "machine.legs.left_rear.mass_2=0.75")
    assert make_mechanism(config.machine).weight == pytest.approx(9.81 * 5.25)
    assert make_mechanism(make_config("scenario=quadruped").machine).weight == 40.0
