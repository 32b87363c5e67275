"""Figures of the study of CMAC sizes."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.style import DASHES, MARKERS, SERIES, label, new_figure
from pipelines.analysis.cmac_size_verdicts import (
    ELEMENTS,
    LAYERS,
    MEMORY,
    RANGE,
    SEED,
    Size,
    by_memory,
    differing,
    paper_size,
)
from pipelines.analysis.measured import size_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FINE = {"color": "#555555", "linestyle": ":", "linewidth": 1.0, "zorder": 0}


def _by(sizes: Sequence[Size], value: Callable[[Size], float]) -> list[Size]:
    return sorted(sizes, key=value)


def _axis(axes: "Axes", values: Sequence[float], names: Sequence[str]) -> None:
    """A logarithmic x axis with ticks at ``values`` alone."""
    axes.set_xscale("log", base=2)
    axes.set_xticks(values, names)
    axes.minorticks_off()


def plain_y(axes: "Axes") -> None:
    """A logarithmic y axis that reads 0.5, 1, 2."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _memory_axis(axes: "Axes", memories: Sequence[int]) -> None:
    low, high = int(np.log2(min(memories))), int(np.log2(max(memories)))
    ticks = [2.0**n for n in range(low + low % 2, high + 1, 4)]
    _axis(axes, ticks, [size_of(tick) for tick in ticks])


def draw_accuracy(sizes: Sequence[Size], cycles: Sequence[int]) -> "Figure":
    """Errors in x and y against layers, width of a cell, and memory; a line for each cycle."""
    figure, axes = new_figure(2, 3, 2.15, sharey="row", sharex="col")
    paper = paper_size(sizes)
    ways: list[tuple[str, str, list[Size], Callable[[Size], float]]] = [
        ("layers", "layers", differing(sizes, LAYERS), lambda s: s.layers),
        ("width of a cell", "cell / planned span", differing(sizes, ELEMENTS), lambda s: s.width),
        ("memory", "memory", differing(sizes, MEMORY), lambda s: s.memory),
    ]
    for row, (side, errors) in enumerate((("x", lambda s: s.x), ("y", lambda s: s.y))):
        for column, (title, unit, group, value) in enumerate(ways):
            one = axes[3 * row + column]
            ordered = _by(group, value)
            for k, cycle in enumerate(cycles):
                look = {"color": SERIES[k], "marker": MARKERS[k], "markersize": 4}
                shown = [s for s in ordered if cycle in s.x]
                at, values = [value(s) for s in shown], [errors(s)[cycle] for s in shown]
                one.plot(at, values, linestyle=DASHES[k], label=f"cycle {cycle}", **look)
                if title == "width of a cell":
                    other = [s for s in differing(sizes, RANGE) if cycle in s.x]
                    places, heights = [s.width for s in other], [errors(s)[cycle] for s in other]
                    one.plot(places, heights, linestyle="", fillstyle="none", **{**look, "markersize": 7})
            one.axvline(value(paper), **FINE)
            label(one, title if row == 0 else "", unit if row else "", f"error in {side}, mm" if column == 0 else "")
            plain_y(one)
    layers = [s.layers for s in ways[0][2]]
    _axis(axes[3], sorted(layers), [str(n) for n in sorted(layers)])
    widths = [2.0**n for n in range(-5, 1)]
    _axis(axes[4], widths, [f"1/{1 / w:.0f}" if w < 1 else "1" for w in widths])
    _memory_axis(axes[5], [s.memory for s in ways[2][2]])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(cycles))
    return figure


def draw_collisions(sizes: Sequence[Size]) -> "Figure":
    """Share of colliding cells against memory; collisions and errors against rows for each visited cell."""
    figure, axes = new_figure(1, 3, 2.6)
    paper = paper_size(sizes)
    last = max(paper.x)
    group = differing(sizes, LAYERS, MEMORY, SEED)
    counts = sorted({s.layers for s in group if MEMORY in s.changed})
    for k, layers in enumerate(counts):
        own = _by([s for s in group if s.layers == layers], lambda s: s.memory)
        plain = [s for s in own if SEED not in s.changed]
        look = {"color": SERIES[k], "marker": MARKERS[k], "markersize": 4}
        axes[0].plot([s.memory for s in plain], [100 * s.rate for s in plain], linestyle=DASHES[k], **look)
        for one, errors in ((axes[1], lambda s: s.x), (axes[2], lambda s: s.y)):
            reached = [s for s in own if last in s.x]
            one.plot([s.room for s in reached], [errors(s)[last] for s in reached], linestyle="", **look)
        axes[0].plot([], [], linestyle=DASHES[k], label=f"{layers} layers", **look)
    axes[0].axvline(paper.memory, **FINE)
    _memory_axis(axes[0], [s.memory for s in group])
    label(axes[0], "collisions", "memory", "visited cells that collide, %")
    for one, side in ((axes[1], "x"), (axes[2], "y")):
        one.set_xscale("log")
        one.xaxis.set_major_formatter("{x:g}")
        one.axvline(1.0, **FINE)
        label(one, f"error in {side}, cycle {last}", "rows of memory per visited cell", f"error in {side}, mm")
        plain_y(one)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(counts))
    return figure


def draw_walk(sizes: Sequence[Size]) -> "Figure":
    """Errors and tilt of the quadruped against memory."""
    figure, axes = new_figure(1, 3, 2.3)
    group = [s for own in by_memory(sizes).values() for s in own]
    last = max(paper_size(sizes).x)
    ways: list[tuple[str, str, Callable[[Size], float]]] = [
        ("error in x", "mm", lambda s: s.x.get(last, np.nan)),
        ("error in y", "mm", lambda s: s.y.get(last, np.nan)),
        ("tilt", "mrad", lambda s: s.tilt),
    ]
    for k, (title, unit, value) in enumerate(ways):
        axes[k].plot(
            [s.memory for s in group], [value(s) for s in group], color=SERIES[1], marker=MARKERS[0], markersize=4
        )
        axes[k].axvline(paper_size(sizes).memory, **FINE)
        label(axes[k], title, "memory of one leg", f"{title}, cycle {last}, {unit}")
        plain_y(axes[k])
        _memory_axis(axes[k], [s.memory for s in group])
    return figure
