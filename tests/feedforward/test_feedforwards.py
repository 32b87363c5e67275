"""Feedforwards beside the CMAC: their laws, what they learn, and that both loops give the same bits."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.rollout import roll_out

from cmacexp.errors import BadInput
from cmacexp.feedforward.ilc import WIDEST, gaussian_taps
from cmacexp.feedforward.kernels import Smoothing, smooth
from cmacexp.feedforward.rbf import activations, spacing, spread_out
from cmacexp.loop.scenario import make_scenario

FUSED = ["ilc", "rbf"]
PERCEPTRON = "feedforward._target_=pipelines.perceptron.Perceptron"


def transfer_error(rollout, cycle):
    """Root mean square distance of the foot of leg 1 from its plan in transfer, m."""
    plan, samples = rollout.plan, len(rollout.plan.support)
    columns, window = rollout.columns(), slice((cycle - 1) * samples, cycle * samples)
    transfer = ~plan.support[:, 0]
    away = np.stack([columns[name][window, 0] - plan.desired[:, 0, j] for j, name in enumerate("xy")])[:, transfer]
    return float(np.sqrt((away**2).sum(axis=0).mean()))


@pytest.mark.parametrize(("scenario", "cycles", "least"), [("one_leg", 20, 10.0), ("quadruped", 40, 10.0)])
@pytest.mark.parametrize("name", FUSED)
def test_errors_fall_below_a_tenth_of_feedback_alone(make_config, name, scenario, cycles, least):
    common = (f"scenario={scenario}", "reference=aware", "learning.lead=1", f"cycles={cycles}")
    alone = roll_out(make_scenario(make_config(*common, "feedforward=none")))
    learnt = roll_out(make_scenario(make_config(*common, f"feedforward={name}")))
    assert learnt.status == "completed"
    assert transfer_error(learnt, cycles) < transfer_error(alone, cycles) / least


@pytest.mark.parametrize("cutoff", [5.0, 20.0, 40.0])
def test_gain_of_the_low_pass_is_at_most_one_and_as_given_at_the_cutoff(cutoff):
    taps, period = gaussian_taps(cutoff, 0.005, 600), 0.005

    def gain(hertz):
        return taps[0] + 2.0 * np.sum(taps[1:] * np.cos(2.0 * np.pi * hertz * period * np.arange(1, len(taps))))

    assert gain(0.0) == pytest.approx(1.0)
    assert all(abs(gain(hertz)) <= 1.0 for hertz in np.linspace(0.0, 100.0, 50))
    # Samples of a Gaussian that is cut off, as against the whole one, are off by little.
    assert gain(cutoff) == pytest.approx(np.sqrt(0.5), abs=0.02)


def test_a_cutoff_far_above_the_sampling_changes_nothing():
    assert_array_equal(gaussian_taps(1e6, 0.005, 600), [1.0])


@pytest.mark.parametrize("samples", [600, 601])
def test_a_low_pass_far_wider_than_a_cycle_is_the_mean_over_it(samples):
    """As given by the Gaussian that is a little narrower; its taps are no more, however low the cutoff."""
    before = np.random.default_rng(0).normal(size=(samples, 2))
    limit = np.sqrt(np.log(2.0)) / (2.0 * np.pi * 0.005 * WIDEST * samples)
    for cutoff, near in ((1.001 * limit, 1e-3), (0.999 * limit, 1e-12), (1e-300, 1e-12)):
        taps = gaussian_taps(cutoff, 0.005, samples)
        assert len(taps) <= 1 + 4.0 * WIDEST * samples
        filtered = np.zeros_like(before)
        for j in range(-len(taps) + 1, len(taps)):
            filtered += taps[abs(j)] * np.roll(before, j, axis=0)
        if len(taps) == samples // 2 + 1 and samples % 2 == 0:
            assert taps[-1] == taps[0] / 2.0
        assert_allclose(filtered, np.broadcast_to(before.mean(axis=0), before.shape), atol=near)


def test_weights_are_smoothed_as_a_ring():
    weights = np.zeros((6, 2))
    weights[0], weights[3] = (1.0, 0.0), (0.0, 8.0)
    smooth(weights, Smoothing(np.array([0.5, 0.25]), np.zeros(6)))
    assert_allclose(weights[:, 0], [0.5, 0.25, 0.0, 0.0, 0.0, 0.25])
    assert_allclose(weights[:, 1], [0.0, 0.0, 2.0, 4.0, 2.0, 0.0])


def test_low_pass_bounds_what_the_paper_s_law_lets_grow(make_config):
    """Without lead the errors of a cycle grow into the next above 20 Hz; Q takes away more than they grow."""
    common = ("scenario=one_leg", "reference=aware", "cycles=400", "feedforward=ilc")
    bounded = roll_out(make_scenario(make_config(*common)))
    assert transfer_error(bounded, 400) < 1e-3
    growing = roll_out(make_scenario(make_config(*common, "feedforward.cutoff=null")))
    assert growing.status == "diverged" or transfer_error(growing, 400) > 10.0 * transfer_error(bounded, 400)


def test_centres_are_spread_over_points():
    points = np.array([[0.0], [0.1], [0.9], [1.0], [0.5]])
    assert_array_equal(spread_out(points, 3), [[0.0], [1.0], [0.5]])
    assert spacing(np.array([[0.0], [1.0], [3.0]])) == pytest.approx((1.0 + 1.0 + 2.0) / 3.0)
    assert spacing(np.zeros((3, 2))) == spacing(np.zeros((1, 2))) == 1.0


def test_activations_by_hand():
    cells, activation = activations(np.array([[0.25], [1e6]]), np.array([[0.0], [1.0], [9.0]]), 0.5, 2)
    assert_array_equal(cells, [[0, 1], [2, 1]])
    near, far = np.exp(-(0.25**2) / 0.5), np.exp(-(0.75**2) / 0.5)
    assert_allclose(activation, [[near / (near + far), far / (near + far)], [1.0, 0.0]])


def test_perceptron_without_its_library_says_how_to_get_it(make_config, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    with pytest.raises(BadInput) as raised:
        make_scenario(make_config(PERCEPTRON))
    assert 'python -m pip install -e ".[networks]"' in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_wrong_model_errs_in_what_it_has_wrong(make_config):
    """Torque is linear in both masses together; the contact force has no part in that."""
    common = ("scenario=one_leg", "feedforward=inverse_dynamics")
    exact, heavy, long = (
        make_scenario(make_config(*common, change)).feedforward.params.torque
        for change in ("seed=0", "feedforward.mass_factor=1.2", "feedforward.length_factor=1.1")
    )
    scenario = make_scenario(make_config(*common, "terrain.stiffness=0.001", "terrain.assumed_stiffness=10"))
    assert_allclose(exact, scenario.feedforward.params.torque)  # goes by the ground that is assumed
    light = make_scenario(make_config(*common, "feedforward.mass_factor=0.8")).feedforward.params.torque
    assert_allclose(heavy - exact, exact - light, atol=1e-12)
    assert np.abs(heavy - exact).max() > 0.1
    assert np.abs(long - exact).max() > 0.1
