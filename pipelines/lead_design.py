"""Which omega and alpha of the LEAD compensator meet the paper's objectives (Lin & Song 1997, section 2, eq. 5).

``python -m pipelines.lead_design`` computes resonance and bandwidth of the closed loop over both; nothing is run.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.cli.study import main
from cmacexp.study import Claim, Criterion, Results, Study, at_most
from cmacexp.typing import Array
from pipelines.lead_design_loop import ALPHAS, EFFECTIVE_MASS, OMEGAS, POINTS, SCENARIOS, compute_loops

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MOST_RESONANCE = 0.10
"""Of the closed loop's magnitude above 1, for M_p below 110 %."""
SAME = 0.10
"""Relative distance at which two bandwidths count as the same."""
RATIOS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Of bandwidths, drawn as lines."""


def _loops(results: Results, scenario: str, default: bool) -> "pd.DataFrame":
    loops = results.computed["lead_design"]
    return loops[(loops["scenario"] == scenario) & (loops["default"] == default)]


def distance(loops: "pd.DataFrame") -> Array:
    """(loops,): relative distance of the closed loop's bandwidth from the open loop's; infinite if unstable."""
    ratio = loops["bandwidth"] / loops["open_bandwidth"]
    return np.where(loops["stable"], np.abs(ratio - 1.0), np.inf)


def resonance(loops: "pd.DataFrame") -> Array:
    """(loops,): largest magnitude of the closed loop above 1; infinite if unstable."""
    return np.where(loops["stable"], loops["resonance"] - 1.0, np.inf)


def nearest(loops: "pd.DataFrame") -> Array:
    """(1,): the least :func:`distance` of a loop that meets objective (a); infinite if none does."""
    good = resonance(loops) < MOST_RESONANCE
    return np.array([np.min(distance(loops), where=good, initial=np.inf)])


def _criteria(
    quantity: str, measure: "Callable[[pd.DataFrame], Array]", default: bool, most: float
) -> list[Criterion]:
    """For the gains of each scenario. Nothing counts as the opposite: mass and open-loop bandwidth are assumed."""
    return [
        Criterion(
            f"{quantity}, gains of {name}",
            lambda results, name=name: measure(_loops(results, name, default)),  # type: ignore[misc]
            at_most(most),
            unit="%",
            scale=100.0,
        )
        for name in SCENARIOS
    ]


CLAIMS = {
    "resonance": Claim(
        "(a) the resonant magnitude M_p of the closed loop is less than 110 %",
        "section 2",
        _criteria("excess of M_p over 100 % with the corner frequencies used here", resonance, True, MOST_RESONANCE),
    ),
    "bandwidth": Claim(
        "(b) the bandwidth of the closed loop remains the same as the open loop",
        "section 2",
        _criteria(
            "relative difference of the bandwidths with the corner frequencies used here", distance, True, SAME
        ),
    ),
    "both": Claim(
        "these objectives can be achieved through the proper placement of the dominant roots of the closed loop",
        "section 2, eq. 5",
        _criteria("least relative difference of the bandwidths over all pairs that meet (a)", nearest, False, SAME),
    ),
}


def draw_maps(results: Results) -> "Figure":
    """One map per scenario: where (a) is met, lines of equal ratio of the bandwidths, and the pair used here."""
    from matplotlib.patches import Patch

    from cmacexp.report.figure_data import logarithmic
    from cmacexp.report.style import SERIES, label, new_figure

    figure, panels = new_figure(1, len(SCENARIOS), height=3.3, sharey=True)
    for axes, name in zip(panels, SCENARIOS, strict=True):
        loops, used = _loops(results, name, False), _loops(results, name, True).iloc[0]
        loops = loops.assign(ratio=loops["bandwidth"] / loops["open_bandwidth"], above=resonance(loops))
        above, ratio = (loops.pivot(index="alpha", columns="omega", values=key) for key in ("above", "ratio"))
        place = (above.columns, above.index)
        for axis, ends in (("x", OMEGAS), ("y", ALPHAS)):
            logarithmic(axes, axis, ends)
        axes.contourf(*place, above, levels=[0.0, MOST_RESONANCE], colors=["#BFDDF0"])
        lines = axes.contour(*place, ratio, levels=RATIOS, colors="black", linewidths=0.8, linestyles="--")
        axes.clabel(lines, fmt="%g", fontsize=7.5, inline_spacing=3)
        axes.plot(used["omega"], used["alpha"], "D", color=SERIES[0], ms=6, mec="white", label="used here (assumed)")
        axes.grid(visible=False)
        label(axes, f"gains of {name}", "omega, rad/s", "alpha" if axes is panels[0] else "")
    handles = [Patch(color="#BFDDF0"), *lines.legend_elements("")[0][:1], *panels[0].get_legend_handles_labels()[0]]
    names = ["M_p below 110 %", "closed over open bandwidth", "used here (assumed)"]
    figure.legend(handles, names, loc="outside lower center", ncols=3)
    return figure


def table(results: Results) -> "pd.DataFrame":
    """The corner frequencies used here, what they give, and how many pairs of the scan meet which objective."""
    import pandas as pd

    rows = []
    for name in SCENARIOS:
        loops, used = _loops(results, name, False), _loops(results, name, True).iloc[0]
        good, same = resonance(loops) < MOST_RESONANCE, distance(loops) <= SAME
        rows.append(
            {
                "gains of": name,
                "omega, rad/s": used["omega"],
                "alpha": used["alpha"],
                "M_p, %": 100.0 * used["resonance"],
                "closed-loop bandwidth, rad/s": used["bandwidth"],
                "open-loop bandwidth, rad/s": used["open_bandwidth"],
                "pairs that meet (a)": int(good.sum()),
                "pairs that meet (b)": int(same.sum()),
                "pairs that meet both": int((good & same).sum()),
            }
        )
    return pd.DataFrame(rows)


def values(results: Results) -> dict[str, Any]:
    """What the scan covers."""
    return {
        "mass": EFFECTIVE_MASS,
        "pairs": POINTS**2,
        "omegas": OMEGAS,
        "alphas": ALPHAS,
        "same": 100.0 * SAME,
    }


STUDY = Study(
    title="Which LEAD compensator meets the paper's objectives",
    question="Which corner frequencies give a resonance below 110 % and an unchanged bandwidth?",
    runs=lambda quick: [],
    computed={"lead_design": compute_loops},
    claims=CLAIMS,
    figures={"maps": draw_maps},
    tables={"defaults": table},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
