"""Design of the LEAD compensator: K_c, omega and alpha that meet the paper's objectives (Lin & Song 1997, section 2).

``python -m pipelines.lead_design`` computes resonance and bandwidth of the closed loop over all three; nothing is
simulated. The loop is that of section 2, eq. 3 and 5, in continuous time: L(s) = LEAD(s) K_a / s^2 in free space,
without the velocity gain of section 4. All frequencies are relative to sqrt(K_a), which is taken as the bandwidth of
the open loop: the paper defines none.
"""

import itertools

import numpy as np

from cmacexp.study import Array, DataFrame, Declared, Figure, Panel, Results, Series, declare, draw

OMEGAS, ALPHAS, GAINS = (0.03, 3.0), (2.0, 200.0), (0.01, 10.0)
"""Ranges of omega over sqrt(K_a), of alpha and of K_c."""
POINTS = 19
"""Points of each range, log-spaced; one of the gains is K_c = 1."""
FREQUENCIES = np.logspace(-3.0, 4.0, 1_501)
"""Frequencies of the frequency response over sqrt(K_a), 1.1 % apart."""
MOST_RESONANCE = 0.10
"""Limit of the closed loop's peak magnitude minus 1: M_p below 110 %."""
SAME = 0.10
"""Largest relative difference of bandwidths that count as equal."""


def closed_loop(gain: float, omega: float, alpha: float) -> dict[str, float]:
    """Compute the closed position loop of section 2, with frequencies over sqrt(K_a).

    Returned by name: ``excess`` is the largest magnitude of the closed loop, M_p, minus 1. ``bandwidth`` is the last
    frequency at which the magnitude reaches -3 dB, and ``distance`` its relative difference from 1, the bandwidth of
    the open loop. ``excess`` and ``distance`` are infinite if a pole is not in the left half plane.

    Args:
        gain: K_c.
        omega: lower corner frequency of the LEAD over sqrt(K_a).
        alpha: ratio of the upper to the lower corner frequency.
    """
    feedback = gain * np.array([1.0 / omega, 1.0])
    closed = np.polyadd(feedback, np.polymul([1.0, 0.0, 0.0], [1.0 / (alpha * omega), 1.0]))
    s = 1j * FREQUENCIES
    magnitude: Array = np.abs(np.polyval(feedback, s) / np.polyval(closed, s))
    bandwidth = max(FREQUENCIES[magnitude >= np.sqrt(0.5)].tolist(), default=np.nan)
    stable = bool(np.roots(closed).real.max() < 0.0)
    return {
        "bandwidth": bandwidth,
        "distance": abs(bandwidth - 1.0) if stable else np.inf,
        "excess": float(magnitude.max()) - 1.0 if stable else np.inf,
    }


def compute_loops(results: Results) -> DataFrame:
    """Compute the loops of a scan over K_c, omega and alpha, a row for each."""
    import pandas as pd

    ranges = (np.geomspace(*ends, POINTS) for ends in (GAINS, OMEGAS, ALPHAS))
    return pd.DataFrame(
        {"gain": gain, "omega": omega, "alpha": alpha, **closed_loop(gain, omega, alpha)}
        for gain, omega, alpha in itertools.product(*ranges)
    )


def _meet_resonance(results: Results) -> DataFrame:
    """Return the loops that meet objective (a)."""
    loops = results.computed["lead_design"]
    return loops[loops["excess"] < MOST_RESONANCE]


def find_nearest(results: Results, only_one: bool = False) -> Array:
    """Return the least ``distance`` of all loops that meet (a), (1,); with ``only_one`` of those of K_c = 1.

    It is infinite if there is none.
    """
    met = _meet_resonance(results)
    chosen = met[np.isclose(met["gain"], 1.0)] if only_one else met
    return np.array([min(chosen["distance"], default=np.inf)])


def draw_bandwidths(results: Results) -> Figure:
    """Draw the bandwidth over omega of the loops that meet (a), with K_c = 1 and with the K_c that fits best."""
    met = _meet_resonance(results)
    panels = []
    for title, loops in (("K_c = 1", met[np.isclose(met["gain"], 1.0)]), ("the K_c that fits best", met)):
        best = loops.sort_values("distance").drop_duplicates(["omega", "alpha"]).sort_values(["alpha", "omega"])
        series = [
            Series(f"alpha {alpha:.3g}", rows["omega"], rows["bandwidth"])
            for alpha, rows in list(best.groupby("alpha"))[::4]
        ]
        panels.append(
            Panel(title, "omega over sqrt(K_a)", "bandwidth over sqrt(K_a)", series, log="xy", y_limits=[1.0])
        )
    return draw(panels, height=3.3)


def values(results: Results) -> Declared:
    """Return the ranges of the scan, the number of its loops, and the best loop of equal bandwidth."""
    loops = results.computed["lead_design"]
    both = loops[(loops["excess"] < MOST_RESONANCE) & (loops["distance"] <= SAME)].sort_values("excess")
    best = both.iloc[0].to_dict() if len(both) else {}
    return {
        "loops": len(loops), "omegas": OMEGAS, "alphas": ALPHAS, "gains": GAINS, "same": 100.0 * SAME,
        "both": len(both), "best": {name: f"{value:.3g}" for name, value in best.items()},
    }  # fmt: skip


WITHIN: Declared = {
    "limit": "at most 10 %", "infinite": "no loop meets (a)",
    "quantity": "least relative difference of the bandwidths over all loops that meet (a)",
}  # fmt: skip
STUDY = declare(
    title="Which LEAD compensator meets the paper's objectives",
    question="Which gain and corner frequencies give a resonance below 110 % and an unchanged bandwidth?",
    runs=[],
    computed={"lead_design": compute_loops},
    claims={
        "both": {
            "words": "(a) resonance below 110 % and (b) an unchanged bandwidth can be achieved through the proper "
            "placement of the dominant roots of the closed loop",
            "where": "section 2, eq. 5",
            "value": find_nearest, **WITHIN,
        },
    },
    findings={
        "gain": {
            "says": "With K_c = 1 no loop meets both objectives: the gain of eq. 5 is needed",
            "value": lambda results: find_nearest(results, only_one=True), **WITHIN, "limit": "at least 10 %",
        },
    },
    figures={"bandwidths": draw_bandwidths},
    values=values,
)  # fmt: skip
