"""``learning.lead=estimate``: how late feedback is, from its response to a small torque."""

import numpy as np
import pytest
from support.doors import make_scenario, roll_out

import cmacexp
from cmacexp.loop.probe import CYCLES, SHARE, LeadProbe, estimate_lead
from cmacexp.loop.run import _Cycles

ESTIMATED = ("scenario=one_leg", "learning=lasting", "learning.lead=estimate", "warn=false")
QUICK = (*ESTIMATED, "gait.cycle_time=0.4", "gait.lift=0.01", "gait.stroke=0.1", f"cycles={CYCLES + 4}")
LEARNS, REPEATED = 0.0, 1.0
"""States of the guard."""


@pytest.mark.parametrize(
    ("late", "lead"),
    [
        ((), 1),
        (("actuator.delay=2",), 3),
        (("sensors=real", "sensors.velocity.delay=2"), 3),
        (("actuator.delay=1", "sensors=encoders", "sensors.velocity.delay=1"), 3),
    ],
    ids=["at once", "actuator", "velocity", "both"],
)
def test_the_lead_is_the_samples_from_a_torque_to_the_feedback_and_sets_the_rate(make_config, late, lead):
    run = roll_out(make_scenario(make_config(*QUICK, *late)))
    auto = roll_out(make_scenario(make_config(*QUICK, *late, "learning.lead=auto", "cycles=1")))
    assert [vars(each) for each in run.lead_estimates] == [{"cycle": CYCLES + 3, "lead": lead}]
    assert run.learning_rate == auto.learning_rate


def test_a_small_torque_probes_before_learning_and_nothing_of_it_stays(make_config):
    run = roll_out(make_scenario(make_config(*QUICK)))
    torque, feedback = (
        run.columns()[f"tau_{name}_1"].reshape(-1, len(run.plan.support)) for name in ("feedforward", "feedback")
    )
    probing, effort = torque[2 : 2 + CYCLES], feedback[2 : 2 + CYCLES]
    assert not torque[:2].any()
    np.testing.assert_array_equal(np.abs(probing), np.abs(probing[0, 0]))
    np.testing.assert_array_equal(probing.sum(axis=0), 0.0)
    assert 0.0 < np.abs(probing).max() < 2.0 * SHARE * np.sqrt((effort**2).mean())


@pytest.mark.ci
def test_after_a_retreat_it_learns_again_with_a_longer_lead_from_the_best_cycle(tmp_path):
    delay, samples = 3, 600
    run = cmacexp.run([*ESTIMATED, f"actuator.delay={delay}", "cycles=56", "record=trace"], tmp_path)
    (event,), (first, second) = run.manifest["guard"], run.manifest["lead_estimates"]
    again = second["cycle"] - 1
    assert (event["cycle"] + 2 + CYCLES, first["lead"] + 1) == (again, second["lead"])
    assert run.manifest["learning_lead"] == second["lead"]
    torque, feedback = (
        run.trace[f"tau_{name}_1"].to_numpy().reshape(-1, samples) for name in ("feedforward", "feedback")
    )
    probing, best = torque[again - CYCLES : again], event["restored"] - 1
    np.testing.assert_allclose(probing.mean(axis=0)[delay:], torque[best][delay:], atol=1e-12)
    effort = np.sqrt((feedback**2).mean(axis=1))
    assert effort[again + 1] < 1.2 * effort[best]
    assert effort[-1] < 0.5 * effort[1]
    states = run.metrics["guard_state"].to_numpy()
    assert (states[event["cycle"] - 1 : again] == REPEATED).all()
    assert (states[again:] == LEARNS).all()


@pytest.mark.parametrize(("on_drives", "longer", "share"), [(False, 1, 1 / 3), (True, 0, 1 / 2)])
def test_another_estimate_lengthens_the_lead_and_on_drives_halves_the_rate(make_config, on_drives, longer, share):
    scenario = make_scenario(make_config(*QUICK))
    cycles = _Cycles(scenario, lambda cycles: None)
    cycles.advance()
    rate, scenario.controller.sends_drives = cycles.end.learning_rate, on_drives
    cycles.guard.probe.cycles_left = 1  # as if it had been repeated, with the same response
    cycles._apply_estimate()
    first, second = cycles.end.lead_estimates
    assert (second.lead - first.lead, cycles.end.learning_rate / rate) == (longer, pytest.approx(share))


def test_a_response_that_chance_could_give_is_no_estimate():
    probe, random = LeadProbe(200, (1, 2), 0).state, np.random.default_rng(1)
    noise = random.standard_normal(probe.response.shape)
    probe.response[:] = noise
    assert estimate_lead(probe) is None
    shares = {3: 0.9, 5: 1.0, 7: 0.9}
    probe.response[:] = noise - sum(share * np.roll(probe.pattern, lag, axis=0) for lag, share in shares.items())
    assert (estimate_lead(probe), estimate_lead(probe, on_drives=True)) == (3, 5)
