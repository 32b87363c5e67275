"""Maps of resonance and bandwidth over the corner frequencies of the LEAD compensator."""

from typing import TYPE_CHECKING

from cmacexp.report.style import SERIES, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

RATIOS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)


def design_maps(grid: "pd.DataFrame", defaults: "pd.DataFrame", most_resonance: float) -> "Figure":
    """One map per scenario: where the resonance stays below ``most_resonance``, lines of equal bandwidth ratio."""
    from matplotlib.patches import Patch

    figure, panels = new_figure(1, len(defaults), height=3.3, sharey=True)
    for axes, default in zip(panels, defaults.itertuples(), strict=True):
        own = grid[grid["scenario"] == default.scenario]
        resonance, ratio = (own.pivot(index="alpha", columns="omega", values=c) for c in ("resonance", "ratio"))
        axes.set_xscale("log")
        axes.set_yscale("log")
        place = (resonance.columns, resonance.index)
        axes.contourf(*place, resonance, levels=[0.0, most_resonance], colors=["#BFDDF0"])
        axes.contour(*place, resonance, levels=[most_resonance], colors=[SERIES[1]], linewidths=1.2)
        lines = axes.contour(*place, ratio, levels=RATIOS, colors="black", linewidths=0.8, linestyles="--")
        axes.clabel(lines, fmt="%g", fontsize=7.5, inline_spacing=3)
        axes.plot(default.omega, default.alpha, "D", color=SERIES[0], ms=6, mec="white", label="used here (assumed)")
        axes.grid(False)
        label(axes, f"gains of {default.scenario}", "omega, rad/s", "alpha" if axes is panels[0] else "")
    handles = [
        Patch(color="#BFDDF0", label=f"M_p below {most_resonance:.0%}"),
        *lines.legend_elements("")[0][:1],
        *panels[0].get_legend_handles_labels()[0],
    ]
    names = [f"M_p below {most_resonance:.0%}", "closed over open bandwidth", "used here (assumed)"]
    figure.legend(handles, names, loc="outside lower center", ncols=3)
    return figure
