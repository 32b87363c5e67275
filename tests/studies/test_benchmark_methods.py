"""Methods of the benchmark: each learns, goes on from what it has learnt, and computes what its source says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import BadInput, Leg, gaussian_taps, inverse_dynamics, make_scenario, package_models, trigonometry
from support.rollout import roll_out

from cmacexp.control import Reference
from cmacexp.feedforward import InverseDynamics
from pipelines.benchmark.methods.adaptive import MODEL, make_gains, make_regressor
from pipelines.benchmark.methods.norm_optimal import NormOptimal
from pipelines.benchmark.methods.repetitive import Repetitive
from pipelines.benchmark.methods.slotine_li import motion_regressor

FOLDER = "pipelines.benchmark.methods"
METHODS = {
    "norm_optimal": f"feedforward._target_={FOLDER}.norm_optimal.NormOptimal",
    "fourier": f"feedforward._target_={FOLDER}.fourier.RandomFourier",
    "adaptive": f"feedforward._target_={FOLDER}.adaptive.AdaptiveRegressor",
    "repetitive": f"feedforward._target_={FOLDER}.repetitive.Repetitive",
    "identified": f"feedforward._target_={FOLDER}.identified.Identified",
}
SLOTINE_LI = (f"controller._target_={FOLDER}.slotine_li.SlotineLi", "feedforward=none")
LEG = ("scenario=one_leg", "reference=aware", "learning=lasting", "learning.guard=none")
HEAVY = (*LEG, "plant.mass_factor=1.2", "cycles=6")
"""The leg is heavier than its controllers know, all along."""
# The extra robots downloads other people's models, which CI does without; the planar machines are tested there.
ROBOT = pytest.mark.skipif(not package_models(), reason="needs the models of robots")


@pytest.fixture(scope="module")
def of(make_config):
    """``of(*overrides)`` gives a scenario."""
    return lambda *overrides: make_scenario(make_config(*overrides))


@pytest.fixture(scope="module")
def leg(of):
    """The setup of the leg."""
    return of(*LEG, "feedforward=none").setup


# Whole runs


def transfer_error(rollout):
    """Root mean square distance of the foot of leg 1 from its plan in transfer in the last cycle, m."""
    plan, columns = rollout.plan, rollout.columns()
    last, transfer = slice(-len(plan.support), None), ~plan.support[:, 0]
    away = [columns[name][last, 0] - plan.desired[:, 0, j] for j, name in enumerate("xy")]
    return float(np.sqrt((np.stack(away)[:, transfer] ** 2).sum(axis=0).mean()))


@pytest.fixture(scope="module")
def alone(of):
    return transfer_error(roll_out(of(*HEAVY, "feedforward=none")))


@pytest.fixture(scope="module")
def learnt(of):
    """Error of each after some cycles, and what it has learnt."""
    scenarios = {name: of(*HEAVY, method) for name, method in METHODS.items()}
    return {name: (transfer_error(roll_out(each)), each.feedforward.learnt()) for name, each in scenarios.items()}


@pytest.mark.ci
def test_slotine_and_li_adapt_to_an_unknown_mass_without_a_feedforward(of, alone):
    rollout = roll_out(of(*HEAVY, *SLOTINE_LI))
    assert transfer_error(rollout) < 0.4 * alone
    torque = rollout.columns()["tau_feedforward_1"].reshape(-1, len(rollout.plan.support))
    assert not torque[0].any()  # before learning.start_cycle
    assert torque[1:].any(axis=1).all()


@pytest.mark.ci
def test_least_squares_find_masses_and_ground_that_are_wrong(of):
    """On a path without jumps, from two cycles of feedback only; the factor of the contact force stays 1."""
    smooth = (*LEG, METHODS["identified"], "+feedforward.prior=1e-3", "gait.vertical=two_cubics", "cycles=4")
    scenario = of(*smooth, "terrain.stiffness=15", "terrain.assumed_stiffness=10", "plant.mass_factor=1.2")
    roll_out(scenario)
    inertia, gravity, contact, *_ = scenario.feedforward.learnt()["parameters"][0]
    assert_allclose(gravity, 1.2, rtol=0.02)
    assert_allclose(contact, 1.0, rtol=0.05)
    assert_allclose(inertia, 1.2, rtol=0.2)


# Equations


def test_norm_optimal_solves_its_normal_equations():
    method = NormOptimal(NormOptimal.Config(gain=1.0, penalty=0.2))
    real, imaginary = np.random.default_rng(0).normal(size=(2, 3, 2, 2))
    model, feedback = real + 1j * imaginary, np.array([0.3, -1.0])
    change = method._invert(model) @ feedback
    left = feedback - (model @ change[..., None])[..., 0]
    gradient = (model.conj().swapaxes(1, 2) @ left[..., None])[..., 0] - 0.2 * change
    assert_allclose(gradient, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "overrides",
    [LEG, ("scenario=quadruped_lasting",),
     pytest.param(("scenario=robot", "machine=go1"), marks=[ROBOT, pytest.mark.ci])],
)  # fmt: skip
def test_the_nominal_parameters_of_the_regressor_give_the_inverse_dynamics(of, overrides):
    setup = of(*overrides, "feedforward=none").setup
    regressor = make_regressor(setup)
    exact = InverseDynamics(InverseDynamics.Config(1.0, 1.0)).compute_torque(setup)
    assert_allclose(regressor[..., :4] @ MODEL, exact, atol=1e-9)
    power = np.einsum("kijp,kijq->ipq", regressor, regressor) / len(regressor)
    eigenvalues = np.linalg.eigvals(make_gains(regressor) @ power).real
    assert eigenvalues.max() <= 1.0 + 1e-6  # so that no gain up to 2 diverges over cycles
    assert eigenvalues.min() > -1e-6


def test_the_regressor_of_the_motion_gives_the_inverse_dynamics_and_wastes_no_power():
    chance, still = np.random.default_rng(1), np.zeros(2)
    for _ in range(20):
        (q, dq, ddq, v), (m1, m2) = chance.normal(size=(4, 2)), chance.uniform(0.1, 2.0, 2)

        def regress(*motion):
            return np.array(motion_regressor((0.35, 0.3), *motion))

        def energy(angles, v=v):
            return (regress(angles, still, still, v) - regress(angles, still, still, still)) @ v

        expected = inverse_dynamics(Leg(0.35, 0.3, m1, m2, 1.0), trigonometry(*q), *dq, *ddq, 0.0)
        assert_allclose([m1 + m2, m2] @ regress(q, dq, dq, ddq), expected, atol=1e-12)
        # v^T (dM/dt - 2 C) v = 0, which makes the error energy fall by s^T K_D s alone.
        coriolis = (regress(q, dq, v, still) - regress(q, dq, still, still)) @ v
        rate = (energy(q + 1e-6 * dq) - energy(q - 1e-6 * dq)) / 2e-6
        assert_allclose(rate, 2.0 * coriolis, atol=1e-6)


def test_repetitive_control_is_its_equation(leg):
    """u(k) = Q [u(k - N) + gain U(k - N + lead)], by sums over all samples of three cycles."""
    method, samples = Repetitive(Repetitive.Config(gain=0.3, cutoff=20.0)), len(leg.plan.support)
    method.reset(replace(leg, lead=2))
    feedback = np.random.default_rng(0).normal(size=(3 * samples, 1, 2))
    played = np.zeros_like(feedback)
    for k in range(len(feedback)):
        reference = Reference(k, k % samples, True, *[None] * 5)
        played[k] = method.predict(reference, feedback[k - 1] if k else np.zeros((1, 2)))
    taps = gaussian_taps(20.0, 0.005, samples)
    for k in (2 * samples, 2 * samples + 1, 2 * samples + 300, 3 * samples - 1):
        around = [(taps[abs(j)], k - samples + j) for j in range(1 - len(taps), len(taps))]
        expected = sum(tap * (played[before] + 0.3 * feedback[before + 2]) for tap, before in around)
        assert_allclose(played[k], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("overrides", "key"),
    [
        ((*LEG, METHODS["repetitive"], "+feedforward.cutoff=0.1"), r"feedforward\.cutoff"),  # as long as the cycle
        (("scenario=force_step", *SLOTINE_LI, "learning=lasting"), "planar legs"),
        pytest.param(
            ("scenario=robot", *SLOTINE_LI, "learning=lasting"), "planar legs", marks=[ROBOT, pytest.mark.ci]
        ),
    ],
)
def test_a_machine_or_setting_that_a_method_cannot_use_is_refused(of, overrides, key):
    with pytest.raises(BadInput, match=key):
        of(*overrides)
