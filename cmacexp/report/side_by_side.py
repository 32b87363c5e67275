"""Force and errors of a few runs over their last whole cycles: a panel for each run, on shared axes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.figure_data import DESIRED_LINE, MOST_CYCLES, FigureData, legend_below, mark, read_figure_data
from cmacexp.report.over_cycle import CLOCK, moves_along_x
from cmacexp.report.page import Drawing
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.style import label, new_grid
from cmacexp.typing import Array

LARGER = 3.0
"""Curves that reach further than so many times the usual one are cut off, so that the others stay visible."""


class Quantity(NamedTuple):
    """What one figure shows."""

    title: str
    y: str
    unit: str


FORCE = Quantity("Contact force", "force", "N")
ERRORS = {axis: Quantity(f"Error along {axis}", f"{axis} - desired", "mm") for axis in "yx"}


def _values(data: FigureData, column: str) -> Array:
    """Values of leg 1 in the unit of the figure."""
    rows = data.select(data.cycles[0], 1)
    return np.asarray(rows[column] if column == "force" else 1e3 * (rows[column] - rows[f"{column}_desired"]))


def shared_limits(curves: Sequence[Array]) -> tuple[float, float]:
    """Limits of an axis that shows all curves but those that reach :data:`LARGER` times as far as the usual one.

    >>> shared_limits([np.array([-1.0, 1.0]), np.array([0.0, 1.2]), np.array([-90.0, 90.0])])
    (-1.0, 1.2)
    """
    reach = [float(np.abs(curve).max()) for curve in curves]
    most = LARGER * sorted(reach)[(len(reach) - 1) // 2]
    shown = np.concatenate([curve for curve, far in zip(curves, reach, strict=True) if far <= most])
    return float(shown.min()), float(shown.max())


def _draw(shown: Sequence[FigureData], titles: Sequence[str], column: str, quantity: Quantity) -> Drawing:
    curves = [_values(data, column) for data in shown]
    low, high = shared_limits(curves)
    figure, axes = new_grid(len(shown), 2, 1.9, sharex=True, sharey=True)
    for ax, data, title, curve in zip(axes, shown, titles, curves, strict=True):
        rows = data.select(data.cycles[0], 1)
        if column == "force":
            ax.plot(data.time_in_cycle(rows), rows["force_desired"], label="desired", **DESIRED_LINE)
        ax.plot(data.time_in_cycle(rows), curve, label="actual", **mark(0))
        if (far := np.abs(curve).max()) > max(abs(low), abs(high)):
            text = f"cut off: reaches {far:.3g} {quantity.unit}"
            ax.text(0.98, 0.95, text, transform=ax.transAxes, ha="right", va="top", backgroundcolor="white")
        label(ax, title, CLOCK if ax in axes[-2:] else "", f"{quantity.y}, {quantity.unit}")
        ax.tick_params(labelbottom=ax in axes[-2:])
    margin = 0.06 * (high - low or 1.0)
    axes[0].set_ylim(min(low, 0.0) - margin, max(high, 0.0) + margin)
    axes[0].set_xlim(0, max(data.duration for data in shown))
    legend_below(figure, axes[0])
    leg = " of leg 1" if any(data.legs > 1 for data in shown) else ""
    caption = f"{quantity.title}{leg} over the last whole cycle of each run, on the same axes."
    return Drawing(f"side-by-side-{column}", figure, caption)


def draw_side_by_side(runs: Sequence[RunSummary], names: Sequence[str]) -> list[Drawing]:
    """Force and errors of leg 1 over the last whole cycle of each run; none for runs of different machines
    or too many runs for one figure.

    Args:
        runs: with results.
        names: of the runs.
    """
    begun = [(run, name) for run, name in zip(runs, names, strict=True) if run.cycles]
    if not 1 < len(begun) <= MOST_CYCLES:
        return []
    if len({(run.config["scenario"], run.config["gait.cycle_time"]) for run, _ in begun}) > 1:
        return []
    shown = [read_figure_data(StoredRun(run.folder), [run.cycles]) for run, _ in begun]
    ended = [f"cycle {run.cycles}" + (f", {run.status}" if run.status != "completed" else "") for run, _ in begun]
    titles = [f"{name} ({end})" for (_, name), end in zip(begun, ended, strict=True)]
    axes = "yx" if any(map(moves_along_x, shown)) else "y"
    quantities = {"force": FORCE} | {axis: ERRORS[axis] for axis in axes}
    return [_draw(shown, titles, column, quantity) for column, quantity in quantities.items()]
