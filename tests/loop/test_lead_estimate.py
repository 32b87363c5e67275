"""``learning.lead=estimate``: how late feedback is, from its response to a small torque."""

import numpy as np
import pandas as pd
import pytest
from support.rollout import roll_out

from cmacexp.data.signals import LEARNS, REPEATED
from cmacexp.data.tables import MEMORY
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.loop.probe import CYCLES, FIRST_LEARNING, SHARE, estimate_lead, new_probe
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.drift import describe_guard

ESTIMATED = ("scenario=one_leg", "learning=lasting", "learning.lead=estimate", "warn=false")
LATE = {
    "at once": ((), 1),
    "actuator": (("actuator.delay=2",), 3),
    "velocity": (("sensors=real", "sensors.velocity.delay=2"), 3),
    "both": (("actuator.delay=1", "sensors=encoders", "sensors.velocity.delay=1"), 3),
}


@pytest.mark.parametrize(("late", "lead"), LATE.values(), ids=LATE)
def test_the_lead_is_the_samples_from_a_torque_to_the_feedback(make_config, late, lead):
    config = make_config(*ESTIMATED, *late, f"cycles={CYCLES + 6}")
    run = roll_out(make_scenario(config))
    ((cycle, estimated),) = run.estimates
    assert (cycle, estimated) == (CYCLES + 3, lead)
    auto = roll_out(make_scenario(make_config(*ESTIMATED, *late, "learning.lead=auto", "cycles=1")))
    assert run.rate == auto.rate


def test_a_small_torque_probes_before_learning_and_nothing_of_it_stays(make_config):
    run = roll_out(make_scenario(make_config(*ESTIMATED, f"cycles={CYCLES + 4}")))
    samples = len(run.plan.support)
    by_cycle = [run.columns()[name].reshape(-1, samples) for name in ("tau_feedforward_1", "tau_feedback_1")]
    probing, effort = (values[2 : 2 + CYCLES] for values in by_cycle)
    assert not by_cycle[0][:2].any()
    np.testing.assert_array_equal(np.abs(probing), np.abs(probing[0, 0]))
    np.testing.assert_array_equal(probing.sum(axis=0), 0.0)
    assert np.abs(probing).max() < 2.0 * SHARE * np.sqrt((effort**2).mean())


@pytest.mark.parametrize("guard", ["freeze", "refine"])
def test_after_a_retreat_it_learns_again_with_a_longer_lead_from_the_best_cycle(make_config, guard):
    delay = 3
    late = (f"actuator.delay={delay}", "cycles=70")
    run = roll_out(make_scenario(make_config(*ESTIMATED, f"learning.guard={guard}", *late)))
    event, (first, second) = run.events[0], run.estimates[:2]
    assert (event.cycle + 2 + CYCLES, first.lead + 1) == (second.cycle - 1, second.lead)
    samples = len(run.plan.support)
    torque, feedback = (run.columns()[f"tau_{name}_1"].reshape(-1, samples) for name in ("feedforward", "feedback"))
    probing = torque[second.cycle - 1 - CYCLES : second.cycle - 1]
    np.testing.assert_allclose(probing.mean(axis=0)[delay:], torque[event.restored - 1][delay:], atol=1e-12)
    effort = np.sqrt((feedback**2).mean(axis=1))
    assert effort[second.cycle] < 1.2 * effort[event.restored - 1]
    assert effort[-1] < 0.5 * effort[1]


def test_memory_shows_when_it_learns_again(tmp_path, make_config):
    run = run_scenario(make_config(*ESTIMATED, "actuator.delay=3", "cycles=56", "record=trace"), tmp_path / "run")
    (event,), (_, second) = run.manifest["guard"], run.manifest["lead_estimates"]
    states = pd.read_parquet(run.folder / MEMORY)["guard"].to_numpy()
    assert (states[event["cycle"] - 1 : second["cycle"] - 1] == REPEATED).all()
    assert (states[second["cycle"] - 1 :] == LEARNS).all()
    assert f"cycle {second['cycle']}: learns again with lead {second['lead']}" in describe_guard(run.manifest)


def test_a_response_that_chance_could_give_is_no_estimate():
    probe, random = new_probe(200, (1, 2), 0), np.random.default_rng(1)
    noise = random.standard_normal(probe.response.shape)
    probe.response[:] = noise
    assert estimate_lead(probe) is None
    probe.response[:] = noise - np.roll(probe.torque, 3, axis=0)
    assert estimate_lead(probe) == 3


def test_the_manifest_lists_the_estimates(tmp_path, make_config):
    config = make_config(*ESTIMATED, f"cycles={CYCLES + 4}", "actuator.delay=1", "record=trace")
    manifest = run_scenario(config, tmp_path / "run").manifest
    assert manifest["lead_estimates"] == [{"cycle": CYCLES + 3, "lead": 2}]
    assert manifest["learning_lead"] == 2
    assert manifest["learning_rate"] < 50 / 256


@pytest.mark.parametrize("setting", ["learning.guard=none", "feedforward._target_=pipelines.perceptron.Perceptron"])
def test_what_cannot_take_an_estimate_is_refused_in_a_line(make_config, setting):
    with pytest.raises(BadInput, match=r"learning.lead=estimate: needs [^\n]*use that, or auto"):
        roll_out(make_scenario(make_config(*ESTIMATED, setting, "cycles=3")))


def test_a_run_that_ends_before_the_estimate_is_refused_in_a_line(make_config):
    with pytest.raises(BadInput, match=f"cycles=10: must be at least {FIRST_LEARNING} with learning.lead=estimate"):
        roll_out(make_scenario(make_config(*ESTIMATED, "cycles=10")))
