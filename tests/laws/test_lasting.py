"""The settings that ship for lasting learning last, and the rules that hold outlast the paper's law."""

import numpy as np
import pytest
from support.doors import make_scenario, roll_out


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
