"""Figures of what the paper did not see of one leg: bias, divergence, and the limits of an exact model."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from cmacexp.report.style import DASHES, SERIES, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1e3


def _lines(axes: "Axes", tables: Mapping[str, "pd.DataFrame"], column: str, factor: float) -> None:
    for (name, table), colour, dash in zip(tables.items(), SERIES, DASHES, strict=False):
        axes.plot(table["cycle"], factor * table[column], color=colour, ls=dash, label=name)


def _legend_below(figure: "Figure", axes: "Axes", columns: int) -> None:
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns)


def bias(literal: "pd.DataFrame", aware: "pd.DataFrame", predicted: float) -> "Figure":
    """Steady-state force error per cycle under both references, with what statics predict (relative)."""
    figure, (axes,) = new_figure(height=2.8)
    for table, name, colour, marker in (
        (literal, "eq. 13 as printed (literal)", SERIES[0], "o"),
        (aware, "without its 1/K_ap (aware)", SERIES[1], "s"),
    ):
        learnt = table[table["cycle"] > 1]
        axes.plot(
            learnt["cycle"], 100.0 * learnt["force_steady_state_error"], color=colour, marker=marker, ms=4, label=name
        )
    axes.axhline(100.0 * predicted, color="black", ls="--", lw=0.9, label=f"statics of eq. 13: {predicted:.2%}")
    axes.axhline(0.0, color="black", lw=0.7)
    axes.set_xticks(range(2, int(literal["cycle"].max()) + 1, 2))
    label(axes, "steady-state error of the force", "cycle", "settled over desired, less 1, %")
    _legend_below(figure, axes, 3)
    return figure


def divergence(tables: Mapping[str, "pd.DataFrame"], diverged: Mapping[str, int]) -> "Figure":
    """Feedback torque and transfer error per cycle; ``diverged`` gives the cycle in which a run came to its end."""
    figure, (left, right) = new_figure(1, 2, height=2.8)
    for axes, column, factor in ((left, "feedback_rms", 1.0), (right, "transfer_rmse_x", MM)):
        _lines(axes, tables, column, factor)
        axes.set_yscale("log")
        for (name, table), colour in zip(tables.items(), SERIES, strict=False):
            if name in diverged:
                last = table.iloc[-1]
                axes.plot(last["cycle"], factor * last[column], "X", color=colour, ms=8, mec="white", clip_on=False)
                axes.annotate(
                    f"diverges in\ncycle {diverged[name]}",
                    (last["cycle"], factor * last[column]),
                    (8, 0),
                    textcoords="offset points",
                    va="top",
                    color=colour,
                )
    label(left, "feedback torque", "cycle", "RMS over both joints, N m")
    label(right, "foot in transfer, x", "cycle", "RMS error, mm")
    _legend_below(figure, left, 2)
    return figure


def exact_model(tables: Mapping[str, Mapping[str, "pd.DataFrame"]]) -> "Figure":
    """Transfer error in y per cycle by path: learnt and exact feedforward."""
    figure, panels = new_figure(1, len(tables), height=2.6, sharey=True)
    for axes, (path, runs) in zip(panels, tables.items(), strict=True):
        _lines(axes, runs, "transfer_rmse_y", MM)
        axes.set_yscale("log")
        axes.xaxis.get_major_locator().set_params(integer=True)
        label(axes, path, "cycle", "RMS error in y, mm" if axes is panels[0] else "")
    _legend_below(figure, panels[0], 2)
    return figure
