"""The delay that the feedback of a robot's legs bears."""

import pytest
from support.doors import BadInput

from cmacexp.models.lateness import Lateness
from cmacexp.models.robot_gains import (
    MOST_FEEDBACK,
    MOST_SHARE,
    PERIODS,
    RECOMMENDED,
    choose_feedback,
    find_delay_margin,
    recommend_period,
    require_period,
)  # fmt: skip


def test_the_margin_of_delay_ends_where_feedback_is_unstable():
    period, foot_mass, lead_gain = 0.001, 0.2, 2.9
    gain = 0.5 * foot_mass / (lead_gain * period)
    margin = find_delay_margin(foot_mass, gain, lead_gain, period, Lateness())
    assert Lateness(margin).find_critical_gain(period) > 0.5 >= Lateness(margin + 1).find_critical_gain(period)
    with pytest.raises(BadInput, match="velocity_gain"):
        find_delay_margin(foot_mass, gain, lead_gain, period, Lateness(2))
    most = MOST_SHARE * Lateness(1).find_critical_gain(period) / 0.5
    assert find_delay_margin(foot_mass, 0.99 * most * gain, lead_gain, period, Lateness(1)) >= 1


@pytest.mark.parametrize(("period", "least"), [(0.001, 0.004), (0.002, 0.017), (0.004, 0.02), (0.0005, 0.002)])
def test_a_period_suits_feet_from_a_measured_share_of_the_mass_on(period, least):
    require_period(1.01 * least, period)
    with pytest.raises(BadInput, match="sampling_period"):
        require_period(0.99 * least, period)
    with pytest.raises(BadInput, match="sampling_period"):
        require_period(10.0, 0.00404)  # beyond the longest
    if period <= RECOMMENDED[-1][0]:
        assert recommend_period(0.99 * least) < period <= recommend_period(1.01 * least)


@pytest.mark.parametrize("lateness", [Lateness(), Lateness(1), Lateness(0, (0.004,)), Lateness(3, (0.002,))])
def test_a_gait_on_two_feet_gets_the_longest_period_that_allows_its_gains(lateness):
    longest = recommend_period(1.0, lateness)
    for gain in (0.1, 0.3, 0.6):
        period = recommend_period(1.0, lateness, gain)
        needed = gain * MOST_FEEDBACK / PERIODS[0][0]
        assert choose_feedback(lateness, period) >= needed * period
        assert period == longest or choose_feedback(lateness, 2.5 * period) < needed * 2.5 * period
