"""The lateness of feedback: delays and first-order lags of actuator and sensors; the gain that this allows."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SCANNED, BISECTIONS = 1000, 50
"""Steps of the search for a frequency."""


def first_order_share(lag: float, sampling_period: float) -> float:
    """Part of its way to a constant input that a first-order lag goes in a sample, 1 - exp(-T_s/lag); 1 without."""
    return 1.0 - math.exp(-sampling_period / lag) if lag > 0.0 else 1.0


def _bisect(low: float, high: float, is_beyond: Callable[[float], bool]) -> float:
    """The least argument from ``low`` to ``high`` from which on a condition holds."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return high


class Margin(NamedTuple):
    """How much more delay a loop bears."""

    crossover: float
    """Angular frequency at which the gain of the loop is 1, rad/s."""
    delay: float
    """Further delay that makes the loop unstable, s."""


class LoopDelay(NamedTuple):
    """What delays the feedback of a torque, besides the sample that passes until the next reading."""

    delay: int = 0
    """Delays of actuator and sensors, samples."""
    lags: tuple[float, ...] = ()
    """Time constants of the lags of actuator and sensors, s; each above 0."""
    latency: float = 0.0
    """Delay that is declared and simulated by none of them, s."""

    def count_samples(self, sampling_period: float) -> int:
        """Whole samples by which feedback is late: through a lag, until it contains half of what caused it."""
        declared = int(self.latency / sampling_period + 0.5)
        return self.delay + declared + int(math.log(2.0) * sum(self.lags) / sampling_period)

    def _find_phase_and_gain(self, angle: float, sampling_period: float) -> tuple[float, float]:
        """Phase below -90 degrees of velocity feedback of a mass at ``angle`` rad a sample, and its gain inverted."""
        phase = angle * (self.delay + self.latency / sampling_period + 0.5)
        gain = 2.0 * math.sin(angle / 2.0)
        for lag in self.lags:
            share = first_order_share(lag, sampling_period)
            real, imaginary = 1.0 - (1.0 - share) * math.cos(angle), (1.0 - share) * math.sin(angle)
            phase, gain = phase + math.atan2(imaginary, real), gain * math.hypot(real, imaginary) / share
        return phase, gain

    def respond(self, s: NDArray[Any], sampling_period: float) -> NDArray[Any]:
        """Frequency response of what delays feedback at ``s``, j times rad/s; a torque is held for a sample.

        It has no unit, and the shape of ``s``, which may be any, as (n,); ``sampling_period`` is in s.
        """
        response = np.exp(-s * (sampling_period * (self.delay + 0.5) + self.latency))
        shift = np.exp(-s * sampling_period)
        for lag in self.lags:
            share = first_order_share(lag, sampling_period)
            response = response * share / (1.0 - (1.0 - share) * shift)
        return response

    def find_critical_gain(self, sampling_period: float) -> float:
        """Velocity feedback of a free mass, over what stops it within a sample, from which on the loop is unstable.

        Of the loop gain z^-delay / (z - 1) and of each lag share z / (z - 1 + share), where its phase falls to -180
        degrees: 2 without lateness, 2 sin(pi / (4 delay + 2)) with delays alone.
        """

        def is_beyond(angle: float) -> bool:
            return self._find_phase_and_gain(angle, sampling_period)[0] >= math.pi / 2.0

        # The phase of a lag falls again, so that it may pass -180 degrees twice.
        first = next((step for step in range(1, SCANNED) if is_beyond(math.pi * step / SCANNED)), SCANNED)
        angle = _bisect(math.pi * (first - 1) / SCANNED, math.pi * first / SCANNED, is_beyond)
        return self._find_phase_and_gain(angle, sampling_period)[1]

    def find_margin(self, gain: float, sampling_period: float) -> Margin:
        """The margin of velocity feedback with a ``gain`` below the critical one, likewise over what stops a mass."""
        angle = _bisect(0.0, math.pi, lambda angle: self._find_phase_and_gain(angle, sampling_period)[1] >= gain)
        phase, _ = self._find_phase_and_gain(angle, sampling_period)
        return Margin(angle / sampling_period, (math.pi / 2.0 - phase) / angle * sampling_period)


def find_drive_margin(inertia: float, stiffness: float, damping: float, lag: float) -> Margin:
    """The margin of a drive that closes the loop of a joint by itself, continuously, behind a lag of its torque in s.

    Its loop gain is (K + D s) / (J s^2 (1 + T s)): ``inertia`` J in kg m^2, K in N m/rad, D, above T K, in N m s/rad.
    """
    rate = _bisect(
        0.0,
        damping / inertia + math.sqrt(stiffness / inertia),
        lambda rate: math.hypot(stiffness, damping * rate) <= inertia * rate * rate * math.hypot(1.0, lag * rate),
    )
    return Margin(rate, (math.atan(damping * rate / stiffness) - math.atan(lag * rate)) / rate)


def add_delays(*stages: tuple[int, float], latency: float = 0.0) -> LoopDelay:
    """The lateness of ``stages``, each a delay in samples and the time constant of a lag in s, 0 for none.

    A ``latency`` in s is added that is only declared.
    """
    lags = tuple(lag for _, lag in stages if lag > 0.0)
    return LoopDelay(sum(delay for delay, _ in stages), lags, latency)
