"""Figures of the comparison of feedforwards."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.style import DASHES, DESIRED, SERIES, label, new_figure
from pipelines.analysis.feedforward_kinds import ALONE, EXACT, KEPT, LEARNERS, WRONG, Course, level

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES: dict[str, dict[str, Any]] = {
    ALONE: {"color": DESIRED, "linestyle": "-"},
    EXACT: {"color": "#000000", "linestyle": "-", "linewidth": 0.9},
    **{
        name: {"color": "#000000", "linestyle": dash, "linewidth": 0.9}
        for name, dash in zip(WRONG.values(), (":", "-."), strict=True)
    },
    **{name: {"color": SERIES[i], "linestyle": DASHES[i]} for i, name in enumerate(LEARNERS)},
}


def _curve(axes: "Axes", kind: str, course: Course, **look: Any) -> None:
    cycles = np.arange(1, course.error.shape[1] + 1)
    axes.plot(cycles, course.error.mean(axis=0), label=kind, **{**STYLES[kind], **look})
    if len(course.error) > 1:
        low, high = course.error.min(axis=0), course.error.max(axis=0)
        axes.fill_between(cycles, low, high, color=STYLES[kind]["color"], alpha=0.15, linewidth=0)


def _plain(axes: "Axes") -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def learning(found: Mapping[str, Course]) -> "Figure":
    """Transfer error against the cycle, a line for each kind."""
    figure, (axes,) = new_figure(1, 1, 3.6)
    for kind, course in found.items():
        _curve(axes, kind, course)
    axes.axhline(level(found[ALONE]), color=DESIRED, linestyle="--", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    _plain(axes)
    label(axes, "", "cycle", "transfer error, mm")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper")
    return figure


def after(found: Mapping[str, tuple[Mapping[str, Course], Mapping[str, Course]]]) -> "Figure":
    """Transfer error after each change, with what was learnt before it and from nothing."""
    figure, panels = new_figure(2, 2, 2.4, sharey=True)
    for axes, (group, (fresh, kept)) in zip(panels, found.items(), strict=True):
        _curve(axes, ALONE, fresh[ALONE])
        _curve(axes, EXACT, fresh[EXACT])
        for kind in KEPT:
            _curve(axes, kind, kept[kind], linestyle="-")
            axes.plot(
                np.arange(1, fresh[kind].error.shape[1] + 1),
                fresh[kind].error.mean(axis=0),
                color=STYLES[kind]["color"],
                linestyle="--",
                linewidth=0.8,
            )
        axes.set_yscale("log")
        _plain(axes)
        axes.xaxis.get_major_locator().set_params(integer=True)
        label(axes, group, "cycle" if axes in panels[2:] else "", "transfer error, mm" if axes in panels[::2] else "")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(KEPT) + 2)
    return figure
