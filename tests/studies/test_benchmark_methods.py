"""Methods of the benchmark: each learns, goes on from what it has learnt, and computes what its source says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.rollout import roll_out

from cmacexp.errors import BadInput
from cmacexp.feedforward.ilc import gaussian_taps
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.feedforward.network import resample
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.leg import Leg, inverse_dynamics, trigonometry
from cmacexp.models.robot_file import package_models
from cmacexp.planning.setup import Reference
from pipelines.benchmark.methods.adaptive import MODEL, make_gains, make_regressor
from pipelines.benchmark.methods.fourier import features
from pipelines.benchmark.methods.frozen_loop import feedback_removed
from pipelines.benchmark.methods.norm_optimal import NormOptimal
from pipelines.benchmark.methods.repetitive import Repetitive
from pipelines.benchmark.methods.slotine_li import motion_regressor
from pipelines.benchmark.methods.torque_library import TorqueLibrary

FOLDER = "pipelines.benchmark.methods"
METHODS = {
    "norm_optimal": f"feedforward._target_={FOLDER}.norm_optimal.NormOptimal",
    "fourier": f"feedforward._target_={FOLDER}.fourier.RandomFourier",
    "adaptive": f"feedforward._target_={FOLDER}.adaptive.AdaptiveRegressor",
    "repetitive": f"feedforward._target_={FOLDER}.repetitive.Repetitive",
    "identified": f"feedforward._target_={FOLDER}.identified.Identified",
    "torque_library": f"feedforward._target_={FOLDER}.torque_library.TorqueLibrary",
}
SLOTINE_LI = (f"controller._target_={FOLDER}.slotine_li.SlotineLi", "feedforward=none")
PER_SAMPLE = ("norm_optimal", "repetitive", "torque_library")
LEG = ("scenario=one_leg", "reference=aware", "learning=lasting", "learning.guard=none")
HEAVY = (*LEG, "plant.mass_factor=1.2", "cycles=6")
"""The leg is heavier than its controllers know, all along."""
ROBOT = pytest.mark.skipif(not package_models(), reason="needs the models of robots")


def transfer_error(rollout):
    """Root mean square distance of the foot of leg 1 from its plan in transfer in the last cycle, m."""
    plan, columns = rollout.plan, rollout.columns()
    last, transfer = slice(-len(plan.support), None), ~plan.support[:, 0]
    away = [columns[name][last, 0] - plan.desired[:, 0, j] for j, name in enumerate("xy")]
    return float(np.sqrt((np.stack(away)[:, transfer] ** 2).sum(axis=0).mean()))


@pytest.fixture(scope="module")
def alone(make_config):
    return transfer_error(roll_out(make_scenario(make_config(*HEAVY, "feedforward=none"))))


@pytest.fixture(scope="module")
def learnt(make_config):
    """What each has learnt, after some cycles."""
    found = {}
    for name, method in METHODS.items():
        scenario = make_scenario(make_config(*HEAVY, method))
        found[name] = (transfer_error(roll_out(scenario)), scenario.feedforward.learnt())
    return found


@pytest.mark.parametrize("name", METHODS)
def test_it_learns_what_an_unknown_mass_needs(learnt, alone, name):
    assert learnt[name][0] < 0.4 * alone


def test_slotine_and_li_adapt_to_an_unknown_mass_without_a_feedforward(make_config, alone):
    scenario = make_scenario(make_config(*HEAVY, *SLOTINE_LI))
    rollout = roll_out(scenario)
    assert transfer_error(rollout) < 0.4 * alone
    torque = rollout.columns()["tau_feedforward_1"].reshape(6, -1)
    assert not torque[0].any()  # before learning.start_cycle
    assert torque[1:].any(axis=1).all()


def test_adaptive_laws_find_the_unknown_mass_on_a_path_without_jumps(make_config):
    smooth = (*HEAVY, "gait.vertical=two_cubics", "cycles=12")
    measured, planned = (make_scenario(make_config(*smooth, *more)) for more in (SLOTINE_LI, (METHODS["adaptive"],)))
    nominal = np.array(measured.controller.parameters[0])
    roll_out(measured)
    roll_out(planned)
    assert_allclose(measured.controller.parameters[0] / nominal, 1.2, rtol=0.05)
    assert_allclose(planned.feedforward.learnt()["parameters"][0, :2], 1.2, rtol=0.05)


def identify(scenario):
    """Parameters (P,) of leg 1 that a scenario identifies."""
    roll_out(scenario)
    return scenario.feedforward.learnt()["parameters"][0]


def test_least_squares_find_masses_and_ground_that_are_wrong(make_config):
    """On a path without jumps, from two cycles of feedback only; the factor of the contact force stays 1."""
    method = (METHODS["identified"], "+feedforward.prior=1e-3")
    smooth = (*LEG, *method, "gait.vertical=two_cubics", "cycles=4", "terrain.stiffness=15")
    known = ("terrain.assumed_stiffness=10", "plant.mass_factor=1.2")
    inertia, gravity, contact, *_ = identify(make_scenario(make_config(*smooth, *known)))
    assert_allclose(gravity, 1.2, rtol=0.02)
    assert_allclose(contact, 1.0, rtol=0.05)
    assert_allclose(inertia, 1.2, rtol=0.2)


def test_a_plan_without_jumps_gives_the_nominal_model_the_impulse_at_lift_off(make_config):
    """With true masses and ground: the error of a model along the plan is that of the impulse which it lacks."""
    smooth = (METHODS["identified"], "+feedforward.prior=1e6")
    errors = {}
    for vertical in ("cubic", "two_cubics"):
        own = (*LEG, f"gait.vertical={vertical}", "cycles=5")
        model, filtered = (
            transfer_error(roll_out(make_scenario(make_config(*own, *more))))
            for more in (("feedforward=inverse_dynamics",), smooth)
        )
        errors[vertical] = model, filtered
    assert errors["cubic"][1] < 0.3 * errors["cubic"][0]
    assert errors["two_cubics"][0] < 0.05 * errors["cubic"][0]


def test_a_model_is_identified_from_feedback_only_and_then_fixed(make_config):
    scenario = make_scenario(make_config(*HEAVY, METHODS["identified"]))
    torque = roll_out(scenario).columns()["tau_feedforward_1"].reshape(6, -1)
    assert not torque[:3].any()
    assert torque[3].any()
    assert_array_equal(torque[4], torque[3])
    assert_array_equal(torque[5], torque[3])


def test_a_run_that_was_too_short_to_identify_leaves_feedback_only(make_config):
    """Also where the controller adds the desired force, which a model of zero torque would take away."""
    own = (*LEG, METHODS["identified"], "reference=force_feedforward", "cycles=3")
    short = make_scenario(make_config(*own))
    roll_out(short)
    after = make_scenario(make_config(*own, "learning.start_cycle=1"), short.feedforward.learnt())
    assert not roll_out(after).columns()["tau_feedforward_1"].any()


def test_the_known_model_acts_until_it_is_identified_anew(make_config, learnt):
    scenario = make_scenario(make_config(*LEG, METHODS["identified"], "learning.start_cycle=1", "cycles=5"), {
        "parameters": learnt["identified"][1]["parameters"]
    })  # fmt: skip
    torque = roll_out(scenario).columns()["tau_feedforward_1"].reshape(5, -1)
    assert torque[0].any()
    assert_array_equal(torque[2], torque[0])
    assert np.abs(torque[3] - torque[0]).max() > 0.01  # the leg is no longer heavy
    assert_array_equal(torque[4], torque[3])


def first_torques(scenario, setup):
    """Torque of each sample of a cycle without feedback to learn from."""
    feedforward, plan = scenario.feedforward, setup.plan
    feedforward.reset(setup)
    rows = zip(plan.support, plan.reference[1], plan.desired, plan.joints, plan.force_desired, strict=True)
    nothing = np.zeros(setup.mechanism.shape)
    return np.stack([feedforward.predict(Reference(k, k, True, *row), nothing).copy() for k, row in enumerate(rows)])


@pytest.mark.parametrize("name", METHODS)
def test_a_second_run_starts_with_what_the_first_has_learnt(make_config, learnt, name):
    scenario = make_scenario(make_config(*LEG, METHODS[name]))
    setup = replace(scenario.setup, learnt=learnt[name][1])
    scenario.feedforward.reset(setup)
    for key, value in scenario.feedforward.learnt().items():
        assert_array_equal(value, learnt[name][1][key])
    torque = first_torques(scenario, setup)
    assert np.abs(torque).max() > 0.1
    if name in PER_SAMPLE:
        (kept,) = [value for key, value in learnt[name][1].items() if key.startswith("torque")]
        assert_array_equal(torque[:-50], kept[:-50])  # repetitive control filters the last samples once more


@pytest.mark.parametrize("name", METHODS)
def test_a_second_run_may_have_another_number_of_samples(make_config, learnt, name):
    scenario = make_scenario(make_config(*LEG, METHODS[name], "sampling_period=0.01"))
    torque = first_torques(scenario, replace(scenario.setup, learnt=learnt[name][1]))
    same = make_scenario(make_config(*LEG, METHODS[name]))
    whole = first_torques(same, replace(same.setup, learnt=learnt[name][1]))
    away = np.abs(torque - whole[::2])
    assert np.median(away) < 0.02 * np.abs(whole).max()


def test_norm_optimal_predicts_what_a_torque_takes_off_the_feedback(make_config):
    """Of a leg that stays in transfer about one posture, after the torque has repeated for some cycles."""
    config = make_config(*LEG, "feedforward=none", "learning.start_cycle=1", "gait.stroke=0.001", "cycles=6")
    config = replace(config, learning=replace(config.learning, lead=1))
    scenario = make_scenario(config)
    samples = len(scenario.setup.plan.support)
    times = np.arange(samples) / samples
    added = 1e-3 * np.stack([np.sin(2 * np.pi * 4 * times), np.cos(2 * np.pi * 9 * times)], axis=-1)[:, None]

    def feedback(torque):
        class Played:
            acts = True

            def reset(self, setup):
                pass

            def predict(self, reference, learning_error):
                return torque[reference.sample]

        columns = roll_out(make_scenario(config, feedforward=Played())).columns()
        return np.stack([columns[f"tau_feedback_{j}"][-samples:, 0] for j in (1, 2)], axis=-1)

    setup = scenario.setup
    support = setup.plan.support[:, 0]
    q = setup.plan.joints[~support, 0, :2].mean(axis=0)
    model = feedback_removed(setup, 0, q, support=False)
    predicted = np.fft.irfft((model @ np.fft.rfft(added[:, 0], axis=0)[..., None])[..., 0], samples, axis=0)
    found = feedback(0.0 * added) - feedback(added)
    middle = np.flatnonzero(~support)[samples // 8 : -samples // 20]
    off = np.sqrt(np.mean((found - predicted)[middle] ** 2) / np.mean(found[middle] ** 2))
    assert off < 0.2


def test_feedback_takes_all_of_a_steady_torque_of_a_free_foot_and_little_of_a_fast_one(make_config):
    setup = make_scenario(make_config(*LEG, "feedforward=none")).setup
    free, pressed = (feedback_removed(setup, 0, np.array([0.8, 1.2]), support) for support in (False, True))
    assert_allclose(free[0], np.eye(2), atol=1e-6)
    assert 0.0 < np.linalg.det(pressed[0]).real < 1.0  # the ground bears a part
    assert np.abs(free[-1]).max() < 0.5
    late = feedback_removed(replace(setup, lead=setup.lead + 3), 0, np.array([0.8, 1.2]), False)
    assert_allclose(late[0], np.eye(2), atol=1e-6)
    assert np.abs(late - free).max() > 0.1


def test_norm_optimal_solves_its_normal_equations(make_config):
    method = NormOptimal(NormOptimal.Config(gain=1.0, penalty=0.2))
    model = np.random.default_rng(0).normal(size=(2, 3, 2, 2)) @ [[[1.0, 0.0], [0.0, 1.0]]]
    model = model[0] + 1j * model[1]
    inverse, feedback = method._invert(model), np.array([0.3, -1.0])
    change = inverse @ feedback
    left = feedback - (model @ change[..., None])[..., 0]
    gradient = (model.conj().swapaxes(1, 2) @ left[..., None])[..., 0] - 0.2 * change
    assert_allclose(gradient, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "overrides",
    [LEG, ("scenario=quadruped_lasting",), pytest.param(("scenario=robot", "machine=go1"), marks=ROBOT)],
)
def test_the_nominal_parameters_of_the_regressor_give_the_inverse_dynamics(make_config, overrides):
    setup = make_scenario(make_config(*overrides, "feedforward=none")).setup
    regressor = make_regressor(setup)
    exact = InverseDynamics(InverseDynamics.Config(1.0, 1.0)).compute_torque(setup)
    assert_allclose(regressor[..., :4] @ MODEL, exact, atol=1e-9)
    gains = make_gains(regressor)
    power = np.einsum("kijp,kijq->ipq", regressor, regressor) / len(regressor)
    eigenvalues = np.linalg.eigvals(gains @ power).real
    assert eigenvalues.max() <= 1.0 + 1e-6  # so that no gain up to 2 diverges over cycles
    assert eigenvalues.min() > -1e-6


def test_the_regressor_explains_masses_that_are_wrong(make_config):
    setup = make_scenario(make_config(*LEG, "feedforward=none")).setup
    heavy = InverseDynamics(InverseDynamics.Config(1.2, 1.0)).compute_torque(setup)
    assert_allclose(make_regressor(setup)[..., :4] @ [1.2, 1.2, 1.0, 0.0], heavy, atol=1e-9)


def test_the_regressor_of_the_motion_gives_the_inverse_dynamics_and_wastes_no_power():
    chance = np.random.default_rng(1)
    for _ in range(20):
        (q, dq, ddq, v), (m1, m2) = chance.normal(size=(4, 2)), chance.uniform(0.1, 2.0, 2)
        leg = Leg(0.35, 0.3, m1, m2, 1.0)
        first, second = (np.array(each) for each in motion_regressor((0.35, 0.3), q, dq, dq, ddq))
        expected = inverse_dynamics(leg, trigonometry(*q), *dq, *ddq, 0.0)
        assert_allclose((m1 + m2) * first + m2 * second, expected, atol=1e-12)
        # v^T (dM/dt - 2 C) v = 0, which makes the error energy fall by s^T K_D s alone.
        rest = np.array(motion_regressor((0.35, 0.3), q, dq, np.zeros(2), np.zeros(2)))
        coriolis = (np.array(motion_regressor((0.35, 0.3), q, dq, v, np.zeros(2))) - rest) @ v
        step = 1e-6

        def energy(angles, rest_at=v):
            at = np.array(motion_regressor((0.35, 0.3), angles, np.zeros(2), np.zeros(2), rest_at))
            still = np.array(motion_regressor((0.35, 0.3), angles, np.zeros(2), np.zeros(2), np.zeros(2)))
            return (at - still) @ rest_at

        rate = (energy(q + step * dq) - energy(q - step * dq)) / (2.0 * step)
        assert_allclose(rate, 2.0 * coriolis, atol=1e-6)


def test_half_waves_make_up_random_fourier_features():
    chance = np.random.default_rng(0)
    points, waves = chance.uniform(size=(30, 2)), chance.normal(size=(2, 4000)) / 0.5
    found = features(points, waves, chance.uniform(0.0, 2.0 * np.pi, 4000))
    assert found.min() == 0.0
    whole = found[:, :4000] - found[:, 4000:]
    distance = ((points[:, None] - points) ** 2).sum(axis=2)
    assert_allclose(2.0 / 4000 * whole @ whole.T, np.exp(-distance / (2.0 * 0.5**2)), atol=0.1)


def test_fourier_draws_follow_the_seed(make_config):
    one, again, other = (
        make_scenario(make_config(*LEG, METHODS["fourier"], f"seed={seed}")).feedforward.learnt()["waves"]
        for seed in (1, 1, 2)
    )
    assert_array_equal(one, again)
    assert not np.array_equal(one, other)


def test_repetitive_control_is_its_equation(make_config):
    """u(k) = Q [u(k - N) + gain U(k - N + lead)], by sums over all samples of three cycles."""
    setup = replace(make_scenario(make_config(*LEG, "feedforward=none")).setup, lead=2)
    method = Repetitive(Repetitive.Config(gain=0.3, cutoff=20.0))
    method.reset(setup)
    samples, chance = len(setup.plan.support), np.random.default_rng(0)
    feedback = chance.normal(size=(3 * samples, 1, 2))
    played = np.zeros_like(feedback)
    for k in range(len(feedback)):
        played[k] = method.predict(
            Reference(k, k % samples, True, *[None] * 5), feedback[k - 1] if k else np.zeros((1, 2))
        )
    taps = gaussian_taps(20.0, 0.005, samples)
    for k in (2 * samples, 2 * samples + 1, 2 * samples + 300, 3 * samples - 1):
        expected = 0.0
        for j in range(-len(taps) + 1, len(taps)):
            before = k - samples + j
            expected = expected + taps[abs(j)] * (played[before] + 0.3 * feedback[before + 2])
        assert_allclose(played[k], expected, atol=1e-12)


def test_a_filter_as_long_as_the_cycle_is_refused(make_config):
    with pytest.raises(BadInput, match=r"feedforward\.cutoff"):
        make_scenario(make_config(*LEG, METHODS["repetitive"], "+feedforward.cutoff=0.1"))


def test_the_library_starts_with_the_nearest_plan_and_keeps_the_others(make_config):
    setup = make_scenario(make_config(*LEG, "feedforward=none")).setup
    samples, gait = len(setup.plan.support), setup.config.gait
    far, near = np.full((samples // 2, 1, 2), 1.0), np.full((samples // 3, 1, 2), 2.0)
    plans = np.array([[2.0 * gait.stroke, gait.cycle_time], [1.1 * gait.stroke, gait.cycle_time]])
    library = TorqueLibrary(TorqueLibrary.Config())
    library.reset(replace(setup, learnt={"plans": plans, "torque_0": far, "torque_1": near}))
    assert_array_equal(library.torque, np.full((samples, 1, 2), 2.0))
    learnt = library.learnt()
    assert_allclose(learnt["plans"], [*plans, [gait.stroke, gait.cycle_time]])
    assert_array_equal(learnt["torque_0"], far)
    again = TorqueLibrary(TorqueLibrary.Config())
    again.reset(replace(setup, learnt={**learnt, "torque_2": 3.0 * learnt["torque_2"]}))
    assert_array_equal(again.torque, 3.0 * learnt["torque_2"])
    assert len(again.learnt()["plans"]) == 3


def test_the_library_returns_to_its_best_cycle(make_config):
    scenario = make_scenario(make_config(*LEG, METHODS["torque_library"]))
    library = scenario.feedforward
    library.best[:], library.least, library.error = 1.0, 1.0, 2.0
    library.torque[:], library.seen, library.acted = 5.0, len(library.torque), True
    library._end_cycle()
    assert_array_equal(library.torque, np.ones_like(library.torque))


@pytest.mark.parametrize("overrides", [("scenario=force_step",), pytest.param(("scenario=robot",), marks=ROBOT)])
def test_slotine_and_li_refuse_what_has_no_planar_legs(make_config, overrides):
    with pytest.raises(BadInput, match="planar legs") as raised:
        make_scenario(make_config(*overrides, *SLOTINE_LI, "learning=lasting"))
    assert "\n" not in str(raised.value)


def test_a_cycle_is_resampled_along_any_axis():
    values = np.random.default_rng(0).normal(size=(2, 6, 3))
    assert_array_equal(resample(values, 12, axis=1)[:, ::2], values)
    assert_array_equal(resample(values, 3, axis=1), values[:, ::2])
