"""The design of the LEAD compensator: resonance and bandwidth of the closed loop."""

import math

import numpy as np
import pytest
from scipy import signal

from pipelines.lead_design import closed_loop


@pytest.mark.parametrize(("omega", "alpha", "mass"), [(2.0, 10.0, 0.75), (10.0, 3.0, 1.5), (40.0, 30.0, 0.3)])
def test_the_closed_loop_agrees_with_a_frequency_response_computed_otherwise(omega, alpha, mass):
    compensator = signal.ZerosPolesGain([-omega], [-alpha * omega], alpha)
    controlled = signal.ZerosPolesGain([-20.0], [0.0, 0.0], 5.0 / mass)  # (100 + 5 s) / (mass s^2)
    frequencies = np.geomspace(0.1, 1e4, 50_001)
    opened = signal.freqresp(compensator, frequencies)[1] * signal.freqresp(controlled, frequencies)[1]
    magnitude = np.abs(opened / (1.0 + opened))
    loop = closed_loop(100.0, 5.0, mass, omega, alpha)
    assert loop["stable"]
    assert not closed_loop(100.0, 0.0, 0.75, omega, 0.5)["stable"]
    assert loop["resonance"] == pytest.approx(magnitude.max(), rel=1e-4)
    assert loop["bandwidth"] == pytest.approx(frequencies[magnitude >= math.sqrt(0.5)].max(), rel=3e-3)
