"""Rates of the body, and posture control's own derivative."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.scenario import make_scenario


@pytest.mark.parametrize("substeps", [1, 3])
def test_rates_of_a_body_are_its_change_over_the_sampling_period(make_config, substeps):
    scenario = make_scenario(make_config("scenario=quadruped", f"plant.substeps={substeps}"))
    last, largest = scenario.first, 0.0
    assert_array_equal(last.body_rate, np.zeros(3))
    for k in range(20):
        new = scenario.plant.step(np.array([(-6.0, -1.5), (-6.5, -1.2), (6.0, 1.5), (5.5, 1.8)]) * (1.0 + 0.01 * k))
        assert_allclose(new.body_rate, (new.body - last.body) / 0.005, rtol=1e-9, atol=1e-12)
        last, largest = new, np.maximum(np.abs(new.body_rate), largest)
    assert (largest > 1e-4).all()


@pytest.mark.parametrize("scenario", ["one_leg", "force_step"])
def test_without_a_body_nothing_has_a_rate(make_config, scenario):
    plant = make_scenario(make_config(f"scenario={scenario}")).plant
    assert_array_equal(plant.step(np.full((1, 2), 0.3)).body_rate, np.zeros(3))
