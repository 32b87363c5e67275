"""The figure of the study of assumptions: one row for each value, one panel for each conclusion."""

from collections.abc import Sequence
from itertools import groupby
from math import isfinite
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.style import SERIES, label, new_figure
from pipelines.analysis.assumptions_conclusions import Conclusion, Outcome, changed_by

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW = 0.175
"""Height of a row, inches."""
TITLE = 13
"""Letters of a line of a title."""
WIDE = 30.0
"""Ratio of the ends of a logarithmic axis above which only decades are marked."""
SAME, OTHER = SERIES[1], SERIES[0]
SHADE = "#E3E3E3"


def _limits(conclusion: Conclusion, numbers: Sequence[float]) -> tuple[float, float]:
    """Range of an axis that shows all numbers, and of the limits of the conclusion the one nearest to them."""
    known = [n for n in numbers if isfinite(n)]
    low, high = min(known), max(known)
    limits = [n for n in (conclusion.least, conclusion.most) if isfinite(n)]
    nearest = min(limits, key=lambda n: max(low - n, n - high))
    low, high = min(low, nearest), max(high, nearest)
    if conclusion.logarithmic:
        return low / 1.6, high * 1.6
    margin = 0.12 * (high - low) or 0.1
    return low - margin, high + margin


def _log_axis(axes: "Axes", wide: bool) -> None:
    """A logarithmic axis with plain numbers, few of them."""
    from matplotlib.ticker import LogLocator

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 3.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()


def _panel(axes: "Axes", conclusion: Conclusion, numbers: Sequence[float], changes: Sequence[bool]) -> None:
    """One conclusion; ``numbers[0]`` is that of the values taken."""
    low, high = _limits(conclusion, numbers)
    if conclusion.logarithmic:
        _log_axis(axes, wide=high / low > WIDE)
    axes.set_xlim(low, high)
    for start, end in ((low, conclusion.least), (conclusion.most, high)):
        if start < end:
            axes.axvspan(start, end, color=SHADE, linewidth=0, zorder=0)
    axes.axvline(numbers[0], color="#555555", linestyle="--", linewidth=0.9, zorder=1)
    for other, colour, marker in ((False, SAME, "o"), (True, OTHER, "X")):
        rows = [k for k, change in enumerate(changes) if change == other and isfinite(numbers[k])]
        size = 26 if other else 13
        axes.scatter([numbers[k] for k in rows], rows, s=size, c=colour, marker=marker, zorder=3, linewidths=0)
    label(axes, conclusion.name, f"{conclusion.what},\n{conclusion.axis}", "")
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks = [
        Line2D([], [], linestyle="", marker="o", color=SAME, markersize=4, label="conclusion unchanged"),
        Line2D([], [], linestyle="", marker="X", color=OTHER, markersize=6, label="conclusion changes"),
        Line2D([], [], linestyle="--", color="#555555", label="values taken"),
        Patch(color=SHADE, label="the paper's conclusion does not hold"),
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=2)


def _row_names(rows: Sequence[Outcome]) -> list[str]:
    """The assumption and the value taken stand at the first of its other values."""
    names, last = [], ""
    for outcome in rows:
        head = "" if outcome.assumption == last else f"{outcome.assumption} {outcome.taken}"
        names.append(f"{head} → {outcome.value}".strip() if outcome.value else outcome.assumption)
        last = outcome.assumption
    return names


def draw(outcomes: Sequence[Outcome], taken: Outcome, conclusions: Sequence[Conclusion]) -> "Figure":
    """Dots of every value in every conclusion; a cross where it changes one, "falls" where there is no number."""
    rows = [taken, *outcomes]
    figure, axes = new_figure(1, len(conclusions), 1.6 + ROW * len(rows), sharey=True)
    changes = [changed_by(outcome, taken.numbers, conclusions) for outcome in rows]
    ends = np.cumsum([len(list(group)) for _, group in groupby(rows, key=lambda o: o.assumption)])
    for k, one in enumerate(axes):
        _panel(one, conclusions[k], [o.numbers[k] for o in rows], [k in change for change in changes])
        for row in (n for n, o in enumerate(rows) if not isfinite(o.numbers[k])):
            place = {"xycoords": ("axes fraction", "data"), "ha": "center", "va": "center"}
            one.annotate("falls", (0.5, row), fontsize=7, color=OTHER, **place)
        for end in ends:
            one.axhline(end - 0.5, color="#BBBBBB", linewidth=0.5, zorder=0.5)
        one.tick_params(labelsize=7)
        one.xaxis.label.set_size(7)
        one.set_title(fill(conclusions[k].name, TITLE), fontsize=7.5)
    axes[0].set_yticks(range(len(rows)), _row_names(rows))
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    _legend(figure)
    return figure
