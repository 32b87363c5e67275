"""By how much feedback is late: delays and first-order lags of actuator and sensors; the gain that this allows."""

import math
from typing import NamedTuple

SCANNED, BISECTIONS = 1000, 50
"""Steps of the search for a frequency."""


def first_order_share(lag: float, sampling_period: float) -> float:
    """Part of its way to a constant input that a first-order lag goes in a sample, 1 - exp(-T_s/lag); 1 without."""
    return 1.0 - math.exp(-sampling_period / lag) if lag > 0.0 else 1.0


class LoopDelay(NamedTuple):
    """What delays the feedback of a torque, besides the sample that passes until the next reading."""

    delay: int = 0
    """Delays of actuator and sensors, samples."""
    lags: tuple[float, ...] = ()
    """Time constants of the lags of actuator and sensors, s; each above 0."""

    def count_samples(self, sampling_period: float) -> int:
        """Whole samples by which feedback is late: through a lag, until it contains half of what caused it."""
        return self.delay + int(math.log(2.0) * sum(self.lags) / sampling_period)

    def _find_phase_and_gain(self, angle: float, sampling_period: float) -> tuple[float, float]:
        """Phase below -90 degrees of velocity feedback of a mass at ``angle`` rad a sample, and its gain inverted."""
        phase, gain = angle * (self.delay + 0.5), 2.0 * math.sin(angle / 2.0)
        for lag in self.lags:
            share = first_order_share(lag, sampling_period)
            real, imaginary = 1.0 - (1.0 - share) * math.cos(angle), (1.0 - share) * math.sin(angle)
            phase, gain = phase + math.atan2(imaginary, real), gain * math.hypot(real, imaginary) / share
        return phase, gain

    def find_critical_gain(self, sampling_period: float) -> float:
        """Velocity feedback of a free mass, over what stops it within a sample, from which on the loop is unstable.

        Of the loop gain z^-delay / (z - 1) and of each lag share z / (z - 1 + share), where its phase falls to -180
        degrees: 2 without lateness, 2 sin(pi / (4 delay + 2)) with delays alone.
        """
        low, high = 0.0, math.pi
        for step in range(1, SCANNED):  # the phase of a lag falls again, so that it may pass -180 degrees twice
            angle = math.pi * step / SCANNED
            if self._find_phase_and_gain(angle, sampling_period)[0] >= math.pi / 2.0:
                high = angle
                break
            low = angle
        for _ in range(BISECTIONS):
            middle = (low + high) / 2.0
            beyond = self._find_phase_and_gain(middle, sampling_period)[0] >= math.pi / 2.0
            low, high = (low, middle) if beyond else (middle, high)
        return self._find_phase_and_gain(high, sampling_period)[1]


def add_delays(*stages: tuple[int, float]) -> LoopDelay:
    """The lateness of ``stages``, each a delay in samples and the time constant of a lag in s; 0 for none."""
    return LoopDelay(sum(delay for delay, _ in stages), tuple(lag for _, lag in stages if lag > 0.0))
