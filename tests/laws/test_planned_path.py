"""Laws of the planned motion of a foot, whatever its gait and load."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.errors import BadInput
from cmacexp.planning.body_load import dynamic_load
from cmacexp.planning.columns import AX, AY, FORCE_DESIRED, VX, VY, X, Y
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.motion import check_apex, make_ramp

PERIOD = 0.005
GAITS = [
    ("scenario=one_leg",),
    ("scenario=one_leg", "gait.load_ramp=0.1", "gait.vertical=two_cubics"),
    ("scenario=quadruped",),
    ("scenario=quadruped", "gait.load_ramp=0.06"),
    ("scenario=quadruped", "gait.vertical=two_cubics", "machine.legs.left_front.length_1=0.4"),
]
gaits = pytest.mark.parametrize("gait", GAITS, ids=lambda gait: " ".join(gait[1:]) or gait[0])


def legs_of(plan):
    """Support and motion of each leg over a cycle that begins with its touch-down."""
    for leg in range(plan.support.shape[1]):
        support = plan.support[:, leg]
        first = int(np.flatnonzero(support & ~np.roll(support, 1))[0])
        yield np.roll(support, -first), np.roll(plan.desired[:, leg], -first, axis=0)


@gaits
def test_in_support_a_foot_moves_back_at_the_speed_of_the_body_and_presses_with_its_force(plan_of, make_config, gait):
    plan, config = plan_of(*gait), make_config(*gait)
    speed = config.gait.stroke / (plan.support[:, 0].sum() * PERIOD)
    for support, motion in legs_of(plan):
        assert_allclose(motion[support, VX], -speed)
        assert_allclose(np.diff(motion[support, X]), -speed * PERIOD)
        assert motion[0, X] == pytest.approx(config.gait.stroke / 2.0)
        assert_array_equal(motion[support][:, [AX, AY]], 0.0)
    depth = plan.desired[..., Y] - config.machine.hip_height
    assert_allclose((depth * config.assumed_stiffness)[plan.support], plan.force_desired[plan.support], atol=1e-9)


@gaits
def test_a_transfer_begins_where_support_ended_and_ends_where_the_next_begins(plan_of, make_config, gait):
    """In height to the sample, at both ends of the polynomial; in between it rises by the lift."""
    plan, config = plan_of(*gait), make_config(*gait)
    for support, motion in legs_of(plan):
        down, up = motion[support], motion[~support]
        samples, lift = len(up), config.gait.lift
        assert_allclose(up[0, Y], down[-1, Y], atol=1e-12)
        half = up[samples // 2, Y] if samples % 2 == 0 else up[samples // 2 : samples // 2 + 2, Y].mean()
        assert half == pytest.approx(down[-1, Y] - lift, abs=0.02 * lift)
        # The sample after the last one would be the first in support.
        s = np.arange(samples) / samples
        ends = [np.polynomial.Polynomial.fit(s[part], up[part, Y], 3)(end)
                for part, end in ((slice(0, 6), 0.0), (slice(-6, None), 1.0))]  # fmt: skip
        assert_allclose(ends, [down[-1, Y], down[0, Y]], atol=1e-7)


@gaits
def test_between_samples_of_a_transfer_velocity_is_what_the_acceleration_adds_up_to(plan_of, gait):
    for support, motion in legs_of(plan_of(*gait)):
        up = motion[~support]
        for place, rate in ((X, VX), (Y, VY), (VX, AX), (VY, AY)):
            middle = (up[1:, rate] + up[:-1, rate]) / 2.0
            curved = np.abs(np.diff(up[:, rate])).max()  # or jumps, as at the apex of two cubics
            assert_allclose(np.diff(up[:, place]), PERIOD * middle, atol=PERIOD * curved)


@pytest.mark.parametrize("damping", [0, 20])
def test_with_the_rate_of_the_load_the_reference_moves_as_its_velocity_says(make_config, plan_of, damping):
    """Of a foot in support, K_n D + c dD/dt is the desired force; without that rate its velocity reference is 0."""
    walk = ("scenario=quadruped", "gait.load_ramp=0.12", "gait.unload_ramp=0.12", f"terrain.damping={damping}")
    config = make_config(*walk)
    method = ("force_control.elasticity=0", "force_control.admittance=0", "reference=force_feedforward")
    moving, still = (plan_of(*walk, *method, f"force_control.load_rate={on}") for on in ("true", "false"))
    for leg, support in enumerate(moving.support.T):
        motion, at_rest = moving.reference[1, :, leg], still.reference[1, :, leg]
        inner = support & np.roll(support, 1) & np.roll(support, -1)  # the ends jump, where the foot lifts
        change = np.roll(motion[:, Y], -1) - np.roll(motion[:, Y], 1)
        assert_allclose(change[inner], 2.0 * PERIOD * motion[inner, VY], atol=1e-12)
        depth, force = motion[inner, Y] - config.machine.hip_height, motion[inner, FORCE_DESIRED]
        balance = config.terrain.stiffness * depth + damping * motion[inner, VY] - force
        assert np.median(np.abs(balance)) < 1e-2 * np.abs(damping * motion[inner, VY]).max() + 1e-9
        assert np.abs(motion[inner, VY]).max() > 0.01
        assert_array_equal(at_rest[support, VY], 0.0)


@pytest.mark.parametrize("gap", [0.02, -0.02])
@pytest.mark.parametrize(("share", "refused"), [(1.249, True), (1.251, False)])
def test_one_cubic_between_different_depths_needs_room_whichever_is_deeper(make_config, gap, share, refused):
    """A lift of at least 5/4 of the gap."""
    config = make_config("scenario=quadruped", "gait.vertical=cubic", f"gait.lift={share * abs(gap)}")
    if refused:
        with pytest.raises(BadInput, match=r"gait\.lift"):
            check_apex(config, gap)
    else:
        check_apex(config, gap)


@pytest.mark.parametrize("links", [(0.35, 0.25), (0.25, 0.35)])
def test_a_leg_reaches_as_far_as_both_its_links(plan_of, links):
    leg = [f"machine.leg.length_{n}={length}" for n, length in enumerate(links, 1)]
    stand = ("scenario=one_leg", "gait=standing", *leg)
    depth = 10.0 / 10_000.0  # F / K_n
    load = ("force_control.desired_force=10", "terrain.stiffness=10000")
    plan_of(*stand, *load, f"machine.hip_height={sum(links) - depth - 1e-3}")
    with pytest.raises(BadInput, match=f"reaches only {sum(links):.3f} m"):
        plan_of(*stand, *load, f"machine.hip_height={sum(links) - depth + 1e-3}")


def test_the_mean_load_of_a_walk_is_the_weight_of_all_masses(make_config, plan_of):
    """Whatever accelerates comes to rest again within a cycle, knees and feet of different masses too."""
    walk = ("scenario=quadruped", "machine.leg.mass_1=0.3", "machine.leg.mass_2=0.1", "gait.vertical=two_cubics")
    config, plan = make_config(*walk), plan_of(*walk)
    load = dynamic_load(make_mechanism(config.machine), config.machine.body_mass, plan.desired, plan.joints)
    weight = 9.81 * (config.machine.body_mass + 4 * (0.3 + 0.1))
    assert load.force.mean() == pytest.approx(weight, rel=2e-3)


@pytest.mark.parametrize("shape", ["linear", "cosine"])
@given(st.floats(0.01, 2.0), st.floats(0.0, 3.0))
def test_a_ramp_rises_from_nothing_to_all_at_its_rate(shape, duration, part):
    at, near = part * duration, 1e-6 * duration
    (share, rate), (before, _), (after, _) = (
        make_ramp(shape, np.array([max(time, 0.0)]), duration) for time in (at, at - near, at + near)
    )
    assert 0.0 <= share <= 1.0
    assert make_ramp(shape, np.array([0.0, duration]), duration)[0].tolist() == [0.0, 1.0]
    if abs(part - 1.0) > 1e-5 and part > 1e-5:
        assert_allclose(rate / duration, (after - before) / (2.0 * near), atol=1e-3 / duration)
