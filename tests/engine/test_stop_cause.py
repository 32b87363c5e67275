"""What the end of a run that fell or diverged shows follows its cause, and nothing that the data do not show."""

import numpy as np
import pytest

import cmacexp
from cmacexp.config.compose import compose_config
from cmacexp.experiment.stop_cause import MOST, explain_stop
from cmacexp.loop import End
from cmacexp.loop.samples import FORCE, TAU_FEEDBACK_2, TAU_FEEDFORWARD_2, make_samples, name_samples
from cmacexp.loop.scenario import make_scenario
from cmacexp.loop.trace import assemble
from cmacexp.metrics.drift import Drift

WALK = ("scenario=quadruped", "actuator.torque_limit=10")
LEARNT = "; feedforward=none shows whether feedback only would have stopped too"


@pytest.fixture(scope="module")
def scenario():
    return make_scenario(compose_config(WALK))


@pytest.fixture
def ended(scenario):
    """``ended(change)``: the clause of a run that fell in the third cycle, whose last samples a function changes."""

    def explain(change=lambda samples: None, status="fell", drift=None, steps=1400):
        samples, _ = make_samples(40, 4, False)
        samples[:, :, FORCE] = 100.0
        change(samples)
        trace = assemble(
            scenario.setup.plan, name_samples(samples), scenario.setup.config.sampling_period, steps - 40
        )
        return explain_stop(scenario, End(steps, status, "", 0.1), [trace.slice(0, 150), trace.slice(150)], drift)

    return explain


def limit(samples, rows=slice(-4, None), legs=slice(2, 3)):
    samples[rows, legs, TAU_FEEDBACK_2], samples[rows, legs, TAU_FEEDFORWARD_2] = -4.0, -6.0


def test_a_torque_at_its_limit_is_reported_if_it_was_so_throughout(ended):
    assert ended(limit) == f"; throughout the last 0.02 s joint 2 of leg 3 at its torque limit{LEARNT}"
    assert ended(lambda samples: limit(samples, slice(-3, None))) == LEARNT
    assert ended(lambda samples: limit(samples, slice(-4, -1))) == LEARNT
    many = ended(lambda samples: limit(samples, legs=slice(None)))
    assert many.count("at its torque limit") == MOST
    assert ", and 1 more" in many


def test_a_foot_without_load_is_reported_where_it_should_support(ended, scenario):
    (planned,) = np.flatnonzero(scenario.setup.plan.support[196:200].all(axis=0) == False)[:1] + 1  # noqa: E712
    text = ended(lambda samples: samples.__setitem__((slice(None), slice(None), FORCE), 0.0))
    legs = [leg for leg in range(1, 5) if f"leg {leg} without load" in text]
    assert planned not in legs
    assert len(legs) == 3


def test_whether_learning_can_be_the_cause_is_said(ended):
    assert ended() == LEARNT
    assert ended(steps=500) == "; it had not begun to learn"
    assert ended(drift=Drift(12, 1, 30, 1.1)) == "; learning had drifted since cycle 12"


def test_a_run_that_completed_or_that_has_no_steps_gets_no_clause(ended, scenario):
    assert ended(limit, status="completed") == ended(limit, status="failed") == ""
    assert explain_stop(scenario, End(0, "fell", "", 0.1), [], None) == ""


def test_the_message_of_a_run_ends_with_it(tmp_path):
    run = cmacexp.run(["scenario=quadruped", "posture.gain=0", "record=metrics"], tmp_path)
    assert run.manifest["cause"].endswith("the body has no static equilibrium; it had not begun to learn")
    alone = cmacexp.run([*WALK[:1], "posture.gain=0", "record=metrics", "feedforward=none"], tmp_path)
    assert alone.manifest["cause"].endswith("the body has no static equilibrium")
