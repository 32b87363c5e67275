"""The LEAD compensator in discrete time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal

from cmacexp.models.lead import discretise, lead_step


@given(st.floats(0.5, 50.0), st.floats(1.0, 30.0), st.floats(1e-4, 2e-2), st.floats(0.01, 0.9))
def test_at_a_frequency_it_is_the_analogue_at_the_warped_frequency(omega, alpha, period, of_nyquist):
    frequency = of_nyquist * math.pi / period
    s = 2j / period * math.tan(frequency * period / 2.0)
    lead, delay = discretise(omega, alpha, period), np.exp(-1j * frequency * period)
    found = (lead.b0 + lead.b1 * delay) / (1.0 + lead.a1 * delay)
    assert found == pytest.approx((1.0 + s / omega) / (1.0 + s / (alpha * omega)), rel=1e-9)


@pytest.mark.parametrize(("omega", "alpha", "period"), [(5.0, 10.0, 0.005), (10.0, 3.0, 0.002), (7.0, 1.0, 0.01)])
def test_its_difference_equation_is_the_bilinear_filter(omega, alpha, period):
    continuous = [1.0 / omega, 1.0], [1.0 / (alpha * omega), 1.0]
    numerator, denominator, _ = signal.cont2discrete(continuous, period, method="bilinear")
    errors = np.random.default_rng(0).normal(size=200)
    lead, outputs = discretise(omega, alpha, period), [0.0]
    for error, last_error in zip(errors, [0.0, *errors], strict=False):
        outputs.append(lead_step(lead, error, last_error, outputs[-1]))
    assert_allclose(outputs[1:], signal.lfilter(numerator.ravel(), denominator, errors), rtol=1e-9, atol=1e-12)
