"""Methods of the benchmark: each computes what its source says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import gaussian_taps, make_scenario, roll_out
from support.loops import require_same_bits
from support.robots import needs_models

from cmacexp.control import Reference
from cmacexp.feedforward import InverseDynamics
from pipelines.benchmark.methods.norm_optimal import NormOptimal
from pipelines.benchmark.methods.playing import Repetitive
from pipelines.benchmark.methods.regressor import MODEL, AdaptiveRegressor, make_gains, make_regressor

FOLDER = "pipelines.benchmark.methods"
METHODS = {
    "norm_optimal": f"feedforward._target_={FOLDER}.norm_optimal.NormOptimal",
    "repetitive": f"feedforward._target_={FOLDER}.playing.Repetitive",
    "identified": f"feedforward._target_={FOLDER}.regressor.Identified",
    "perceptron": "feedforward._target_=pipelines.perceptron.Perceptron",
}
LEG = ("scenario=one_leg", "reference=aware", "learning=lasting", "learning.guard=none")


@pytest.fixture(scope="module")
def of(make_config):
    """``of(*overrides)`` gives a scenario."""
    return lambda *overrides: make_scenario(make_config(*overrides))


@pytest.fixture(scope="module")
def leg(of):
    """The setup of the leg."""
    return of(*LEG, "feedforward=none").setup


# Whole runs


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


@pytest.mark.parametrize("target", [METHODS["norm_optimal"], METHODS["repetitive"], METHODS["perceptron"]])
def test_a_method_that_plays_has_the_bits_of_one_that_is_asked_in_every_step(of, target):
    short = ("gait.cycle_time=0.2", "gait.lift=0.005", "cycles=5", "learning.start_cycle=2")
    played, asked = (of(*LEG, target, *short) for _ in range(2))
    stepped = SimpleNamespace(acts=True, predict=asked.feedforward.predict)
    require_same_bits(roll_out(played), roll_out(replace(asked, feedforward=stepped)))


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
     pytest.param(("scenario=robot", "machine=go1"), marks=[needs_models, pytest.mark.ci])],
)  # fmt: skip
def test_the_regressor_gives_the_inverse_dynamics_and_its_parameters_follow_their_law(of, overrides):
    setup = of(*overrides, "feedforward=none").setup
    regressor = make_regressor(setup)
    nominal = InverseDynamics(InverseDynamics.Config(1.0, 1.0)).compute_torque(setup)
    assert_allclose(regressor[..., :4] @ MODEL, nominal, atol=1e-9)
    gains = make_gains(regressor) / len(regressor)
    eigenvalues = np.linalg.eigvals(gains @ np.einsum("kijp,kijq->ipq", regressor, regressor)).real
    assert eigenvalues.max() <= 1.0 + 1e-6  # so that no gain up to 2 diverges over cycles
    assert eigenvalues.min() > -1e-6
    method, feedback = AdaptiveRegressor(AdaptiveRegressor.Config(gain=0.5)), np.arange(1.0, 1.0 + nominal[0].size)
    method.reset(replace(setup, lead=2))
    torque = method.predict(Reference(9, 9, True, *[None] * 5), feedback.reshape(nominal[0].shape))
    change = np.einsum("ijp,ipq,imq,im->ij", regressor[9], gains, regressor[6], feedback.reshape(torque.shape))
    assert_allclose(torque, nominal[9] + 0.5 * change, atol=1e-9)


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
