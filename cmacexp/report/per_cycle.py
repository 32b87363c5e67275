"""Figures of the metrics of one run, cycle by cycle."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.pooling import count_legs, describe_pooling, is_shown, pool_legs
from cmacexp.metrics.registry import SHOWN
from cmacexp.report.figure_data import legend_above, legend_below, logarithmic, mark, spans_decades, widen
from cmacexp.report.page import Drawing
from cmacexp.report.style import MARKERS, label, new_grid
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_MARKED = 30
"""A run of at most so many cycles has markers; a longer one has lines alone and a logarithmic axis."""
KEY = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse", "joint_rmse", "force_rmse", "feedforward_share")
"""The metrics that say most of each leg; tables show those that the run has."""
POSITIONS = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse", "support_rmse_x", "support_rmse_z")
PANELS = {
    "tracking error": ("RMS", POSITIONS),
    "error of the joints": ("RMS", ("joint_rmse",)),
    "force error": ("RMS", ("force_rmse", "force_rmse_three_feet", "force_ripple")),
    "force relative to its desired value": ("deviation", ("force_overshoot", "force_steady_state_error")),
    "settling of the force": ("settling time", ("force_settling_time",)),
    "torque": ("RMS and peak", ("feedback_rms", "feedforward_rms", "torque_peak")),
    "share of the feedforward": ("share", ("feedforward_share",)),
    "largest tilt of the body": ("angle", ("tilt_max",)),
    "height of the body": ("height", ("height_min", "height_mean", "height_max")),
    "least stability margin": ("margin", ("true_stability_margin_min", "stability_margin_min")),
}
"""What the y axis shows, and metrics of one unit that share it, by the title of the panel."""


def scale(axes: "Axes", last: int, values: Array, from_zero: bool = True) -> None:
    """Axes over cycles: whole numbers, logarithmic where a run is long or values span decades; see :func:`widen`."""
    from matplotlib.ticker import MaxNLocator

    if last > MOST_MARKED:
        logarithmic(axes, "x", [1, last])
    else:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    if spans_decades(values):
        logarithmic(axes, "y", values)
    widen(axes, values, from_zero)


def draw_metrics(run: StoredRun, torque_unit: str) -> Drawing:
    """The main metrics per cycle, pooled over the legs."""
    scores, pooled = run.scores, pool_legs(run.scores)
    values = {
        name: SHOWN[name].factor * own
        for name, own in pooled.items()
        if name in SHOWN and is_shown(name, pooled, count_legs(scores)) and np.isfinite(own).any() and own.any()
    }
    panels = {title: [name for name in names if name in values] for title, (_, names) in PANELS.items()}
    panels = {title: names for title, names in panels.items() if names}
    figure, axes = new_grid(len(panels), 2, 2.4)
    for ax, (title, names) in zip(axes, panels.items(), strict=True):
        for index, name in enumerate(names):
            cycles = range(1, len(values[name]) + 1)
            marker = MARKERS[index] if len(cycles) <= MOST_MARKED else None
            ax.plot(cycles, values[name], marker=marker, ms=4, label=SHOWN[name].title, **mark(index))
        shown = SHOWN[names[0]]
        scale(ax, len(cycles), np.concatenate([values[name] for name in names]), shown.from_zero)
        unit = torque_unit if shown.unit == "N m" else shown.unit
        label(ax, title, "cycle", f"{PANELS[title][0]}, {unit}")
        legend_above(ax)
    drawn = [name for names in panels.values() for name in names]
    pooling = f" Over the legs: {describe_pooling({name: name for name in drawn})}." if run.walks else ""
    return Drawing("metrics", figure, f"Metrics of each cycle.{pooling}")


def draw_legs(run: StoredRun) -> Drawing:
    """Errors and share of the feedforward of each leg, per cycle."""
    names = [name for name in KEY if name in run.metrics and is_shown(name, run.metrics, len(LEG_NAMES))]
    figure, axes = new_grid(len(names), 2, 2.3)
    for ax, name in zip(axes, names, strict=True):
        shown = SHOWN[name]
        for index, leg in enumerate(LEG_NAMES):
            own = run.metrics[run.metrics["leg"] == index + 1]
            marker = MARKERS[index] if len(own) <= MOST_MARKED else None
            ax.plot(own["cycle"], shown.factor * own[name], marker=marker, ms=4, label=leg, **mark(index))
        scale(ax, int(run.metrics["cycle"].max()), shown.factor * np.asarray(run.metrics[name]))
        label(ax, shown.title, "cycle", f"{shown.title}, {shown.unit}")
    legend_below(figure, axes[0])
    return Drawing("legs", figure, "Errors of each leg and the share of its feedforward, cycle by cycle.")
