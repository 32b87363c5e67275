"""The delay that the feedback of a robot's legs bears."""

import pytest
from support.doors import BadInput

from cmacexp.models.lateness import Lateness
from cmacexp.models.robot_gains import MOST_SHARE, find_delay_margin


def test_the_margin_of_delay_ends_where_feedback_is_unstable():
    period, foot_mass, lead_gain = 0.001, 0.2, 2.9
    gain = 0.5 * foot_mass / (lead_gain * period)
    margin = find_delay_margin(foot_mass, gain, lead_gain, period, Lateness())
    assert Lateness(margin).find_critical_gain(period) > 0.5 >= Lateness(margin + 1).find_critical_gain(period)
    with pytest.raises(BadInput, match="velocity_gain"):
        find_delay_margin(foot_mass, gain, lead_gain, period, Lateness(2))
    most = MOST_SHARE * Lateness(1).find_critical_gain(period) / 0.5
    assert find_delay_margin(foot_mass, 0.99 * most * gain, lead_gain, period, Lateness(1)) >= 1
