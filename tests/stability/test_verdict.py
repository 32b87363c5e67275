"""The verdict on learning: it holds, grows, or is undecided, and says why."""

import math

import numpy as np
import pytest

from cmacexp.loop.scenario import make_scenario
from cmacexp.models.trend import WINDOW
from cmacexp.stability.cycle_map import make_restorable_loop
from cmacexp.stability.growth import grow
from cmacexp.stability.verdict import GROWS, HOLDS, MAX_CYCLES, UNDECIDED, assess, compute_rise


@pytest.mark.parametrize(("lead", "expected"), [(0, GROWS), (1, HOLDS), (2, GROWS)])
def test_the_papers_law_holds_with_lead_one(make_config, lead, expected):
    verdict = assess(make_config("scenario=one_leg", f"learning.lead={lead}"))
    assert (verdict.verdict, verdict.lead) == (expected, lead)
    assert (verdict.growth > 1.0) == (expected == GROWS)
    assert verdict.reasons[0].startswith("The run ends in" if expected == GROWS else f"After {MAX_CYCLES + 2} cycles")


def test_a_run_shows_slow_growth_that_the_first_cycles_do_not(make_config):
    config = make_config("scenario=quadruped", "learning.lead=1")
    assert assess(config, simulate=False).verdict == UNDECIDED
    verdict = assess(config)
    assert verdict.verdict == GROWS
    assert "times its lowest level (grows from 1.5)" in verdict.reasons[0]
    assert verdict.growth > 1.0


def test_the_guard_hides_no_growth(make_config):
    settings = ("scenario=one_leg", "learning.lead=0", "learning.rate=0.1")
    plain, guarded = (assess(make_config(*settings, f"learning.guard={guard}")) for guard in ("none", "freeze"))
    assert plain.verdict == GROWS
    assert guarded == plain


def test_learning_that_fails_at_once_grows(make_config):
    verdict = assess(make_config("scenario=one_leg", "learning.rate=1.9", "learning.lead=-2"))
    assert verdict.verdict == GROWS
    assert math.isnan(verdict.growth)


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (("feedforward=none",), "nothing learns"),
        (("sensors=encoders", "learning.lead=2"), "sensors.position.quantum is above 0"),
    ],
)
def test_what_cannot_be_linearised_is_undecided(make_config, overrides, reason):
    verdict = assess(make_config("scenario=one_leg", *overrides))
    assert verdict.verdict == UNDECIDED
    assert reason in verdict.reasons[-1]


def test_a_verdict_leaves_the_scenario_as_it_is(make_config):
    config = make_config("scenario=one_leg", "learning.lead=1")
    scenario = make_scenario(config)
    assert assess(config, scenario, simulate=False) == assess(config, scenario, simulate=False)


@pytest.mark.parametrize(("lead", "holds"), [(1, True), (2, False)])
def test_ritz_values_of_random_starts_are_those_of_changes(make_config, lead, holds):
    loop = make_restorable_loop(make_config("scenario=one_leg", f"learning.lead={lead}"))
    for _ in range(20):
        assert loop.advance(loop.period)
    modes = [abs(grow(loop, 40, seed=seed).krylov.eigenvalues()[0]) for seed in (None, 0, 1)]
    assert (max(modes) < 0.9999) if holds else (min(modes) > 1.005)  # 1 is the mode of weights that act on nothing


def test_a_leg_in_mujoco_gets_the_verdict_of_the_analytic_one(make_config):
    pytest.importorskip("mujoco")
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
