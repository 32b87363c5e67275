"""Figures of the study of long learning."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figure_data import mark
from cmacexp.report.style import MARKERS, SERIES, label, new_figure
from pipelines.analysis.long_learning_runs import Long, final

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = ("0", "1")
"""Leads whose errors are drawn over the cycles."""
ENDED = "#F3D9CB"
"""Shade of a run that ended by itself."""
FINE: dict[str, Any] = {"color": "#777777", "linewidth": 0.8, "linestyle": ":"}


def rules_of(runs: Sequence[Long]) -> list[str]:
    """Rules in the order of the runs."""
    return list(dict.fromkeys(run.rule for run in runs))


def _plot(axes: "Axes", run: Long, values: Any, name: str, index: int) -> None:
    cycles = np.arange(1, len(values) + 1)
    axes.plot(cycles, values, label=name, **mark(index))
    if not run.lasts and len(values):
        axes.plot(cycles[-1:], values[-1:], marker="x", color=mark(index)["color"], markersize=6)


def over_cycles(runs: Sequence[Long]) -> "Figure":
    """Errors of every rule over the cycles, for the leads 0 and 1; a cross where a run fell or diverged."""
    walks = runs[0].tilt is not None
    figure, axes = new_figure(2, 2, 2.3, sharex=True, sharey="row")
    for column, lead in enumerate(SHOWN):
        for run in (r for r in runs if r.lead == lead):
            index = rules_of(runs).index(run.rule)
            _plot(axes[column], run, run.error, run.rule, index)
            _plot(axes[2 + column], run, run.force if walks else run.change, run.rule, index)
        label(axes[column], f"lead {lead}", "", "error in transfer, mm" if column == 0 else "")
        second = "force error, N" if walks else "change of the feedback, N m"
        label(axes[2 + column], "", "cycle", second if column == 0 else "")
    for ax in axes:
        ax.set_xscale("log")
        ax.set_yscale("log")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _grid(axes: "Axes", rows: Sequence[str], columns: Sequence[str], cells: Mapping[tuple[str, str], Long]) -> None:
    """Final error of what lasts, on a scale of colours; the cycle in which the rest ended."""
    from matplotlib.colors import LogNorm

    lasting = [final(run.error) for run in cells.values() if run.lasts]
    values = np.full((len(rows), len(columns)), np.nan)
    for (row, column), run in cells.items():
        at = rows.index(row), columns.index(column)
        values[at] = final(run.error) if run.lasts else np.nan
        note = f"{final(run.error):.2g} mm" if run.lasts else f"{run.status}\n{run.cycles + 1}"
        dark = run.lasts and len(lasting) > 1 and values[at] > np.sqrt(min(lasting) * max(lasting))
        axes.text(at[1], at[0], note, ha="center", va="center", fontsize=7, color="white" if dark else "black")
    axes.set_facecolor(ENDED)
    norm = LogNorm(min(lasting, default=0.1), max([*lasting, 1.01 * min(lasting, default=0.1)]))
    axes.imshow(np.ma.masked_invalid(values), cmap="Blues", norm=norm, aspect="auto")
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(rows)), rows)
    axes.grid(False)


def ends(runs: Sequence[Long]) -> "Figure":
    """Rule by lead: the final error of what lasts, the cycle in which the rest ended."""
    rules = rules_of(runs)
    leads = sorted({run.lead for run in runs}, key=int)
    figure, axes = new_figure(1, 1, 0.6 + 0.36 * len(rules))
    _grid(axes[0], rules, leads, {(run.rule, run.lead): run for run in runs})
    label(axes[0], "final error in transfer, or how and in which cycle a run ended", "lead, samples", "")
    return figure


def late(runs: Sequence[Long]) -> "Figure":
    """Delay of the actuator by lead, for each rule."""
    rules = rules_of(runs)
    leads = sorted({run.lead for run in runs}, key=lambda lead: 1e9 if lead == "auto" else int(lead))
    delays = sorted({str(run.delay) for run in runs})
    figure, axes = new_figure(len(rules), 1, 0.7 + 0.4 * len(delays))
    for ax, rule in zip(axes, rules, strict=True):
        _grid(ax, delays, leads, {(str(run.delay), run.lead): run for run in runs if run.rule == rule})
        label(ax, rule, "lead, samples" if ax is axes[-1] else "", "delay, samples")
    return figure


def drift(runs: Sequence[Long]) -> "Figure":
    """The feedback's change and the error of the paper's rule for each lead, and where drift was detected."""
    figure, axes = new_figure(1, 2, 2.7)
    for index, run in enumerate(r for r in runs if r.rule == "paper"):
        for ax, values in ((axes[0], run.error), (axes[1], run.change)):
            _plot(ax, run, values, f"lead {run.lead}", index)
            if run.drift:
                named = int(run.drift["named"])
                at = min(named, len(values)) - 1
                ax.plot([at + 1], [values[at]], marker="o", color=mark(index)["color"], fillstyle="none")
    for ax, title in zip(axes, ("error in transfer, mm", "change of the feedback, N m"), strict=True):
        ax.set_xscale("log")
        ax.set_yscale("log")
        label(ax, "", "cycle", title)
    axes[0].legend()
    return figure


def growth(table: "pd.DataFrame") -> "Figure":
    """Growth per cycle as predicted against as measured."""
    figure, axes = new_figure(1, 2, 2.9)
    known = table.dropna(subset=["predicted", "measured"])
    for index, (machine, own) in enumerate(known.groupby("machine", sort=False)):
        look = {"marker": MARKERS[index], "color": SERIES[index], "linestyle": "", "markersize": 4}
        axes[0].plot(own["predicted"], own["measured"], label=machine, **look)
        axes[1].plot(own["measured"], own["measured"] - own["predicted"], label=machine, **look)
    low, high = known[["predicted", "measured"]].min().min(), known[["predicted", "measured"]].max().max()
    axes[0].plot([low, high], [low, high], **FINE)
    for bound in (-0.01, 0.01):
        axes[1].axhline(bound, **FINE)
    label(axes[0], "growth of the feedback per cycle", "predicted", "measured")
    label(axes[1], "", "measured", "measured - predicted")
    axes[0].legend()
    return figure


def settings(runs: Mapping[str, Long]) -> "Figure":
    """Force error and tilt of the quadruped over its cycles."""
    figure, axes = new_figure(1, 2, 2.9)
    for index, (name, run) in enumerate(runs.items()):
        _plot(axes[0], run, run.force, name, index)
        if run.tilt is not None:
            _plot(axes[1], run, run.tilt, name, index)
    for ax, title in zip(axes, ("force error, N", "largest tilt, mrad"), strict=True):
        ax.set_xscale("log")
        ax.set_yscale("log")
        label(ax, "", "cycle", title)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
