"""Figures of the study of hashing."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.style import DASHES, MARKERS, SERIES, label, new_figure
from pipelines.analysis.cmac_size_figures import plain_y
from pipelines.analysis.hashing_found import Interval, Memory, free, hashed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _with_bars(axes: "Axes", k: int, name: str, memories: Sequence[Memory], values: Sequence[Interval]) -> None:
    """One line over rows per visited cell with confidence intervals; dotted: without collisions."""
    own = [(m.room, v) for m, v in zip(memories, values, strict=True) if not m.visited and np.isfinite(v.middle)]
    if own:
        middle = np.array([v.middle for _, v in own])
        bars = np.array([[v.middle - v.low for _, v in own], [v.high - v.middle for _, v in own]])
        axes.errorbar(
            [room for room, _ in own], middle, bars, color=SERIES[k], marker=MARKERS[k], markersize=4,
            linestyle=DASHES[k], capsize=2, label=name,
        )  # fmt: skip
    alone = values[memories.index(free(memories))].middle
    if np.isfinite(alone):
        axes.axhline(alone, color=SERIES[k], linestyle=":", linewidth=1.0)


def over_memory(rules: Mapping[str, Sequence[Memory]]) -> "Figure":
    """Collisions, cycles to learn, errors at the end in x and y over rows per visited cell, a line for each rule."""
    figure, axes = new_figure(1, 4, 2.5)
    first = hashed(next(iter(rules.values())))
    axes[0].plot([m.room for m in first], [100.0 * m.rate for m in first], color="#555555", marker="o", markersize=4)
    for k, (name, memories) in enumerate(rules.items()):
        _with_bars(axes[1], k, name, memories, [m.learnt() for m in memories])
        for one, side in ((axes[2], "x"), (axes[3], "y")):
            _with_bars(one, k, name, memories, [m.errors(side) for m in memories])
    titles = {
        "collisions": "of the visited cells, %",
        "learning": "cycles to 1/10 in y",
        "error in x": "mm, at the end",
        "error in y": "mm, at the end",
    }
    for one, (title, unit) in zip(axes, titles.items(), strict=True):
        one.set_xscale("log")
        one.xaxis.set_major_formatter("{x:g}")
        label(one, title, "rows per visited cell", unit)
    for one in axes[1:]:
        plain_y(one)
    handles, names = axes[3].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=max(1, len(names)))
    return figure
