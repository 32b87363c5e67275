"""The lifted map: growth at any lead and rate from one linearisation."""

from dataclasses import replace

import numpy as np
import pytest

from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import fitted_growth, predicted_growth, with_lead
from cmacexp.stability.lifted import FIRST_WINDOW, lift


@pytest.fixture(scope="module")
def leg(make_config):
    config = make_config("scenario=one_leg", "cycles=200", "learning.lead=0")
    growth = predicted_growth(config)
    return config, growth, lift(config, growth.cycle)


def compute_growth(lifted, lead, rate):
    """Over the cycles that the linearised cycle predicts."""
    return fitted_growth(lifted.sizes(lead, rate, FIRST_WINDOW[1])[slice(*FIRST_WINDOW)])


@pytest.mark.parametrize(
    "overrides",
    [
        ("learning.lead=-1",),
        ("learning.lead=1",),
        ("learning.lead=2", "actuator.delay=1"),
        ("learning.rule=weight_smoothing",),
    ],
)
def test_the_lifted_map_grows_like_the_linearised_cycle(make_config, overrides):
    config = make_config("scenario=one_leg", "cycles=200", *overrides)
    growth = predicted_growth(config)
    lifted = lift(config, growth.cycle)
    first = compute_growth(lifted, config.learning.lead, config.learning.rate)
    assert first == pytest.approx(growth.per_cycle, abs=1e-3)


def test_changes_follow_the_linearised_cycle_one_by_one(leg):
    config, growth, lifted = leg
    sizes, expected = lifted.sizes(0, config.learning.rate, 60)[6:], growth.sizes(59)[5:]
    assert np.abs(sizes / sizes[0] * expected[0] / expected - 1.0).max() < 0.02
    assert fitted_growth(sizes) == pytest.approx(fitted_growth(expected), abs=5e-4)


def test_one_linearisation_tells_leads_and_rates_that_hold(leg):
    config, growth, lifted = leg
    held = {lead for lead in (-1, 0, 1, 2) if lifted.lasting_growth(lead, config.learning.rate) < 1.0}
    assert held == {1}
    other = replace(config, learning=replace(config.learning, rate=0.05))
    slower = predicted_growth(other, growth.cycle).per_cycle
    assert compute_growth(lifted, 0, 0.05) == pytest.approx(slower, abs=0.01)
    assert compute_growth(lifted, 0, 1e-9) < 1.001
    assert lifted.lasting_growth(40, 1.9) > 1.1


def test_a_guarded_run_is_linearised_without_its_guard(make_config, leg):
    config, growth, lifted = leg
    guarded = with_lead(make_config("scenario=one_leg", "cycles=200", "learning.guard=freeze"), 0)
    rate = config.learning.rate
    assert lift(guarded, growth.cycle).lasting_growth(0, rate) == lifted.lasting_growth(0, rate)


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (("learning.rule=dead_zone",), "needs a learning rule that is linear"),
        (("feedforward=none",), "nothing learns"),
        (("plant=mujoco_leg",), "only the analytic plant"),
        (("learning.lead=-2",), "the run ends in cycle"),
    ],
)
def test_what_has_no_lifted_map_is_refused(make_config, overrides, reason):
    with pytest.raises(NotPredictable, match=reason):
        lift(make_config("scenario=one_leg", "cycles=200", *overrides), 60)
