"""The design of the LEAD compensator: resonance and bandwidth of the closed loop."""

import math

import numpy as np
import pytest
from scipy import signal

from pipelines.lead_design import closed_loop


@pytest.mark.parametrize(("gain", "omega", "alpha"), [(0.1, 0.1, 100.0), (1.0, 0.3, 50.0), (2.0, 1.0, 10.0)])
def test_the_closed_loop_agrees_with_a_frequency_response_computed_otherwise(gain, omega, alpha):
    opened = signal.ZerosPolesGain([-omega], [-alpha * omega, 0.0, 0.0], gain * alpha)
    frequencies = np.geomspace(1e-3, 1e3, 50_001)
    response = signal.freqresp(opened, frequencies)[1]
    magnitude = np.abs(response / (1.0 + response))
    loop = closed_loop(gain, omega, alpha)
    assert loop["excess"] == pytest.approx(magnitude.max() - 1.0, rel=2e-3)
    assert loop["bandwidth"] == pytest.approx(frequencies[magnitude >= math.sqrt(0.5)].max(), rel=2e-2)
    assert math.isinf(closed_loop(gain, omega, 0.5)["excess"])  # a lag makes the double integrator unstable
