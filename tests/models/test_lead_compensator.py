"""The LEAD compensator in discrete time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmacexp.models.lead import discretise


@given(st.floats(0.5, 50.0), st.floats(1.0, 30.0), st.floats(1e-4, 2e-2), st.floats(0.01, 0.9))
def test_at_a_frequency_it_is_the_analogue_at_the_warped_frequency(omega, alpha, period, of_nyquist):
    frequency = of_nyquist * math.pi / period
    s = 2j / period * math.tan(frequency * period / 2.0)
    lead, delay = discretise(omega, alpha, period), np.exp(-1j * frequency * period)
    found = (lead.b0 + lead.b1 * delay) / (1.0 + lead.a1 * delay)
    assert found == pytest.approx((1.0 + s / omega) / (1.0 + s / (alpha * omega)), rel=1e-9)
