"""Design of the LEAD compensator: omega and alpha that meet the paper's objectives (Lin & Song 1997, sec. 2, eq. 5).

``python -m pipelines.lead_design`` computes resonance and bandwidth of the closed loop over both; nothing is
simulated. The loop is that of eq. 21 around a point mass in free space and in continuous time,
L(s) = (K_ap + K_av s) LEAD(s) / (M s^2). The bandwidth of the open loop is taken as sqrt(K_ap / M).
"""

import itertools
from collections.abc import Callable

import numpy as np

from cmacexp.config.compose import compose_config
from cmacexp.study import Array, DataFrame, Declared, Figure, Panel, Results, Series, declare, draw

SCENARIOS = {"one leg": "one_leg", "quadruped": "quadruped"}
OMEGAS, ALPHAS = (0.2, 200.0), (1.0, 100.0)
"""Ranges of omega, rad/s, and of alpha in a scan."""
POINTS = 30
"""Points of a scan over omega, and over alpha."""
EFFECTIVE_MASS = 0.75
"""Effective mass at the foot of the paper's leg, kg (assumed)."""
FREQUENCIES = np.logspace(-1.0, 4.0, 8_001)
"""Frequencies of the frequency response, rad/s, 0.14 % apart."""
MOST_RESONANCE = 0.10
"""Limit of the closed loop's peak magnitude minus 1: M_r below 110 %."""
SAME = 0.10
"""Largest relative difference of bandwidths that count as equal."""


def closed_loop(
    position_gain: float, velocity_gain: float, mass: float, omega: float, alpha: float
) -> dict[str, float]:
    """Compute resonance, bandwidth and stability of the closed position loop.

    Returned by name: ``resonance`` M_r is the largest magnitude of the closed loop. ``bandwidth``, rad/s, is the last
    frequency at which the magnitude reaches -3 dB. The loop is ``stable`` if all poles lie in the left half plane.
    ``open_bandwidth``, rad/s, is that of the mass on its position gain, sqrt(K_ap / M). ``distance`` is the relative
    difference of the two bandwidths and ``excess`` is M_r - 1; both are infinite if the loop is unstable.

    Args:
        position_gain: K_ap, N/m.
        velocity_gain: K_av, N s/m.
        mass: M, kg.
        omega: lower corner frequency of the LEAD, rad/s.
        alpha: ratio of the upper to the lower corner frequency.
    """
    feedback = np.polymul([velocity_gain, position_gain], [1.0 / omega, 1.0])
    closed = np.polyadd(feedback, np.polymul([mass, 0.0, 0.0], [1.0 / (alpha * omega), 1.0]))
    s = 1j * FREQUENCIES
    magnitude: Array = np.abs(np.polyval(feedback, s) / np.polyval(closed, s))
    bandwidth = max(FREQUENCIES[magnitude >= np.sqrt(0.5)].tolist(), default=np.nan)
    open_bandwidth = float(np.sqrt(position_gain / mass))
    resonance = float(magnitude.max())
    stable = bool(np.roots(closed).real.max() < 0.0)
    return {
        "resonance": resonance,
        "bandwidth": bandwidth,
        "stable": stable,
        "open_bandwidth": open_bandwidth,
        "distance": abs(bandwidth / open_bandwidth - 1.0) if stable else np.inf,
        "excess": resonance - 1.0 if stable else np.inf,
    }


def compute_loops(results: Results) -> DataFrame:
    """Compute the loops with the gains of each scenario, a row per pair of omega and alpha.

    Pairs are the scenario's own corner frequencies (``default`` is True), and a scan over both.
    """
    import pandas as pd

    controllers = {name: compose_config([f"scenario={scenario}"]).controller for name, scenario in SCENARIOS.items()}
    scan = list(itertools.product(np.geomspace(*OMEGAS, POINTS), np.geomspace(*ALPHAS, POINTS)))
    return pd.DataFrame(
        {
            "scenario": name, "default": index == 0, "omega": omega, "alpha": alpha,
            **closed_loop(control.position_gain, control.velocity_gain, EFFECTIVE_MASS, omega, alpha),
        }
        for name, control in controllers.items()
        for index, (omega, alpha) in enumerate([(control.lead_omega, control.lead_alpha), *scan])
    )  # fmt: skip


def nearest(loops: DataFrame) -> Array:
    """Return the least ``distance`` of all loops that meet objective (a), (1,); infinite if none does."""
    return np.array([min(loops["distance"][loops["excess"] < MOST_RESONANCE], default=np.inf)])


def _loops(results: Results, scenario: str, default: bool) -> DataFrame:
    return results.computed["lead_design"].query("scenario == @scenario and default == @default")


def draw_bandwidths(results: Results) -> Figure:
    """Draw the ratio of closed-loop to open-loop bandwidth over omega, where (a) is met; one line per alpha."""
    panels = []
    for name in SCENARIOS:
        met = _loops(results, name, False).query("excess < @MOST_RESONANCE").groupby("alpha")
        series = [
            Series(f"alpha {alpha:.3g}", loops["omega"], loops["bandwidth"] / loops["open_bandwidth"])
            for alpha, loops in list(met)[::4]
        ]
        panels.append(
            Panel(
                f"gains of {name}", "omega, rad/s", "ratio of bandwidths", series, log="xy", y_limits=[1.0],
                x_limits=_loops(results, name, True)["omega"].to_list(),
            )
        )  # fmt: skip
    return draw(panels, height=3.3)


def values(results: Results) -> Declared:
    """Return the ranges of the scan, and the number of its pairs that meet both objectives."""
    loops = results.computed["lead_design"].query("not default")
    return {
        "mass": EFFECTIVE_MASS, "pairs": POINTS**2, "omegas": OMEGAS, "alphas": ALPHAS,
        "same": 100.0 * SAME, "both": int(((loops["excess"] < MOST_RESONANCE) & (loops["distance"] <= SAME)).sum()),
    }  # fmt: skip


def _claim(words: str, where: str, quantity: str, measure: Callable[[DataFrame], Array], default: bool) -> Declared:
    """Return a claim with a criterion for the gains of each scenario.

    No value refutes the claim, as the mass and the definition of the open-loop bandwidth are assumed.
    """
    criteria = [
        {
            "quantity": quantity, "value": lambda results, name=name: measure(_loops(results, name, default)),
            "case": name,
            "limit": "at most 10 %", "infinite": "the loop is unstable, or no pair meets (a)",
        }
        for name in SCENARIOS
    ]  # fmt: skip
    return {"words": words, "where": where, "criteria": criteria}


STUDY = declare(
    title="Which LEAD compensator meets the paper's objectives",
    question="Which corner frequencies give a resonance below 110 % and an unchanged bandwidth?",
    runs=[],
    computed={"lead_design": compute_loops},
    claims={
        "resonance": _claim(
            "(a) the resonant magnitude M_r of the closed loop is less than 110 %",
            "section 2",
            "excess of M_r over 100 % with the gains and corner frequencies used here",
            lambda loops: loops["excess"].to_numpy(),
            default=True,
        ),
        "bandwidth": _claim(
            "(b) the bandwidth of the closed loop remains the same as the open loop",
            "section 2",
            "relative difference of the bandwidths with the gains and corner frequencies used here",
            lambda loops: loops["distance"].to_numpy(),
            default=True,
        ),
        "both": _claim(
            "these objectives can be achieved through the proper placement of the dominant roots of the closed loop",
            "section 2, eq. 5",
            "least relative difference of the bandwidths over all pairs that meet (a)",
            nearest,
            default=False,
        ),
    },
    figures={"bandwidths": draw_bandwidths},
    values=values,
)
