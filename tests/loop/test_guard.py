"""The guard of learning: no run ends worse than with feedback alone because it learnt."""

import numpy as np
import pytest
from support.doors import BadInput, make_scenario, roll_out

import cmacexp
from cmacexp.loop.guard import Cause, Guard, NetworkWeights, SavedWeights
from cmacexp.loop.guard_kernels import Phase

LASTING = ("scenario=one_leg", "learning=lasting", "learning.rate=0.1953125", "warn=false")
QUICK = (*LASTING, "gait.cycle_time=0.2", "gait.lift=0.005")
"""A cycle of 40 samples."""
DRIFTS = (*QUICK, "learning.rate=0.5", "learning.lead=3", "cycles=26")
"""Two samples too many."""
ESCAPES = (*LASTING, "learning.rate=0.5", "learning.lead=0", "actuator.delay=3", "cycles=6")
"""Within the first cycle of learning."""
CHATTERS = (*QUICK, "sensors=real", "sensors.velocity.delay=2", "actuator.delay=1")
"""Feedback alone is in a limit cycle."""
GETS_WORSE = (*QUICK, "learning.rate=1.9", "learning.lead=-3", "cycles=9")


class SlowToLearn:
    """A feedforward of a user: iterative learning without a lead, which keeps its weights."""

    acts = True

    def reset(self, setup):
        self.torque, self.at_ends = np.zeros((len(setup.plan.support), *setup.mechanism.shape)), {}

    def predict(self, reference, learning_error):
        if reference.sample == 0:
            self.at_ends[reference.step // len(self.torque)] = self.torque.copy()
        self.torque[(reference.sample - 1) % len(self.torque)] += 0.9 * learning_error
        return self.torque[reference.sample].copy()

    def learnt(self):
        return {"torque": self.torque.copy()}


def roll(make_config, *overrides):
    return roll_out(make_scenario(make_config(*overrides)))


def alone(make_config, *overrides):
    return roll(make_config, *overrides, "feedforward=none", "learning.guard=none", "learning.lead=auto", "cycles=4")


def errors(run):
    """RMS error of the foot along x in each whole cycle, m."""
    columns, samples = run.columns(), len(run.plan.support)
    error = (columns["x_reference"] - columns["x"])[: len(run.samples) // samples * samples]
    return np.sqrt((error.reshape(-1, samples) ** 2).mean(axis=1))


def by_cycle(run, name="tau_feedforward_1"):
    return run.columns()[name].reshape(-1, len(run.plan.support), run.samples.shape[1])


@pytest.mark.parametrize(
    ("overrides", "cause", "learns"),
    [
        ((*CHATTERS, "cycles=4"), Cause.CHATTER, False),
        (DRIFTS, Cause.DRIFT, True),
        (GETS_WORSE, Cause.WORSE, True),
        ((*QUICK, "learning.rate=0.05", "learning.lead=5", "cycles=9"), Cause.WORSE, False),
        pytest.param(ESCAPES, Cause.PEAK, False, marks=pytest.mark.ci),
        ((*CHATTERS, "learning.lead=estimate", "cycles=12"), Cause.CHATTER, False),
    ],
)
def test_after_each_cause_the_best_cycle_is_repeated_or_feedback_goes_on_alone(make_config, overrides, cause, learns):
    run, other = roll(make_config, *overrides), alone(make_config, *overrides)
    (event,), torque = run.guard, by_cycle(run)
    assert (run.status, event.cause, event.restored > 0) == ("completed", cause, learns)
    assert errors(run)[-1] <= 1.01 * errors(other)[-1]
    for cycle in torque[event.cycle :]:
        np.testing.assert_array_equal(cycle, torque[event.restored - 1] if learns else 0.0)
    if cause is Cause.CHATTER:  # nothing is learnt
        assert event.cycle == 2
        np.testing.assert_array_equal(run.samples[: len(other.samples)], other.samples)


def test_a_guard_that_does_not_act_changes_no_bit(make_config):
    runs = [roll(make_config, *QUICK, "cycles=12", f"learning.guard={kind}") for kind in ("none", "freeze", "refine")]
    assert not any(run.guard for run in runs)
    assert len({run.samples.tobytes() for run in runs}) == 1


def test_behind_a_delay_the_first_samples_of_the_best_cycle_are_from_the_end_of_the_cycle_before(make_config):
    """The torque that is commanded is repeated exactly; what acts first in a cycle was commanded in the last one."""
    delay = 1
    run = roll(make_config, *QUICK, "learning.rate=1.9", "learning.lead=0", f"actuator.delay={delay}", "cycles=12")
    (event,), torque = run.guard, by_cycle(run)
    repeated, best = torque[event.cycle + 1], torque[event.restored - 1]
    assert (repeated[delay:] == best[delay:]).all()
    assert (repeated[:delay] != best[:delay]).any()
    assert (repeated[:delay] == torque[event.restored][:delay]).all(), "as in the cycle after the best one"


@pytest.mark.parametrize(("ratio", "phase", "events"), [(0.99, Phase.FROZEN, 1), (1.01, Phase.FEEDBACK_ONLY, 2)])
def test_a_guard_that_freezes_repeats_what_is_no_worse_and_acts_at_most_twice(make_config, ratio, phase, events):
    """``ratio``: of the errors of each cycle to those with feedback only, the same in every cycle."""
    guard = Guard(make_scenario(make_config("scenario=one_leg", "learning.guard=freeze")).setup, SavedWeights())
    guard.phase, guard.best_cycle, guard.baseline_effort, guard.baseline_error = Phase.LEARNING, 3, 1.0, 1.0
    guard.state.limits[:], guard.state.alarm[0] = 0.0, 1
    guard.begin_step(100)
    for cycle in range(1, 50):
        guard.state.sums[:2] = 1.0, ratio**2  # effort and error
        guard.begin_step(cycle * guard.period)
    assert (guard.phase, len(guard.events), guard.events[0].cause) == (phase, events, Cause.PEAK)


@pytest.mark.ci
def test_limits_follow_the_largest_step_of_a_first_cycle_with_feedback_alone_whenever_learning_starts(make_config):
    run = roll(make_config, *LASTING, "learning.lead=0", "cycles=30")
    assert not run.guard  # though later steps exceed three times its first one
    assert errors(run)[-1] < 0.1 * errors(run)[0]
    early = roll(make_config, *LASTING, "learning.lead=0", "learning.start_cycle=1", "cycles=4")
    np.testing.assert_array_equal(early.samples, run.samples[: len(early.samples)])


@pytest.mark.nightly
def test_refining_ends_better_than_repeating(make_config):
    frozen, refined = (
        roll(make_config, *LASTING, "learning.lead=2", "cycles=150", f"learning.guard={guard}")
        for guard in ("freeze", "refine")
    )
    assert errors(refined)[-1] < errors(frozen)[-1]
    assert (by_cycle(frozen)[-1] == by_cycle(frozen)[-2]).all()
    assert (by_cycle(refined)[-1] != by_cycle(refined)[-2]).any()  # learning from cycle to cycle goes on


def test_weights_that_the_plan_uses_return_to_those_saved_last(make_config):
    params = make_scenario(make_config(*QUICK, "cmac.memory_bytes=16384")).feedforward.params
    saved, rows = NetworkWeights(params), params.log.rows[0, : params.log.used[0]]
    for value in (1.0, 2.0, 3.0):
        params.weights[...] = value
        if value < 3.0:
            saved.save(0)
    saved.restore()
    assert (params.weights[0, rows] == 2.0).all()
    assert np.count_nonzero(params.weights != 3.0) == 2 * len(rows)


def test_only_a_built_in_network_is_refined(make_config):
    scenario = make_scenario(make_config(*LASTING, "learning.guard=refine"), feedforward=SlowToLearn())
    with pytest.raises(BadInput, match=r"learning\.guard"):
        roll_out(scenario)


KEPT = ("record=trace", "record.weights=true")


def weights_of(folder):
    return dict(np.load(folder / "weights.npz"))


@pytest.mark.ci
def test_a_feedforward_of_a_user_is_guarded_and_its_best_weights_are_kept(tmp_path):
    own = SlowToLearn()
    run = cmacexp.run([*LASTING, "cycles=40", *KEPT], tmp_path, feedforward=own)
    (*_, last), kept = run.manifest["guard"], weights_of(tmp_path)["torque"]
    assert run.manifest["status"] == "completed"
    np.testing.assert_array_equal(kept, own.at_ends[last["restored"]])
    assert (kept != own.torque).any()


@pytest.mark.ci
def test_the_weights_that_are_kept_are_those_at_the_end_of_the_best_cycle(tmp_path):
    settings = [*GETS_WORSE, *KEPT]
    run = cmacexp.run(settings, tmp_path / "guarded")
    (event,) = run.manifest["guard"]
    cmacexp.run([*settings, f"cycles={event['restored']}"], tmp_path / "best")
    kept, best = (weights_of(tmp_path / name)["weights"] for name in ("guarded", "best"))
    # A run that ends there has not learnt from the last sample.
    assert np.abs(kept - best).max() <= 0.01 * np.abs(best).max()
    assert run.metrics["guard_state"].tolist() == [0.0] * (event["cycle"] - 1) + [1.0] * (10 - event["cycle"])
