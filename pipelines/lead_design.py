"""Which omega and alpha of the LEAD compensator meet the paper's objectives (Lin & Song 1997, section 2, eq. 5).

``python -m pipelines.lead_design`` computes resonance and bandwidth of the closed loop over both, without a run. What
it claims: the one-leg default meets objective (a), M_p below 110 %, the quadruped's does not; no pair meets (a) and
(b), an unchanged bandwidth, together.
"""

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from cmacexp.config.compose import compose_config
from cmacexp.report.page import Claim, Drawing, Link, Section, Table
from pipelines.analysis.figures_lead import design_maps
from pipelines.analysis.lead_design import EFFECTIVE_MASS, closed_loop, open_loop_bandwidth
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

if TYPE_CHECKING:
    import pandas as pd

SCENARIOS = {"one leg": "one_leg", "the quadruped": "quadruped"}
POINTS = 30
"""Of omega and of alpha in a scan."""
OMEGAS, ALPHAS = (0.2, 200.0), (1.0, 100.0)
"""rad/s, and without unit."""
MOST_RESONANCE = 1.10
WITHIN = 0.10
"""Relative distance at which two bandwidths count as the same."""
TABLE = "lead_design.parquet"
"""Every loop that was computed; stored beside the report."""
COLUMNS = ("scenario", "default", "omega", "alpha", "resonance", "bandwidth", "open_bandwidth", "stable")


def design_table() -> pa.Table:
    """Closed loops with the gains of each scenario: with its own corner frequencies, and over a grid of them."""
    rows: list[tuple[str, bool, float, float, float, float, float, bool]] = []
    for name, scenario in SCENARIOS.items():
        controller = compose_config([f"scenario={scenario}"]).controller
        gains = (controller.position_gain, controller.velocity_gain)
        wanted = open_loop_bandwidth(gains[0], EFFECTIVE_MASS)
        own = (controller.lead_omega, controller.lead_alpha)
        loop = closed_loop(*gains, EFFECTIVE_MASS, *own)
        rows.append((name, True, *own, loop.resonance, loop.bandwidth, wanted, loop.stable))
        pairs = itertools.product(np.geomspace(*OMEGAS, POINTS), np.geomspace(*ALPHAS, POINTS))
        grid = {pair: closed_loop(*gains, EFFECTIVE_MASS, *pair) for pair in pairs}
        rows += [(name, False, *pair, lp.resonance, lp.bandwidth, wanted, lp.stable) for pair, lp in grid.items()]
    return pa.table(dict(zip(COLUMNS, map(list, zip(*rows, strict=True)), strict=True)))


def objectives(loops: "pd.DataFrame") -> "pd.DataFrame":
    """Whether each loop meets (a) and (b), and its bandwidth over that of the open loop."""
    ratio = loops["bandwidth"] / loops["open_bandwidth"]
    return loops.assign(
        a=loops["stable"] & (loops["resonance"] < MOST_RESONANCE),
        b=loops["stable"] & ((ratio - 1.0).abs() <= WITHIN),
        ratio=ratio,
    )


def defaults_claim(defaults: "pd.DataFrame", objective: str, claim: str) -> Claim:
    """Whether the corner frequencies that are used here meet an objective, ``a`` or ``b``."""
    met = defaults[objective].tolist()
    said = "; ".join(
        f"{row.scenario}: M_p {row.resonance:.2f}"
        if objective == "a"
        else f"{row.scenario}: {row.bandwidth:.1f} rad/s, open loop {row.open_bandwidth:.1f} rad/s"
        for row in defaults.itertuples()
    )
    verdict = "reproduced" if all(met) else "reproduced in part" if any(met) else "not reproduced"
    return Claim(claim, "section 2", f"{said} (omega and alpha assumed)", verdict, [Link(TABLE, TABLE)])


def both_claim(loops: "pd.DataFrame") -> Claim:
    """Whether any corner frequencies meet both objectives."""
    found, said = [], []
    for name, own in loops.groupby("scenario", sort=False):
        good = own[own["a"]]
        found.append(bool((good["b"]).any()))
        slowest = f" (the slowest {good['ratio'].min():.1f} times as fast as the open loop)" if len(good) else ""
        said.append(
            f"with the gains of {name}: {len(good)} of {len(own)} pairs meet (a){slowest}, "
            f"{int((good['b']).sum())} both"
        )
    return Claim(
        "both objectives can be achieved through proper placement of the dominant roots",
        "section 2, eq. 5",
        "; ".join(said),
        "reproduced" if all(found) else "reproduced in part" if any(found) else "not reproduced",
        [Link(TABLE, TABLE)],
    )


def summarise(runs: Runs) -> list[Section]:
    """The defaults, the scan, and what they say of the paper's objectives."""
    loops = objectives(runs.keep(TABLE, design_table()))
    defaults, grid = loops[loops["default"]], loops[~loops["default"]]
    table = Table(
        ["gains of", "omega, rad/s", "alpha", "M_p", "closed loop, rad/s", "open loop, rad/s", "ratio"],
        [
            [
                row.scenario,
                f"{row.omega:g}",
                f"{row.alpha:g}",
                f"{row.resonance:.3f}",
                f"{row.bandwidth:.1f}",
                f"{row.open_bandwidth:.1f}",
                f"{row.ratio:.2f}",
            ]
            for row in defaults.itertuples()
        ],
        "The corner frequencies that are used here (assumed), and the bandwidths that they give",
    )
    slowest = grid[grid["a"]].groupby("scenario", sort=False)["ratio"].min()
    caption = (
        f"Loop of a point mass of {EFFECTIVE_MASS:g} kg in free space. Shaded: resonance below {MOST_RESONANCE:.0%}; "
        "lines: closed-loop over open-loop bandwidth; diamond: used here. Of the pairs that meet (a) the slowest is "
        + " and ".join(f"{ratio:.1f} times as fast as the open loop ({name})" for name, ratio in slowest.items())
        + "."
    )
    return [
        Section(
            "The LEAD compensator's objectives",
            [table, Drawing("lead_design", design_maps(grid, defaults, MOST_RESONANCE), caption)],
            [
                defaults_claim(defaults, "a", "(a) the resonant magnitude M_p of the closed loop is less than 110 %"),
                defaults_claim(defaults, "b", "(b) the bandwidth of the closed loop remains that of the open loop"),
                both_claim(grid),
            ],
        )
    ]


def jobs(quick: bool) -> Jobs:
    """None: all is computed from the loop's polynomials."""
    return {}


STUDY = Study(
    "lead_design",
    "Which LEAD compensator meets the paper's objectives",
    "Section 2 of Lin & Song 1997 asks for a resonance below 110 % and an unchanged bandwidth, but gives no corner "
    "frequencies. This study finds those that meet either; none meets both.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
