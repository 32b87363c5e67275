"""Growth at any lead and rate, from one state that learning has reached."""

from dataclasses import replace

import pytest

from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import grow, learn_until, predicted_growth, with_lead
from cmacexp.stability.growth_map import lasting_growth, map_growth


@pytest.fixture(scope="module")
def leg(make_config):
    config = make_config("scenario=one_leg", "cycles=200", "learning.lead=0")
    growth = predicted_growth(config)
    return config, growth, learn_until(config, growth.cycle)


def compute_growth(loop, lead, rate):
    """Over the cycles that the linearised cycle predicts."""
    loop.learn_with(lead, rate)
    return grow(loop).per_cycle


def test_with_its_own_lead_and_rate_the_map_is_that_of_the_run(leg):
    config, growth, loop = leg
    assert compute_growth(loop, 2, 0.1) != growth.per_cycle  # and leaves the loop where it was
    assert compute_growth(loop, 0, config.learning.rate) == growth.per_cycle


def test_one_state_tells_leads_and_rates_that_hold(leg):
    config, growth, loop = leg
    held = {lead for lead in (-1, 0, 1, 2) if lasting_growth(loop, lead, config.learning.rate) < 1.0}
    assert held == {1}
    other = replace(config, learning=replace(config.learning, rate=0.05))
    slower = predicted_growth(other, growth.cycle).per_cycle
    assert compute_growth(loop, 0, 0.05) == pytest.approx(slower, abs=0.01)
    assert compute_growth(loop, 0, 1e-9) < 1.001
    assert lasting_growth(loop, 40, 1.9) > 1.1


def test_a_rate_with_which_a_run_ends_at_once_grows(leg):
    *_, loop = leg
    assert lasting_growth(loop, -1, 1.9) == float("inf")
    assert lasting_growth(loop, 1, 0.05) < 1.0  # the loop is where it was


def test_a_guarded_run_is_linearised_without_its_guard(make_config, leg):
    config, growth, loop = leg
    guarded = with_lead(make_config("scenario=one_leg", "cycles=200", "learning.guard=freeze"), 0)
    rate = config.learning.rate
    assert lasting_growth(learn_until(guarded, growth.cycle), 0, rate) == lasting_growth(loop, 0, rate)


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (("feedforward=none",), "nothing learns"),
        (("plant=mujoco_leg",), "only the analytic plant"),
        (("learning.lead=-2",), "the run ends in cycle"),
    ],
)
def test_what_has_no_map_is_refused(make_config, overrides, reason):
    with pytest.raises(NotPredictable, match=reason):
        map_growth(make_config("scenario=one_leg", "cycles=200", *overrides), 60, None, None)
