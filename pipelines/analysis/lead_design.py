"""Which omega and alpha of the LEAD compensator meet the paper's objectives, and where the defaults stand.

Objectives (Lin & Song 1997, section 2): (a) the resonant magnitude M_p of the closed loop is below 110 %; (b) its
bandwidth is that of the open loop, read as sqrt(K_ap / M). The loop is that of eq. 21 around a point mass in free
space, L(s) = (K_ap + K_av s) LEAD(s) / (M s^2), in continuous time.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.typing import Array

EFFECTIVE_MASS = 0.75
"""Mass that the foot of the paper's leg moves, kg (assumed)."""
FREQUENCIES = np.logspace(-1.0, 4.0, 8_001)
"""rad/s; neighbours are 0.14 % apart."""


class Loop(NamedTuple):
    """A closed loop and how it meets the objectives."""

    resonance: float
    """M_p, largest magnitude of the closed loop."""
    bandwidth: float
    """Frequency at which the closed loop falls below -3 dB for good, rad/s."""
    stable: bool
    """Whether all closed-loop poles lie in the left half plane."""


def open_loop_bandwidth(position_gain: float, mass: float) -> float:
    """sqrt(K_ap / M), rad/s: the break frequency of the mass on its position gain alone (objective b)."""
    return float(np.sqrt(position_gain / mass))


def closed_loop(position_gain: float, velocity_gain: float, mass: float, omega: float, alpha: float) -> Loop:
    """Resonance, bandwidth and stability of the position loop.

    Args:
        position_gain: K_ap, N/m.
        velocity_gain: K_av, N s/m.
        mass: M, kg.
        omega: lower corner frequency of the LEAD, rad/s.
        alpha: upper over lower corner frequency.
    """
    feedback = np.polymul([velocity_gain, position_gain], [1.0 / omega, 1.0])
    inertia = np.polymul([mass, 0.0, 0.0], [1.0 / (alpha * omega), 1.0])
    closed = np.polyadd(feedback, inertia)
    s = 1j * FREQUENCIES
    magnitude: Array = np.abs(np.polyval(feedback, s) / np.polyval(closed, s))
    above = np.flatnonzero(magnitude >= np.sqrt(0.5))
    bandwidth = float(FREQUENCIES[above[-1]]) if len(above) else float("nan")
    return Loop(float(magnitude.max()), bandwidth, bool(np.roots(closed).real.max() < 0.0))
