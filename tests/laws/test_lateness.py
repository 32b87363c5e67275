"""Laws of late feedback: the gain that it allows, the lead and the rate that follow from it."""

import math

import numpy as np
import pytest
from support.robots import read

from cmacexp.cmac.rules import derive_rate
from cmacexp.config.schema import ActuatorConfig
from cmacexp.control.actuator import actuate, new_actuator
from cmacexp.errors import BadInput
from cmacexp.models.lateness import Lateness, add_up, first_order_share
from cmacexp.models.robot_gains import choose_feedback, derive_basis, derive_gains, recommend_period, require_period

PERIOD, STEPS = 0.001, 4000
LATE = [
    (0, 0.0, 0.0),
    (1, 0.0, 0.0),
    (3, 0.0, 0.0),
    (0, 0.005, 0.0),
    (2, 0.015, 0.0),
    (0, 0.003, 0.004),
    (1, 0.001, 0.01),
]


def stops(gain, delay, lag, filtered):
    """Whether a free mass comes to rest by velocity feedback through an actuator and a filter of its velocity."""
    actuator, share = (
        new_actuator(ActuatorConfig(None, None, delay, lag), PERIOD, 1),
        first_order_share(filtered, PERIOD),
    )
    velocity, reading = 1.0, 0.0
    for step in range(STEPS):
        reading += share * (velocity - reading)
        feedback, feedforward, torque = np.full((1, 2), -gain * reading), np.zeros((1, 2)), np.zeros((1, 2))
        actuate(actuator, step, feedback, feedforward, torque)
        velocity += torque[0, 0]
        if abs(velocity) > 1e3:
            return False
    return abs(velocity) < 0.1


@pytest.mark.parametrize(("delay", "lag", "filtered"), LATE)
def test_the_critical_gain_is_the_limit_of_stability(delay, lag, filtered):
    critical = add_up((delay, lag), (0, filtered)).find_critical_gain(PERIOD)
    assert stops(0.95 * critical, delay, lag, filtered)
    assert not stops(1.05 * critical, delay, lag, filtered)


@pytest.mark.parametrize("delay", range(6))
def test_with_delays_alone_it_has_a_closed_form(delay):
    assert Lateness(delay).find_critical_gain(PERIOD) == pytest.approx(2.0 * math.sin(math.pi / (4 * delay + 2)))


def test_lateness_lowers_gains_by_the_same_margin_and_a_lag_alone_does_not():
    on_time = choose_feedback(Lateness(), PERIOD)
    late = [choose_feedback(Lateness(*each), PERIOD) for each in ((1, ()), (2, ()), (2, (0.005,)), (0, (0.005,)))]
    assert on_time == 0.6
    assert late == pytest.approx([0.3, 0.6 * math.sin(math.pi / 10), late[2], 0.6])
    assert late[2] < late[1]


def test_gains_of_a_robot_follow_and_its_body_stays_as_stiff():
    basis = derive_basis(read())
    on_time, late = derive_gains(basis, PERIOD, 2.9), derive_gains(basis, PERIOD, 2.9, Lateness(1))
    assert late.velocity_gain == pytest.approx(on_time.velocity_gain / 2.0)
    assert late.position_gain * (1.0 + late.posture_gain) == pytest.approx(
        on_time.position_gain * (1.0 + on_time.posture_gain)
    )


@pytest.mark.parametrize("ratio", [0.0041, 0.01, 0.018, 0.03, 0.2])
@pytest.mark.parametrize("late", [Lateness(1), Lateness(2), Lateness(1, (0.0003, 0.0002))])
def test_the_recommended_period_is_allowed_and_not_longer_than_with_feedback_on_time(ratio, late):
    period = recommend_period(ratio, late)
    require_period(ratio, period, late)
    assert period <= recommend_period(ratio)


def test_lags_that_no_period_makes_up_for_are_refused():
    with pytest.raises(BadInput, match="none suits feet so light with these lags"):
        recommend_period(0.0041, Lateness(1, (0.03, 0.02)))


def test_a_lag_counts_until_half_of_a_constant_torque_acts():
    for lag in (0.0001, 0.0014, 0.0016, 0.005, 0.015):
        late = Lateness(2, (lag,)).count_samples(PERIOD) - 2
        acting = 1.0 - (1.0 - first_order_share(lag, PERIOD)) ** np.arange(1, 30)
        assert (acting < 0.5).sum() == late


def test_the_rate_by_rule_is_the_paper_s_without_delay_and_keeps_the_phase():
    assert derive_rate(0) == derive_rate(1) == 50 / 256
    assert [derive_rate(lead) * (lead - 0.5) for lead in range(1, 9)] == pytest.approx([25 / 256] * 8)
