"""Laws of a model whose joints are identified: the truth is found in a cycle, and carries over to another speed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import make_scenario

from cmacexp.feedforward import InverseDynamics
from cmacexp.feedforward.identified import make_features

SHORT = ("scenario=quadruped", "gait.cycle_time=0.4", "gait.lift=0.02", "feedforward=identified")
INERTIA, VISCOUS, OFFSET, SPRING = 0.03, 0.2, -0.1, 0.3
FRICTION = [0.5, 0.3, 0.4, 0.2, 0.1]


@pytest.fixture(scope="module")
def scenario(make_config):
    return make_scenario(make_config(*SHORT, "learning.lead=2", "feedforward.forgetting=1", "feedforward.prior=1e-9"))


def walk(feedforward, wanted, lead, cycles=3):
    """The torque (N, L, J) of the last of some cycles; feedback supplies the rest, ``lead`` steps late."""
    samples, errors, given = len(wanted), [np.zeros(wanted.shape[1:])] * (lead + 1), []
    for step in range(cycles * samples):
        reference = SimpleNamespace(step=step, sample=step % samples)
        given.append(feedforward.predict(reference, errors[step]))
        errors.append(wanted[step % samples] - given[-1])
    return np.array(given[-samples:])


def find_lost(setup, ranges):
    """Torque (N, L, J) of joints whose parameters are those above."""
    features = make_features(setup.plan.joints, len(FRICTION), ranges)
    return features @ np.array([INERTIA, VISCOUS, OFFSET, SPRING, *FRICTION])


@pytest.fixture
def at_start(scenario):
    """The feedforward before it has learnt, its setup, and the torque (N, L, J) of its model."""
    feedforward, setup = scenario.feedforward, scenario.setup
    feedforward.reset(setup)
    return feedforward, setup, InverseDynamics(feedforward.config).compute_torque(setup)


def test_joints_are_found_in_the_feedback_whenever_it_comes(at_start):
    feedforward, setup, model = at_start
    assert_array_equal(feedforward.predict(SimpleNamespace(step=0, sample=0), np.zeros((4, 2))), model[0])
    feedforward.reset(setup)
    wanted = model + find_lost(setup, feedforward.ranges)
    assert_allclose(walk(feedforward, wanted, setup.lead), wanted, atol=1e-5)
    assert_allclose(feedforward.learnt()["weights"][0, 0, :2], [INERTIA, VISCOUS], rtol=1e-2)


def test_joints_are_found_behind_a_lag_that_the_torque_is_advanced_by(scenario, make_config):
    """Torque and regressors are those of two samples later, so that the parameters stay those of the joints."""
    advanced = make_scenario(
        make_config(*SHORT, "learning.lead=2", "feedforward.forgetting=1", "feedforward.prior=1e-9",
                    "feedforward.advance=0.01")
    )  # fmt: skip
    feedforward, setup = advanced.feedforward, advanced.setup
    model = InverseDynamics(scenario.feedforward.config).compute_torque(setup)
    wanted = np.roll(model + find_lost(setup, feedforward.ranges), -2, axis=0)
    assert_allclose(walk(feedforward, wanted, setup.lead), wanted, atol=1e-5)
    assert_allclose(feedforward.learnt()["weights"][0, 0, :2], [INERTIA, VISCOUS], rtol=1e-2)


def test_what_was_learnt_gives_the_torque_of_another_speed(at_start, make_config):
    feedforward, setup, model = at_start
    walk(feedforward, model + find_lost(setup, feedforward.ranges), setup.lead)
    learnt = feedforward.learnt()
    faster = make_scenario(make_config(*SHORT, "gait.cycle_time=0.3"))
    faster.feedforward.reset(replace(faster.setup, learnt=learnt))
    lost = find_lost(faster.setup, learnt["ranges"])
    wanted = InverseDynamics(feedforward.config).compute_torque(faster.setup) + lost
    left = np.abs(faster.feedforward.torque - wanted).max() / np.abs(lost).max()
    assert left < 0.02
