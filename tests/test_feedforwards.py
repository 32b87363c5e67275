"""Feedforwards beside the CMAC: their laws, what they learn, and that both loops give the same bits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.control.feedforward_law import Smoothing, smooth
from cmacexp.control.iterative import gaussian_taps
from cmacexp.errors import BadInput
from cmacexp.rollout import roll_out
from cmacexp.scenario import make_scenario

LEARNING = ["ilc"]


def transfer_error(rollout, cycle):
    """Root mean square distance of the foot of leg 1 from its plan in transfer, m."""
    plan, samples = rollout.plan, len(rollout.plan.support)
    columns, window = rollout.columns(), slice((cycle - 1) * samples, cycle * samples)
    transfer = ~plan.support[:, 0]
    away = np.stack([columns[name][window, 0] - plan.desired[:, 0, j] for j, name in enumerate("xy")])[:, transfer]
    return float(np.sqrt((away**2).sum(axis=0).mean()))


@pytest.mark.parametrize("scenario", ["one_leg", "quadruped"])
@pytest.mark.parametrize("name", LEARNING)
def test_both_loops_give_the_same_bits(make_config, name, scenario):
    config = make_config(f"scenario={scenario}", f"feedforward={name}", "cycles=4", "learning.lead=1")
    fused, stepped = (roll_out(make_scenario(config), fused=fused) for fused in (True, False))
    assert_array_equal(fused.samples, stepped.samples)


@pytest.mark.parametrize(("scenario", "cycles", "least"), [("one_leg", 20, 10.0), ("quadruped", 40, 10.0)])
@pytest.mark.parametrize("name", LEARNING)
def test_errors_fall_below_a_tenth_of_feedback_alone(make_config, name, scenario, cycles, least):
    common = (f"scenario={scenario}", "reference=aware", "learning.lead=1", f"cycles={cycles}")
    alone = roll_out(make_scenario(make_config(*common, "feedforward=none")))
    learnt = roll_out(make_scenario(make_config(*common, f"feedforward={name}")))
    assert learnt.status == "completed"
    assert transfer_error(learnt, cycles) < transfer_error(alone, cycles) / least


@pytest.mark.parametrize("cutoff", [5.0, 20.0, 40.0])
def test_gain_of_the_low_pass_is_at_most_one_and_as_given_at_the_cutoff(cutoff):
    taps, period = gaussian_taps(cutoff, 0.005), 0.005

    def gain(hertz):
        return taps[0] + 2.0 * np.sum(taps[1:] * np.cos(2.0 * np.pi * hertz * period * np.arange(1, len(taps))))

    assert gain(0.0) == pytest.approx(1.0)
    assert all(abs(gain(hertz)) <= 1.0 for hertz in np.linspace(0.0, 100.0, 50))
    # Samples of a Gaussian that is cut off, as against the whole one, are off by little.
    assert gain(cutoff) == pytest.approx(np.sqrt(0.5), abs=0.02)


def test_a_cutoff_far_above_the_sampling_changes_nothing():
    assert_array_equal(gaussian_taps(1e6, 0.005), [1.0])


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


@pytest.mark.parametrize(("change", "said"), [("feedforward.cutoff=0", "must be above 0")])
def test_what_cannot_be_is_refused_in_a_line(make_config, change, said):
    with pytest.raises(BadInput, match=change.replace(".", r"\.")) as raised:
        make_config("feedforward=ilc", change)
    assert said in str(raised.value)
