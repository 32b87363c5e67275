"""Figures of walks over ground that changes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from cmacexp.report.style import DASHES, DESIRED, MARKERS, SERIES, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from pipelines.analysis.terrain_measures import Walked

SHOWN_BEFORE = 10
"""Cycles before a change that are shown."""


def recovery(
    changes: Mapping[str, Mapping[str, "pd.DataFrame"]], measures: Mapping[str, str], change: int
) -> "Figure":
    """Errors over cycles: a row for each measure, a column for each change, a line with and without CMAC."""
    from matplotlib.ticker import LogLocator, NullFormatter

    figure, axes = new_figure(len(measures), len(changes), 1.7, sharex=True, sharey="row")
    for n, (name, words) in enumerate(measures.items()):
        for m, (title, runs) in enumerate(changes.items()):
            axis = axes[n * len(changes) + m]
            axis.axvline(change + 0.5, color=DESIRED, lw=1.0)
            for (label, errors), colour, dash in zip(runs.items(), SERIES[1::-1], DASHES, strict=False):
                shown = errors[name][errors.index > change - SHOWN_BEFORE]
                axis.plot(shown.index, shown, color=colour, ls=dash, label=label)
            axis.set_yscale("log")
            axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.yaxis.set_major_formatter("{x:g}")
            axis.yaxis.set_minor_formatter(NullFormatter())
            if n == 0:
                axis.set_title(title, fontsize=8.0)
            if m == 0:
                axis.set_ylabel(words)
    figure.supxlabel("cycle", fontsize=8.5)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def over_ground(by_words: Mapping[str, Sequence["Walked"]], ground: str) -> "Figure":
    """Force error and tilt at the end against what the ground is like, with intervals where there are any."""
    figure, axes = new_figure(1, 2, 2.6)
    for axis, title in zip(axes, ("force error, N", "tilt, mrad"), strict=True):
        for (words, own), colour, marker in zip(by_words.items(), SERIES[1::-1], MARKERS, strict=False):
            whole = [each for each in own if each.walked]
            values = [each.force if title.startswith("force") else each.tilt for each in whole]
            x = [each.ground for each in whole]
            axis.errorbar(
                x, [v.mean for v in values], [v.half for v in values],
                color=colour, marker=marker, ms=4, capsize=2, label=words,
            )  # fmt: skip
            ended = [each.ground for each in own if each.walked < each.runs]
            height = 0.97 if words == next(iter(by_words)) else 0.9
            axis.plot(ended, [height] * len(ended), "x", color=colour, transform=axis.get_xaxis_transform())
        axis.set(xlabel=ground, ylabel=title, ylim=(0.0, None))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure
