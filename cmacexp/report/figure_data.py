"""Data of some cycles of a run for figures, and the marks, axes and legends that figures share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY
from cmacexp.metrics.block import THIRD_AXIS
from cmacexp.report.style import DASHES, DESIRED, SERIES
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_CYCLES = 6
"""Cycles that are distinguishable in one figure."""
SUPPORT = "#F1F1F1"
"""Shade behind the planned support."""
LEAST_SPAN = 0.05
"""Least part of the values that an axis spans which does not begin at zero."""
DECADES = 20.0
"""Positive values that span more than this factor are drawn on a logarithmic axis."""
LEAST_RATIO = 5.0
"""A logarithmic axis over less than this factor has evenly spaced numbers: 1, 2 and 5 would be too few."""


@dataclass(frozen=True)
class FigureData:
    """Some cycles of a run, for figures."""

    cycles: Sequence[int]
    trace: "pd.DataFrame"
    body: "pd.DataFrame | None"
    cycle_time: float
    period: float
    """Between two samples, s."""
    legs: int
    has_joints: bool
    axes: str
    """Those in which a foot moves: x and y and, of a robot, z; there are as many joints."""

    @property
    def in_space(self) -> bool:
        """Whether the legs move in space: those of a robot."""
        return THIRD_AXIS in self.axes

    def select(self, cycle: int, leg: int) -> "pd.DataFrame":
        """The trace of one leg in one cycle."""
        return self.trace[(self.trace["cycle"] == cycle) & (self.trace["leg"] == leg)]

    def select_body(self, cycle: int) -> "pd.DataFrame":
        """The trace of the body in one cycle."""
        assert self.body is not None
        return self.body[self.body["cycle"] == cycle]

    def time_in_cycle(self, rows: "pd.DataFrame") -> Array:
        """Time since the cycle began, s."""
        return np.asarray(rows["time"] - (rows["cycle"] - 1) * self.cycle_time)

    @property
    def duration(self) -> float:
        """Duration of the longest of the cycles, s; less than a cycle if the run stopped in its first."""
        return float(self.time_in_cycle(self.trace).max()) + self.period

    def line(self, index: int) -> dict[str, Any]:
        """The line of one of the cycles, and its name; the last is the strongest."""
        last = index == len(self.cycles) - 1
        style = {**mark(0), "linewidth": 2.0, "zorder": 2.5} if last else {**mark(index + 1), "linewidth": 1.1}
        return {**style, "label": f"cycle {self.cycles[index]}"}

    def leg_name(self, leg: int) -> str:
        """E.g. ``leg 1, left front``; empty if there is one leg only."""
        return f"leg {leg}, {LEG_NAMES[leg - 1]}" if self.legs > 1 else ""


def read_figure_data(run: StoredRun, cycles: Sequence[int]) -> FigureData:
    """Read some cycles of a run."""
    trace = run.cycles(cycles)
    body = run.cycles(cycles, BODY) if run.walks else None
    has_joints = bool(trace["q1"].notna().any())
    times = run.config["gait"]["cycle_time"], run.config["sampling_period"]
    axes = "xyz" if THIRD_AXIS in trace.columns else "xy"
    return FigureData(cycles, trace, body, *times, int(trace["leg"].max()), has_joints, axes)


def mark(index: int) -> dict[str, Any]:
    """Colour and dash of line number ``index``; no two of the first 49 are the same."""
    return {"color": SERIES[index % 7], "linestyle": DASHES[(index + index // 7) % 7]}


def widen(axes: "Axes", values: Sequence[float] | Array, from_zero: bool = True) -> None:
    """Widen a linear y axis so that it does not exaggerate differences.

    Args:
        axes: with everything drawn.
        values: on this axis.
        from_zero: it includes zero; else it spans at least :data:`LEAST_SPAN` of the values.
    """
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size or axes.get_yscale() != "linear":
        return
    middle, half = (known.min() + known.max()) / 2.0, LEAST_SPAN * np.abs(known).max() / 2.0
    included = [0.0] if from_zero else [middle - half, middle + half]
    axes.update_datalim([(0.0, value) for value in included], updatex=False)
    axes.autoscale_view(scalex=False)


DESIRED_LINE: dict[str, Any] = {"color": DESIRED, "linewidth": 2.6, "alpha": 0.6, "zorder": 1.9}


def spans_decades(values: Sequence[float] | Array) -> bool:
    """Whether values need a logarithmic axis: none is negative, and those above 0 span more than :data:`DECADES`."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    above = known[known > 0]
    return bool(above.size and known.min() >= 0 and above.max() > DECADES * above.min())


def logarithmic(axes: "Axes", which: str, values: Sequence[float] | Array) -> None:
    """Make one axis logarithmic, with plain numbers at its ticks.

    Args:
        axes: to change.
        which: ``x`` or ``y``.
        values: on this axis; those not above 0 are not drawn.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & (known > 0)]
    (axes.set_xscale if which == "x" else axes.set_yscale)("log", nonpositive="mask")
    axis = axes.xaxis if which == "x" else axes.yaxis
    ratio = known.max() / known.min()
    few = LogLocator(subs=(1.0, 2.0, 5.0) if ratio < 1e2 else (1.0,))
    axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10]) if ratio < LEAST_RATIO else few)
    if ratio < LEAST_RATIO:
        axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def legend_below(figure: "Figure", axes: "Axes", columns: int = 6, title: str = "") -> None:
    """One legend for all axes of a figure, clear of the data; each name appears once; a single name has none."""
    handles, names = axes.get_legend_handles_labels()
    put_legend_below(figure, dict(zip(names, handles, strict=True)), columns, title)


def put_legend_below(figure: "Figure", handles: Mapping[str, Any], columns: int = 6, title: str = "") -> None:
    """:func:`legend_below` of given handles, by name."""
    if len(handles) > 1 or title:
        columns = max(1, min(columns, len(handles), 112 // (8 + max(map(len, handles)))))
        place: dict[str, Any] = {"loc": "outside lower center", "ncols": columns, "handlelength": 3}
        figure.legend(list(handles.values()), list(handles), title=title or None, **place)


def legend_above(axes: "Axes") -> None:
    """A legend between title and axes, clear of the data; a single line has none, but its place stays free."""
    handles, _ = axes.get_legend_handles_labels()
    axes.set_title(axes.get_title(loc="left"), pad=18)
    if len(handles) > 1:
        place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.02, 0.99), "borderaxespad": 0.1}
        legend = axes.legend(ncols=len(handles), handlelength=2.2, columnspacing=1.0, **place)
        legend.set_in_layout(False)
