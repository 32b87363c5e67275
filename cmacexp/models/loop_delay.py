"""Delay of the feedback, by dead times and first-order lags of actuator and sensors, and the gain that it allows."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SCANNED = 1000
"""Frequencies up to the Nyquist frequency at which a crossing is looked for."""
BISECTIONS = 50
"""Bisections of the interval that contains it."""


def first_order_share(lag: float, sampling_period: float) -> float:
    """Return the fraction 1 - exp(-T_s/lag) of a step that a first-order lag follows in a sample; 1 without lag."""
    return 1.0 - math.exp(-sampling_period / lag) if lag > 0.0 else 1.0


def _bisect(low: float, high: float, is_beyond: Callable[[float], bool]) -> float:
    """Find the least argument from ``low`` to ``high`` from which on ``is_beyond`` holds."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return high


class Margin(NamedTuple):
    """Delay margin of a loop."""

    crossover: float
    """Angular frequency at which the gain of the loop is 1, rad/s."""
    delay: float
    """Additional delay that makes the loop unstable, s."""


class LoopDelay(NamedTuple):
    """Delays in the feedback of a torque, in addition to the sample until the next reading."""

    delay: int = 0
    """Dead times of actuator and sensors, samples."""
    lags: tuple[float, ...] = ()
    """Time constants of the lags of actuator and sensors, s; each above 0."""
    latency: float = 0.0
    """Delay that is declared, but simulated by neither actuator nor sensors, s."""

    def count_samples(self, sampling_period: float) -> int:
        """Return the delay of the feedback in whole samples.

        A lag counts as the time after which its output reaches half of a step at its input.
        """
        declared = int(self.latency / sampling_period + 0.5)
        return self.delay + declared + int(math.log(2.0) * sum(self.lags) / sampling_period)

    def _find_phase_and_gain(self, angle: float, sampling_period: float) -> tuple[float, float]:
        """Compute the phase lag beyond 90 degrees, rad, and the inverse of the gain of velocity feedback of a mass.

        ``angle`` is the frequency in rad per sample.
        """
        phase = angle * (self.delay + self.latency / sampling_period + 0.5)
        gain = 2.0 * math.sin(angle / 2.0)
        for lag in self.lags:
            share = first_order_share(lag, sampling_period)
            real, imaginary = 1.0 - (1.0 - share) * math.cos(angle), (1.0 - share) * math.sin(angle)
            phase += math.atan2(imaginary, real)
            gain = gain * math.hypot(real, imaginary) / share
        return phase, gain

    def respond(self, s: NDArray[Any], sampling_period: float) -> NDArray[Any]:
        """Compute the frequency response of the delays at ``s``, j times rad/s, with torques held for a sample.

        The response has no unit, and the shape of ``s``, which may be any, such as (n,); ``sampling_period`` is in
        s.
        """
        response = np.exp(-s * (sampling_period * (self.delay + 0.5) + self.latency))
        shift = np.exp(-s * sampling_period)
        for lag in self.lags:
            share = first_order_share(lag, sampling_period)
            response = response * share / (1.0 - (1.0 - share) * shift)
        return response

    def find_critical_gain(self, sampling_period: float) -> float:
        """Find the gain of velocity feedback of a free mass from which on the loop is unstable.

        The gain is relative to the one that stops the mass within a sample. It is found where the phase of the loop
        gain z^-delay / (z - 1), times share z / (z - 1 + share) for each lag, falls to -180 degrees: 2 without any
        delay, 2 sin(pi / (4 delay + 2)) with dead times only.
        """

        def is_beyond(angle: float) -> bool:
            return self._find_phase_and_gain(angle, sampling_period)[0] >= math.pi / 2.0

        # The phase of a lag falls again, so that it may pass -180 degrees twice.
        first = next((step for step in range(1, SCANNED) if is_beyond(math.pi * step / SCANNED)), SCANNED)
        angle = _bisect(math.pi * (first - 1) / SCANNED, math.pi * first / SCANNED, is_beyond)
        return self._find_phase_and_gain(angle, sampling_period)[1]

    def find_margin(self, gain: float, sampling_period: float) -> Margin:
        """Find the delay margin of velocity feedback of a free mass with a ``gain`` below the critical one.

        ``gain`` is relative to the one that stops the mass within a sample; ``sampling_period`` is in s.
        """
        angle = _bisect(0.0, math.pi, lambda angle: self._find_phase_and_gain(angle, sampling_period)[1] >= gain)
        phase, _ = self._find_phase_and_gain(angle, sampling_period)
        return Margin(angle / sampling_period, (math.pi / 2.0 - phase) / angle * sampling_period)


def find_drive_margin(inertia: float, stiffness: float, damping: float, lag: float) -> Margin:
    """Find the delay margin of a drive that closes a continuous loop around its joint, behind a lag of its torque.

    The loop gain is (K + D s) / (J s^2 (1 + T s)): ``inertia`` J in kg m^2, ``stiffness`` K in N m/rad, ``damping``
    D, above T K, in N m s/rad, ``lag`` T in s.
    """
    rate = _bisect(
        0.0,
        damping / inertia + math.sqrt(stiffness / inertia),
        lambda rate: math.hypot(stiffness, damping * rate) <= inertia * rate * rate * math.hypot(1.0, lag * rate),
    )
    return Margin(rate, (math.atan(damping * rate / stiffness) - math.atan(lag * rate)) / rate)


def add_delays(*stages: tuple[int, float], latency: float = 0.0) -> LoopDelay:
    """Add up the delays of ``stages``: each a dead time in samples and the time constant of a lag in s, or 0.

    ``latency``, s, is a further delay that is only declared.
    """
    lags = tuple(lag for _, lag in stages if lag > 0.0)
    return LoopDelay(sum(delay for delay, _ in stages), lags, latency)
