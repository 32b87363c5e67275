"""The verdict on learning: it holds, grows, or is undecided."""

import math

import numpy as np
import pytest
from support.doors import make_scenario

from cmacexp.stability.cycle_map import make_restorable_loop
from cmacexp.stability.growth import grow
from cmacexp.stability.verdict import GROWS, HOLDS, UNDECIDED, WINDOW, assess, compute_rise


@pytest.mark.ci
@pytest.mark.parametrize(
    ("settings", "expected", "grows"),
    [
        (("learning.lead=0",), GROWS, True),
        (("learning.lead=1",), HOLDS, False),
        (("learning.rate=1.9", "learning.lead=-2"), GROWS, None),  # fails at once
        (("feedforward=none",), UNDECIDED, None),
        (("sensors=encoders", "learning.lead=2"), UNDECIDED, None),  # cannot be linearised
        pytest.param(("scenario=quadruped", "learning.lead=1"), GROWS, True, marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_learning_holds_with_lead_one_and_what_is_not_known_is_undecided(make_config, settings, expected, grows):
    config = make_config(*settings)
    verdict = assess(config)
    assert verdict.verdict == expected
    assert verdict.reasons
    assert math.isnan(verdict.growth) if grows is None else (verdict.growth > 1.0) == grows


@pytest.mark.ci
def test_the_guard_hides_no_growth_and_the_scenario_stays_as_it_is(make_config):
    settings = ("learning.lead=0", "learning.rate=0.1", "gait.cycle_time=0.6", "gait.lift=0.02")
    plain, guarded = (make_config(*settings, f"learning.guard={guard}") for guard in ("none", "freeze"))
    scenario = make_scenario(guarded)
    first, again = (assess(guarded, scenario, simulate=False) for _ in range(2))
    assert first == again == assess(plain, simulate=False)


@pytest.mark.nightly
@pytest.mark.parametrize(("lead", "holds"), [(1, True), (2, False)])
def test_ritz_values_of_random_starts_are_those_of_changes(make_config, lead, holds):
    loop = make_restorable_loop(make_config("scenario=one_leg", f"learning.lead={lead}"))
    assert all(loop.advance(loop.period) for _ in range(20))
    modes = [abs(grow(loop, 40, seed=seed).krylov.eigenvalues()[0]) for seed in (None, 0, 1)]
    assert (max(modes) < 0.9999) if holds else (min(modes) > 1.005)  # 1 is the mode of weights that act on nothing


@pytest.mark.nightly
def test_a_leg_in_mujoco_gets_the_verdict_of_the_analytic_one(make_config):
    settings = ("scenario=one_leg", "learning.lead=1", "learning.rule=weight_smoothing", "gait.cycle_time=0.6")
    analytic, mujoco = (
        assess(make_config(*settings, f"plant={plant}"), simulate=False) for plant in ("analytic", "mujoco_leg")
    )
    assert mujoco.verdict == analytic.verdict == HOLDS
    assert mujoco.growth == pytest.approx(analytic.growth, abs=0.003)


def test_a_rise_is_that_over_the_lowest_level_of_the_cycles_given():
    levels = np.repeat([4.0, 1.0, 2.0], WINDOW)
    assert compute_rise(levels) == (2.0, 1.0)
    assert compute_rise(levels[:-WINDOW]) == (1.0, 1.0)
    assert compute_rise(np.append(1000.0, levels))[1] == 10.0  # what is below a hundredth of the highest does no harm
