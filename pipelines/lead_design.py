"""Which omega and alpha of the LEAD compensator meet the paper's objectives (Lin & Song 1997, section 2, eq. 5).

``python -m pipelines.lead_design`` computes resonance and bandwidth of the closed loop over both; nothing is run.
The loop is that of eq. 21 around a point mass in free space and in continuous time,
L(s) = (K_ap + K_av s) LEAD(s) / (M s^2). The bandwidth of the open loop is read as sqrt(K_ap / M).
"""

import itertools
from collections.abc import Callable

import numpy as np

from cmacexp.config.compose import compose_config
from cmacexp.study import Array, DataFrame, Declared, Figure, Panel, Results, Series, declare, draw

SCENARIOS = {"one leg": "one_leg", "quadruped": "quadruped"}
OMEGAS, ALPHAS, POINTS = (0.2, 200.0), (1.0, 100.0), 30
"""Range of omega (rad/s) and of alpha in a scan, and points of each."""
EFFECTIVE_MASS = 0.75
"""Mass that the foot of the paper's leg moves, kg (assumed)."""
FREQUENCIES = np.logspace(-1.0, 4.0, 8_001)
"""rad/s; neighbours are 0.14 % apart."""
MOST_RESONANCE, SAME = 0.10, 0.10
"""Of the closed loop's magnitude above 1, for M_r below 110 %; relative distance of bandwidths that are the same."""


def closed_loop(
    position_gain: float, velocity_gain: float, mass: float, omega: float, alpha: float
) -> dict[str, float]:
    """Resonance M_r, the largest magnitude, and bandwidth, rad/s, of the position loop; and whether it is stable.

    The bandwidth is the frequency at which the closed loop falls below -3 dB for good; it is stable if all poles lie
    in the left half plane. ``open_bandwidth`` is that of the mass on its position gain. ``distance`` is the relative
    one of the closed loop's bandwidth from it, ``excess`` the largest magnitude of the closed loop above 1; both are
    infinite if it is unstable.

    Args:
        position_gain: K_ap, N/m.
        velocity_gain: K_av, N s/m.
        mass: M, kg.
        omega: lower corner frequency of the LEAD, rad/s.
        alpha: upper over lower corner frequency.
    """
    feedback = np.polymul([velocity_gain, position_gain], [1.0 / omega, 1.0])
    closed = np.polyadd(feedback, np.polymul([mass, 0.0, 0.0], [1.0 / (alpha * omega), 1.0]))
    s, open_bandwidth = 1j * FREQUENCIES, float(np.sqrt(position_gain / mass))
    magnitude: Array = np.abs(np.polyval(feedback, s) / np.polyval(closed, s))
    bandwidth = max(FREQUENCIES[magnitude >= np.sqrt(0.5)].tolist(), default=np.nan)
    resonance, stable = float(magnitude.max()), bool(np.roots(closed).real.max() < 0.0)
    return {
        "resonance": resonance,
        "bandwidth": bandwidth,
        "stable": stable,
        "open_bandwidth": open_bandwidth,
        "distance": abs(bandwidth / open_bandwidth - 1.0) if stable else np.inf,
        "excess": resonance - 1.0 if stable else np.inf,
    }


def compute_loops(results: Results) -> DataFrame:
    """Loops with the gains of each scenario: with its own corner frequencies (``default``), and over a scan."""
    import pandas as pd

    controllers = {name: compose_config([f"scenario={scenario}"]).controller for name, scenario in SCENARIOS.items()}
    scan = list(itertools.product(np.geomspace(*OMEGAS, POINTS), np.geomspace(*ALPHAS, POINTS)))
    return pd.DataFrame(
        {
            "scenario": name, "default": index == 0, "omega": omega, "alpha": alpha,
            **closed_loop(own.position_gain, own.velocity_gain, EFFECTIVE_MASS, omega, alpha),
        }
        for name, own in controllers.items()
        for index, (omega, alpha) in enumerate([(own.lead_omega, own.lead_alpha), *scan])
    )  # fmt: skip


def nearest(loops: DataFrame) -> Array:
    """(1,): the least ``distance`` of a loop that meets objective (a); infinite if none does."""
    low = loops["distance"][loops["excess"] < MOST_RESONANCE]
    return np.array([min(low, default=np.inf)])


def _loops(results: Results, scenario: str, default: bool) -> DataFrame:
    return results.computed["lead_design"].query("scenario == @scenario and default == @default")


def draw_bandwidths(results: Results) -> Figure:
    """Over omega, the bandwidth of the closed loop over that of the open one, where (a) is met; lines: alpha."""
    panels, axes = [], ("omega, rad/s", "ratio of bandwidths")
    for name in SCENARIOS:
        met = _loops(results, name, False).query("excess < @MOST_RESONANCE").groupby("alpha")
        series = [
            Series(f"alpha {alpha:.3g}", own["omega"], own["bandwidth"] / own["open_bandwidth"])
            for alpha, own in list(met)[::4]
        ]
        panels.append(
            Panel(
                f"gains of {name}", *axes, series, log="xy", y_limits=[1.0],
                x_limits=_loops(results, name, True)["omega"].to_list(),
            )
        )  # fmt: skip
    return draw(panels, height=3.3)


def values(results: Results) -> Declared:
    """What the scan covers, and how many of its pairs meet both objectives."""
    loops = results.computed["lead_design"].query("not default")
    both = (loops["excess"] < MOST_RESONANCE) & (loops["distance"] <= SAME)
    return {
        "mass": EFFECTIVE_MASS, "pairs": POINTS**2, "omegas": OMEGAS, "alphas": ALPHAS,
        "same": 100.0 * SAME, "both": int(both.sum()),
    }  # fmt: skip


def _claim(words: str, where: str, quantity: str, measure: Callable[[DataFrame], Array], default: bool) -> Declared:
    """For the gains of each scenario. Nothing counts as the opposite: mass and open-loop bandwidth are assumed."""
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
