"""The guard of learning: no run ends worse than with feedback alone because it learnt."""

import numpy as np
import pytest
from support.loops import run_both
from support.rollout import roll_out

from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import BadInput
from cmacexp.experiment.run import run_scenario
from cmacexp.feedforward.kernels import correct
from cmacexp.feedforward.network import kernel_norm
from cmacexp.loop.guard import (
    ALONE,
    BEST_CYCLE,
    CAUSES,
    CHATTER,
    DRIFT,
    EFFORT,
    EFFORT_ALONE,
    ERROR,
    ERROR_ALONE,
    EVENTS,
    HOLDING,
    LEARNING,
    PEAK,
    PHASE,
    WORSE,
    judge,
    new_guard,
    retreat,
)
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.trend import WINDOW, count_rises

LASTING = ("scenario=one_leg", "learning=lasting", "learning.rate=0.1953125", "warn=false")
DRIFTS = (*LASTING, "learning.lead=2", "cycles=60")
"""One sample too many."""
ESCAPES = (*LASTING, "learning.rate=0.5", "learning.lead=0", "actuator.delay=3", "cycles=6")
"""Within the first cycle of learning."""
CHATTERS = ("sensors=real", "sensors.velocity.delay=2", "actuator.delay=1", "cycles=14")
"""Feedback alone is in a limit cycle."""


class SlowToLearn:
    """A feedforward of a user: iterative learning without a lead, which keeps its weights."""

    acts = True

    def reset(self, setup):
        self.torque = np.zeros((len(setup.plan.support), *setup.mechanism.shape))

    def predict(self, reference, learning_error):
        self.torque[(reference.sample - 1) % len(self.torque)] += 0.9 * learning_error
        return self.torque[reference.sample].copy()

    def learnt(self):
        return {"torque": self.torque.copy()}


def errors(run):
    """RMS error of the foot along x in each whole cycle, m."""
    columns, samples = run.columns(), len(run.plan.support)
    error = (columns["x_reference"] - columns["x"])[: len(run.samples) // samples * samples]
    return np.sqrt((error.reshape(-1, samples) ** 2).mean(axis=1))


def by_cycle(run, name="tau_feedforward_1"):
    return run.columns()[name].reshape(-1, len(run.plan.support), run.samples.shape[1])


def test_a_guard_that_does_not_act_changes_no_bit(make_config):
    runs = [
        roll_out(make_scenario(make_config(*LASTING, "cycles=12", f"learning.guard={guard}")))
        for guard in ("none", "freeze", "refine")
    ]
    assert runs[1].events == []
    assert len({run.samples.tobytes() for run in runs}) == 1


@pytest.mark.parametrize(
    "overrides",
    [
        DRIFTS,
        ESCAPES,
        ("scenario=quadruped_lasting", "learning.lead=-2", "learning.rate=0.8", "cycles=5", "warn=false"),
    ],
    ids=["drift", "peak", "quadruped"],
)
def test_a_run_completes_in_both_loops_and_ends_no_worse_than_feedback_alone(make_config, overrides):
    guarded = run_both(make_config(*overrides))
    alone = roll_out(make_scenario(make_config(*overrides, "feedforward=none", "learning.guard=none")))
    assert (guarded.status, alone.status) == ("completed", "completed")
    assert guarded.events
    assert errors(guarded)[-1] <= 1.05 * errors(alone)[-1]


def test_behind_a_delay_the_first_samples_of_the_best_cycle_are_from_the_end_of_the_cycle_before(make_config):
    """The torque that is commanded is repeated exactly; what acts first in a cycle was commanded in the last one."""
    delay = 2
    run = roll_out(
        make_scenario(
            make_config("learning.guard=freeze", "learning.rate=1.2", f"actuator.delay={delay}", "cycles=12")
        )
    )
    (event,) = run.events
    torque = by_cycle(run)
    repeated, best = torque[event.cycle + 1], torque[event.restored - 1]
    assert (repeated[delay:] == best[delay:]).all()
    assert (repeated[:delay] != best[:delay]).any()
    assert (repeated[:delay] == torque[event.restored][:delay]).all(), "as in the cycle after the best one"


def test_the_torque_of_the_best_cycle_is_repeated_since_drift_was_detected(make_config):
    run = roll_out(make_scenario(make_config(*DRIFTS)))
    (event,) = run.events
    assert (event.cause, event.cycle > event.restored > 2) == (CAUSES[DRIFT], True)
    torque = by_cycle(run)
    for cycle in range(event.cycle, 60):
        np.testing.assert_array_equal(torque[cycle], torque[event.restored - 1])
    assert (torque[event.restored] != torque[event.restored - 1]).any()


@pytest.mark.parametrize(("ratio", "phase", "events"), [(0.99, HOLDING, 1), (1.01, ALONE, 2)])
def test_a_guard_that_freezes_repeats_what_is_no_worse_and_acts_at_most_twice(make_config, ratio, phase, events):
    """``ratio``: of the errors of each cycle to those with feedback only, the same in every cycle."""
    setup = make_scenario(make_config("scenario=one_leg", "learning.guard=freeze")).setup
    guard = new_guard("freeze", setup.mechanism, setup.plan, np.zeros((1, 0, 2)), None, False)
    guard.counts[PHASE], guard.counts[BEST_CYCLE] = LEARNING, 3
    guard.values[[EFFORT, EFFORT_ALONE, ERROR, ERROR_ALONE]] = 1.0, 1.0, ratio**2, 1.0
    retreat(guard, None, 100, DRIFT)
    for cycle in range(50):
        judge(guard, None, 100 + cycle)
    assert (guard.counts[PHASE], guard.counts[EVENTS]) == (phase, events)


def test_feedback_goes_on_alone_if_nothing_learnt_was_better(make_config):
    run = roll_out(make_scenario(make_config(*ESCAPES)))
    alone = roll_out(make_scenario(make_config(*ESCAPES, "feedforward=none", "learning.guard=none")))
    (event,) = run.events
    assert (event.cycle, event.cause, event.restored) == (2, CAUSES[PEAK], 0)
    assert (by_cycle(run)[2:] == 0.0).all()
    assert errors(run)[-1] == pytest.approx(errors(alone)[-1], rel=1e-3)


def test_a_first_cycle_of_learning_without_feedback_alone_before_it_is_one(make_config):
    run = roll_out(make_scenario(make_config(*LASTING, "learning.start_cycle=1", "cycles=4")))
    other = roll_out(make_scenario(make_config(*LASTING, "cycles=4")))
    assert run.samples.tobytes() == other.samples.tobytes()


def test_refining_ends_better_than_repeating(make_config):
    runs = [
        roll_out(make_scenario(make_config(*DRIFTS, "cycles=150", f"learning.guard={guard}")))
        for guard in ("freeze", "refine")
    ]
    assert [run.status for run in runs] == ["completed"] * 2
    assert errors(runs[1])[-1] < errors(runs[0])[-1]
    frozen, refined = (by_cycle(run)[-2:] for run in runs)
    assert (frozen[0] == frozen[1]).all()
    assert (refined[0] != refined[1]).any()  # learning from cycle to cycle goes on


def test_one_update_a_cycle_moves_the_torque_by_the_kernel_over_its_norm(make_config):
    feedforward = make_scenario(make_config(*LASTING, "learning.guard=refine", "learning.lead=3")).feedforward
    params = feedforward.params
    samples, _, layers = params.cells.shape
    errors, torque = np.zeros((samples, 1, 2)), np.ones((samples, 1, 2))
    errors[40] = 2.0, -1.0
    correct(params, errors, np.zeros(2), torque)
    shared = (params.cells[:, 0, :, None] == params.cells[37, 0]).sum(axis=(1, 2)) / layers
    rate = 50.0 / 256.0 / kernel_norm(params.cells, np.ones(params.cells.shape))
    np.testing.assert_allclose(torque[:, 0], 1.0 + rate * shared[:, None] * errors[40], rtol=1e-12)


def test_only_a_built_in_network_is_refined(make_config):
    scenario = make_scenario(make_config(*LASTING, "learning.guard=refine"), feedforward=SlowToLearn())
    with pytest.raises(BadInput, match=r"learning\.guard"):
        roll_out(scenario)


def test_a_feedforward_of_a_user_is_guarded_and_its_best_weights_are_kept(make_config, tmp_path):
    config = make_config(*LASTING, "cycles=40", "record=trace", "record.weights=true")
    scenario = make_scenario(config, feedforward=SlowToLearn())
    result = run_scenario(config, tmp_path, prepared=scenario)
    assert result.status == "completed"
    (*_, last) = result.manifest["guard"]
    kept = np.load(tmp_path / "weights.npz")["torque"]
    assert kept.tobytes() == scenario.kept[last["restored"]]["torque"].tobytes()
    assert kept.tobytes() != scenario.feedforward.torque.tobytes()


def test_the_weights_that_are_kept_are_those_at_the_end_of_the_best_cycle(make_config, tmp_path):
    overrides = (*DRIFTS, "record=trace", "record.weights=true")
    result = run_scenario(make_config(*overrides), tmp_path / "guarded")
    (event,) = result.manifest["guard"]
    best = run_scenario(make_config(*overrides, f"cycles={event['restored']}"), tmp_path / "best")
    weights = [np.load(folder / "weights.npz")["weights"] for folder in (result.folder, best.folder)]
    # A run that ends there has not learnt from the last sample.
    assert np.abs(weights[0] - weights[1]).max() <= 0.01 * np.abs(weights[1]).max()
    states = result.scores.legs.to_pandas()["guard_state"].tolist()
    assert states == [0.0] * (event["cycle"] - 1) + [1.0] * (61 - event["cycle"])


def test_the_causes_are_those_that_runs_give(make_config):
    worse = roll_out(make_scenario(make_config(*LASTING, "learning.rate=0.03", "learning.lead=40", "cycles=80")))
    assert worse.status == "completed"
    assert {event.cause for event in worse.events} <= {CAUSES[WORSE], CAUSES[PEAK], CAUSES[DRIFT]}


def test_the_norm_of_the_kernel_bounds_its_eigenvalues():
    rng = np.random.default_rng(0)
    cells = rng.integers(0, 12, size=(30, 1, 4)).astype(np.uint32)
    activation = rng.random((30, 1, 4))
    matrix = np.zeros((30, 12))
    np.add.at(matrix, (np.arange(30)[:, None], cells[:, 0]), activation[:, 0])
    kernel = matrix @ matrix.T / (activation[:, 0] ** 2).sum(axis=1)
    norm = kernel_norm(cells, activation)
    assert np.abs(np.linalg.eigvals(kernel)).max() <= norm == pytest.approx(kernel.sum(axis=1).max())


def test_rises_are_counted_in_a_ring():
    assert count_rises(np.arange(WINDOW, dtype=float), WINDOW - 1) == WINDOW * (WINDOW - 1) // 2
    turned = np.roll(np.arange(WINDOW, dtype=float), 4)
    assert count_rises(turned, 3) == WINDOW * (WINDOW - 1) // 2
    assert count_rises(np.ones(WINDOW), 0) == 0


@pytest.mark.parametrize("lead", ["auto", "estimate"])
def test_nothing_is_learnt_where_feedback_alone_chatters(make_config, lead):
    guarded = roll_out(make_scenario(make_config(*LASTING, *CHATTERS, f"learning.lead={lead}")))
    alone = roll_out(make_scenario(make_config(*LASTING, *CHATTERS, "feedforward=none")))
    ((cycle, _, cause, restored),) = guarded.events
    assert (cycle, cause, restored) == (2, CAUSES[CHATTER], 0)
    assert guarded.samples.tobytes() == alone.samples.tobytes()


def test_weights_to_start_from_stay_where_nothing_is_learnt(tmp_path, make_config):
    kept = ("record=trace", "record.weights=true")
    run_scenario(make_config(*LASTING, "cycles=3", *kept), tmp_path / "start")
    config = make_config(*LASTING, *CHATTERS, *kept, f"learning.start_from={tmp_path / 'start'}")
    run_scenario(config, tmp_path / "run")
    before, after = (np.load(tmp_path / run / WEIGHTS) for run in ("start", "run"))
    assert before["weights"].any()
    np.testing.assert_array_equal(after["weights"], before["weights"])


def test_limits_are_multiples_of_the_largest_step_of_feedback_alone(make_config):
    run = roll_out(make_scenario(make_config(*LASTING, "learning.lead=0", "cycles=30")))
    assert not run.events  # though later steps exceed three times its first one
    assert errors(run)[-1] < 0.1 * errors(run)[0]
