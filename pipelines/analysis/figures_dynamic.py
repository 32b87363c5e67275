"""Figures of the walk with a body that has mass."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.report.style import DASHES, DESIRED, FEEDBACK, FEEDFORWARD, SERIES, label, new_figure
from cmacexp.typing import Array
from pipelines.analysis.dynamic_body_words import CUT_OFF, Walk

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = (
    ("force", "force error, N"),
    ("x", "transfer error x, mm"),
    ("y", "transfer error y, mm"),
    ("tilt", "tilt, mrad"),
)


def learning(tables: "Mapping[str, pd.DataFrame]", alone: Mapping[str, "pd.Series"]) -> "Figure":
    """Errors by cycle of walks that learn; dotted: the last cycle of feedback alone on the same plan."""
    figure, axes = new_figure(2, 2, 1.9)
    for axis, (name, title) in zip(axes, PANELS, strict=True):
        for (walk, table), colour, dash in zip(tables.items(), SERIES, DASHES, strict=False):
            axis.plot(table.index, table[name], color=colour, ls=dash, label=walk)
            if walk in alone:
                axis.axhline(alone[walk][name], color=colour, ls=":", lw=1.0)
        axis.set_yscale("log")
        label(axis, title, "cycle", "")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(tables))
    return figure


def _bars(axis: "Axes", rows: Sequence[tuple[str, Walk, Walk]], title: str) -> None:
    """A bar for the force error of each walk, a tick for that of feedback alone on the same plan."""
    most = np.nanmax([value for _, learnt, felt in rows for value in (learnt.force, felt.force)])
    for place, (_, learnt, felt) in enumerate(rows):
        if np.isfinite(learnt.force):
            worse = learnt.force > felt.force
            axis.barh(place, learnt.force, 0.6, color=FEEDBACK if worse else FEEDFORWARD)
            axis.barh(place, learnt.slow, 0.25, color="white", alpha=0.6)
        else:
            axis.annotate(
                f"{learnt.status} at {learnt.seconds:.0f} s", (0.02 * most, place), va="center", color=SERIES[0]
            )
        if np.isfinite(felt.force):
            axis.plot([felt.force] * 2, [place - 0.4, place + 0.4], color=DESIRED, lw=2.0)
    axis.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    label(axis, title, "force error, N", "")


def ladder(up: Sequence[tuple[str, Walk, Walk]], down: Sequence[tuple[str, Walk, Walk]]) -> "Figure":
    """Force error after each change was added to those before it, and with all changes but one."""
    figure, axes = new_figure(2, 1, 2.5, sharex=True)
    _bars(axes[0], up, "changes added one after the other")
    _bars(axes[1], down, "all changes but one")
    return figure


def slow_force(walks: Mapping[str, tuple[Array, Array, Array]], leg: int) -> "Figure":
    """Contact force of one leg over a cycle and its slow part, a row for each walk.

    Args:
        walks: by name: time (steps,), s; desired force and slow part of the force (steps, L), N, and actual force.
        leg: 0 to 3.
    """
    figure, axes = new_figure(len(walks), 1, 1.7, sharex=True, sharey=True)
    for axis, (name, (time, desired, slow, force)) in zip(axes, walks.items(), strict=True):
        axis.plot(time - time[0], force[:, leg], color=FEEDBACK, lw=0.6, alpha=0.6, label="actual")
        axis.plot(time - time[0], slow[:, leg], color=FEEDFORWARD, label=f"slower than {CUT_OFF:g} Hz")
        axis.plot(time - time[0], desired[:, leg], color=DESIRED, ls="--", lw=1.0, label="desired")
        label(axis, f"{name}: {LEG_NAMES[leg]} foot", "", "force, N")
    axes[-1].set_xlabel("time in the cycle, s")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
