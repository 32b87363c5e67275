"""The settings that ship for lasting learning last, and the rules that hold outlast the paper's law."""

import numpy as np
import pytest
from support.doors import make_scenario
from support.rollout import roll_out

import cmacexp

THIN = ("record=trace", "record.every_nth_step=600")


def test_lasting_is_the_paper_s_law_but_for_lead_and_a_rate_that_follows_from_it(make_config):
    lasting, paper = make_config("learning=lasting").learning, make_config("learning=paper").learning
    assert (lasting.rule, lasting.lead, lasting.rate) == ("paper", "auto", "auto")
    for delay, lead, part in ((0, 1, 1), (2, 3, 5)):
        late = make_scenario(make_config("learning=lasting", f"actuator.delay={delay}")).feedforward.params
        assert late.learning[:2] == (paper.rate / part, lead)


@pytest.mark.nightly
def test_one_leg_stays_as_good_as_it_was(tmp_path):
    run = cmacexp.run(["scenario=one_leg", "learning=lasting", "cycles=1500", *THIN], tmp_path)
    x, y = 1e3 * run.metrics["transfer_rmse_x"], 1e3 * run.metrics["transfer_rmse_y"]
    assert (run.status, run.manifest["drift"]) == ("completed", None)
    assert (x.iloc[-1] <= 0.05, y.iloc[-1] <= 0.5) == (True, True)
    assert max(v[-500:].max() / v[-500:].min() for v in (x, y)) <= 1.2
    assert run.metrics["feedforward_share"].iloc[-1] >= 0.95
    assert (np.diff(run.metrics["feedback_change"][200:]) < 0.0).mean() > 0.99


@pytest.mark.nightly
def test_four_legs_press_as_they_are_to(tmp_path):
    run = cmacexp.run(["scenario=quadruped_lasting", "cycles=150", *THIN], tmp_path)
    assert (run.status, run.manifest["drift"]) == ("completed", None)
    last = run.metrics[run.metrics["cycle"] == 150]
    assert np.sqrt((last["force_rmse_cycle"] ** 2).mean()) <= 1.0
    assert 1e3 * run.body_metrics["tilt_max"].iloc[-1] <= 10.0


@pytest.mark.ci
@pytest.mark.parametrize(
    ("settings", "ends"),
    [
        (("learning.rule=paper",), "diverged"),
        (("learning.rule=weight_smoothing",), "completed"),
        (("learning.rule=e_modification",), "completed"),
        (("learning.rule=paper", "learning.lead=1"), "completed"),
        (("learning.rule=zero_phase",), "completed"),  # whatever the lead
        (("learning.rule=zero_phase", "learning.lead=2"), "completed"),
        (("learning=lasting", "actuator.delay=2"), "completed"),
        (("learning=lasting", "actuator.lag=0.02"), "completed"),
        (("actuator.delay=2", "learning.lead=1"), "diverged"),
        (("actuator.lag=0.02", "learning.lead=1"), "diverged"),
    ],
)
def test_learning_lasts_with_rules_that_hold_and_a_lead_of_the_delay(make_config, settings, ends):
    config = make_config("cycles=300", *settings)
    run = roll_out(make_scenario(config))
    assert run.status == ends
    if config.learning.rule == "zero_phase":
        feedback = np.abs(run.columns()["tau_feedback_1"]).reshape(300, -1).mean(axis=1)
        assert feedback[-1] < 1.5 * feedback.min() < 0.3 * feedback[0]
