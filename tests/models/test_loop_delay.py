"""Laws of late feedback: the gain that it allows, gains of a robot, its sampling period; and of the discrete LEAD."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.doors import BadInput

from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay, add_delays, find_drive_margin, first_order_share
from cmacexp.models.robot_gains import choose_feedback, recommend_period, require_period

PERIOD = 0.001
LATE = [
    (0, 0.0, 0.0),
    (1, 0.0, 0.0),
    (3, 0.0, 0.0),
    (0, 0.005, 0.0),
    (2, 0.015, 0.0),
    (0, 0.003, 0.004),
    (1, 0.001, 0.01),
]


def stops(gain, delay, *lags):
    """Whether a free mass comes to rest by velocity feedback that is late."""
    velocity, late, filtered = 1.0, [0.0] * delay, [0.0] * len(lags)
    for _ in range(4000):
        signal = velocity
        for i, lag in enumerate(lags):
            filtered[i] += (1.0 - math.exp(-PERIOD / lag) if lag else 1.0) * (signal - filtered[i])
            signal = filtered[i]
        late.append(signal)
        velocity -= gain * late.pop(0)
        if abs(velocity) > 1e3:
            return False
    return abs(velocity) < 0.1


@pytest.mark.parametrize(("delay", "lag", "filtered"), LATE)
def test_the_critical_gain_is_the_limit_of_stability(delay, lag, filtered):
    critical = add_delays((delay, lag), (0, filtered)).find_critical_gain(PERIOD)
    assert stops(0.95 * critical, delay, lag, filtered)
    assert not stops(1.05 * critical, delay, lag, filtered)


@pytest.mark.parametrize(("delay", "lag", "filtered"), LATE)
def test_feedback_is_unstable_where_its_margin_is_used_up_by_a_declared_delay(delay, lag, filtered):
    late = add_delays((delay, lag), (0, filtered))
    gain = 0.3 * late.find_critical_gain(PERIOD)
    margin = late.find_margin(gain, PERIOD)
    assert late._replace(latency=margin.delay).find_critical_gain(PERIOD) == pytest.approx(gain, rel=1e-9)
    declared, simulated = late._replace(latency=3 * PERIOD), late._replace(delay=delay + 3)
    assert declared.count_samples(PERIOD) == simulated.count_samples(PERIOD)
    assert declared.find_margin(gain, PERIOD) == pytest.approx(simulated.find_margin(gain, PERIOD))


@pytest.mark.parametrize("lag", [0.0, 0.0151, 0.05])
def test_a_drive_is_unstable_where_its_margin_is_used_up(lag):
    inertia, stiffness, damping = 0.04, 80.0, 6.0
    margin = find_drive_margin(inertia, stiffness, damping, lag)
    s = 1j * margin.crossover
    loop = (stiffness + damping * s) / (inertia * s**2 * (1.0 + lag * s))
    assert abs(loop * cmath.exp(-s * margin.delay) + 1.0) < 1e-9


def test_loop_delay_lowers_gains_by_the_same_margin_and_a_lag_alone_does_not():
    late = [choose_feedback(LoopDelay(*each), PERIOD) for each in ((), (1,), (2,), (2, (0.005,)), (0, (0.005,)))]
    assert late == pytest.approx([0.6, 0.3, 0.6 * math.sin(math.pi / 10), late[3], 0.6])
    assert late[3] < late[2]


@pytest.mark.parametrize("ratio", [0.0041, 0.01, 0.0169, 0.0171, 0.018, 0.03, 0.2])
@pytest.mark.parametrize("late", [LoopDelay(), LoopDelay(1), LoopDelay(2), LoopDelay(1, (0.0003, 0.0002))])
def test_the_recommended_period_is_allowed_and_not_longer_than_with_feedback_on_time(ratio, late):
    period = recommend_period(ratio, late)
    require_period(ratio, period, late)
    assert period <= recommend_period(ratio)
    assert 1.0 / period == pytest.approx(round(1.0 / period))


def test_lags_that_no_period_makes_up_for_are_refused():
    with pytest.raises(BadInput, match="sampling_period"):
        recommend_period(0.0041, LoopDelay(1, (0.03, 0.02)))


def test_a_lag_counts_until_half_of_a_constant_torque_acts():
    for lag in (0.0001, 0.0014, 0.0016, 0.005, 0.015):
        late = LoopDelay(2, (lag,)).count_samples(PERIOD) - 2
        acting = 1.0 - (1.0 - first_order_share(lag, PERIOD)) ** np.arange(1, 30)
        assert (acting < 0.5).sum() == late


@given(st.floats(0.5, 50.0), st.floats(1.0, 30.0), st.floats(1e-4, 2e-2), st.floats(0.01, 0.9))
def test_at_a_frequency_the_lead_is_the_analogue_at_the_warped_frequency(omega, alpha, period, of_nyquist):
    frequency = of_nyquist * math.pi / period
    s = 2j / period * math.tan(frequency * period / 2.0)
    lead, delay = discretise(omega, alpha, period), np.exp(-1j * frequency * period)
    found = (lead.b0 + lead.b1 * delay) / (1.0 + lead.a1 * delay)
    assert found == pytest.approx((1.0 + s / omega) / (1.0 + s / (alpha * omega)), rel=1e-9)
