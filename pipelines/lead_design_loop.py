"""The position loop with a LEAD compensator: resonance, bandwidth and stability over its corner frequencies.

The loop is that of Lin & Song 1997, eq. 21, around a point mass in free space and in continuous time,
L(s) = (K_ap + K_av s) LEAD(s) / (M s^2). The bandwidth of the open loop is read as sqrt(K_ap / M).
"""

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.config.compose import compose_config
from cmacexp.study import Results
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

SCENARIOS = {"one leg": "one_leg", "the quadruped": "quadruped"}
OMEGAS, ALPHAS, POINTS = (0.2, 200.0), (1.0, 100.0), 30
"""Range of omega (rad/s) and of alpha in a scan, and points of each."""

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


def compute_loops(results: Results) -> "pd.DataFrame":
    """Loops with the gains of each scenario: with its own corner frequencies (``default``), and over a scan."""
    import pandas as pd

    rows = []
    for name, scenario in SCENARIOS.items():
        controller = compose_config([f"scenario={scenario}"]).controller
        gains = (controller.position_gain, controller.velocity_gain)
        open_bandwidth = open_loop_bandwidth(gains[0], EFFECTIVE_MASS)
        own = (controller.lead_omega, controller.lead_alpha)
        pairs = itertools.product(np.geomspace(*OMEGAS, POINTS), np.geomspace(*ALPHAS, POINTS))
        for index, (omega, alpha) in enumerate([own, *pairs]):
            loop = closed_loop(*gains, EFFECTIVE_MASS, omega, alpha)
            place = {"scenario": name, "default": index == 0, "omega": omega, "alpha": alpha}
            rows.append({**place, **loop._asdict(), "open_bandwidth": open_bandwidth})
    return pd.DataFrame(rows)
