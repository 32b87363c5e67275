"""An identified model below a CMAC: what the joints leave is learnt above them, and carried to another run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import compose_config, make_scenario

IDENTIFIED = ("scenario=quadruped", "gait.cycle_time=0.4", "gait.lift=0.02", "feedforward=identified")


def walk(*overrides, cycles=12):
    """The scenario, and the largest torque that its feedforward lacks, N m, where it is the model and a wave."""
    scenario = make_scenario(compose_config([*IDENTIFIED, "learning.lead=0", *overrides]))
    scenario.feedforward.reset(scenario.setup)
    phase = np.linspace(0.0, 6.0 * np.pi, samples := len(scenario.feedforward.torque), endpoint=False)
    wanted, errors = scenario.feedforward.model_torque + 0.5 * np.sin(phase)[:, None, None], [np.zeros((4, 2))]
    for step in range(cycles * samples):
        reference = SimpleNamespace(step=step, sample=step % samples)
        errors.append(wanted[reference.sample] - scenario.feedforward.predict(reference, errors[-1]))
    return scenario, np.abs(errors[-samples:]).max()


@pytest.mark.ci
def test_a_cmac_learns_what_identified_joints_leave_and_a_later_run_goes_on_with_it():
    target = "feedforward._target_=pipelines.cmac_on_identified.CmacOnIdentified"
    scenario, below = walk(target, "cmac=phase", "learning.rate=0.5")
    assert below < 0.2 * walk()[1]
    learnt, torque = scenario.feedforward.learnt(), scenario.feedforward.torque.copy()
    scenario.feedforward.reset(replace(scenario.setup, learnt=learnt))
    assert_array_equal(scenario.feedforward.torque, torque)
