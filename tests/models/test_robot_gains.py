"""The delay that the feedback of a robot's legs bears."""

from dataclasses import replace

import numpy as np
import pytest
from support.doors import BadInput
from support.robots import read

from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.robot_gains import (
    MOST_FEEDBACK,
    MOST_SHARE,
    PERIOD_WITHOUT_ROTORS,
    PERIODS,
    RECOMMENDED,
    Basis,
    choose_feedback,
    derive_basis,
    derive_contact,
    derive_drive_gains,
    derive_gains,
    find_critical_damping,
    find_delay_margin,
    find_standing_margin,
    limit_period,
    make_sampling,
    recommend_period,
    require_period,
)  # fmt: skip


def test_the_margin_of_delay_ends_where_feedback_is_unstable():
    period, foot_mass, lead_gain = 0.001, 0.2, 2.9
    gain = 0.5 * foot_mass / (lead_gain * period)
    margin = int(find_delay_margin(foot_mass, gain, lead_gain, period, LoopDelay()).delay / period)
    assert LoopDelay(margin).find_critical_gain(period) > 0.5 >= LoopDelay(margin + 1).find_critical_gain(period)
    with pytest.raises(BadInput, match="velocity_gain"):
        find_delay_margin(foot_mass, gain, lead_gain, period, LoopDelay(2))
    most = MOST_SHARE * LoopDelay(1).find_critical_gain(period) / 0.5
    assert find_delay_margin(foot_mass, 0.99 * most * gain, lead_gain, period, LoopDelay(1)).delay > period


def test_feet_are_held_as_ever_but_those_so_light_that_a_sampling_period_is_too_long():
    basis = Basis(mass=12.0, foot_mass=0.25, hip_height=0.29, stiffness=9810.0, damping=42.0)
    assert derive_contact(basis, 0.002) == (10_000.0, 50.0)
    assert derive_contact(basis._replace(foot_mass=0.04), 0.002) == pytest.approx((3000.0, 12.0))


@pytest.mark.parametrize(("period", "least"), [(0.001, 0.004), (0.002, 0.017), (0.004, 0.02), (0.0005, 0.002)])
def test_a_period_suits_feet_from_a_measured_share_of_the_mass_on(period, least):
    require_period(1.01 * least, period)
    with pytest.raises(BadInput, match="sampling_period"):
        require_period(0.99 * least, period)
    with pytest.raises(BadInput, match="sampling_period"):
        require_period(10.0, 0.00404)  # beyond the longest
    if period <= RECOMMENDED[-1][0]:
        assert recommend_period(0.99 * least) < period <= recommend_period(1.01 * least)


@pytest.mark.ci
def test_short_legs_and_joints_without_rotors_limit_the_period():
    robot = read()
    assert limit_period(robot) == np.inf
    assert limit_period(replace(robot, links=(0.12, 0.12))) == 0.001
    assert limit_period(replace(robot, armature=np.zeros(3))) == PERIOD_WITHOUT_ROTORS


@pytest.mark.parametrize("loop_delay", [LoopDelay(), LoopDelay(1), LoopDelay(0, (0.004,)), LoopDelay(3, (0.002,))])
def test_a_gait_on_two_feet_gets_the_longest_period_that_allows_its_gains(loop_delay):
    longest = recommend_period(1.0, loop_delay)
    for gain in (0.1, 0.3, 0.6):
        period = recommend_period(1.0, loop_delay, gain)
        needed = gain * MOST_FEEDBACK / PERIODS[0][0]
        assert choose_feedback(loop_delay, period) >= needed * period
        assert period == longest or choose_feedback(loop_delay, 2.5 * period) < needed * 2.5 * period


@pytest.mark.ci
@pytest.mark.parametrize("lag", [0.005, 0.015])
def test_a_declared_delay_uses_up_the_margin_and_stiffer_posture_lowers_it(lag):
    robot, lead = read(), discretise(10.0, 3.0, 0.001)
    basis = derive_basis(robot)
    gains = derive_gains(basis, 0.001, lead.b0, LoopDelay(0, (lag,)))

    def find(gains, latency=0.0):
        ground = (basis.stiffness, basis.damping)
        return find_standing_margin(robot, ground, gains, lead, 0.001, LoopDelay(0, (lag,), latency)).delay

    margin = find(gains)
    assert find(gains, margin / 2.0) == pytest.approx(margin / 2.0, rel=0.05)
    assert find(gains._replace(posture_rate_gain=3.0 * gains.posture_rate_gain)) < 0.8 * margin


@pytest.mark.ci
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("period", [0.001, 0.002, 0.005, 0.02])
def test_drives_that_compute_once_a_command_get_gains_below_their_margin(period, delay):
    robot = read()
    sampling = make_sampling(period, delay, 0.0, 0.0)
    stiffness, damping = derive_drive_gains(robot, sampling)
    assert damping <= 0.5 * find_critical_damping(robot, sampling)
    assert damping >= 0.999 * 3.0 * stiffness * period
    assert sampling.delay.find_critical_gain(period) == pytest.approx(2.0 * np.sin(np.pi / (4 * delay + 6)))
    assert make_sampling(period, delay, 0.0, 3 * period).delay.find_critical_gain(period) < 1.0
    free = derive_drive_gains(robot)
    assert stiffness <= free.drive_stiffness
    assert damping <= free.drive_damping
