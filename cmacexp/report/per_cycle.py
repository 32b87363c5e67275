"""Drawings of the metrics of one run, cycle by cycle."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.summary import COLUMNS, LARGEST, MEAN, RMS
from cmacexp.report.figure_data import legend_above, legend_below, logarithmic, mark, spans_decades
from cmacexp.report.page import Drawing
from cmacexp.report.style import MARKERS, label, new_figure
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

MOST_MARKED = 30
"""Cycles up to which each has its marker; a longer run has lines alone, and a logarithmic axis from here on."""


class Panel(NamedTuple):
    """Metrics of one unit in one pair of axes, with the name of each line."""

    title: str
    unit: str
    factor: float
    lines: dict[str, str]


PANELS = (
    Panel(
        "tracking error, RMS",
        "mm",
        1e3,
        {"transfer_rmse_x": "transfer x", "transfer_rmse_y": "transfer y", "support_rmse_x": "support x"},
    ),
    Panel(
        "force error, RMS",
        "N",
        1.0,
        {"force_rmse": "support", "force_rmse_three_feet": "three feet", "force_ripple": "ripple"},
    ),
    Panel(
        "force over its desired value",
        "%",
        100.0,
        {"force_overshoot": "overshoot", "force_steady_state_error": "steady state"},
    ),
    Panel("settling of the force", "s", 1.0, {"force_settling_time": "settling time"}),
    Panel(
        "torque, RMS and peak",
        "N m",
        1.0,
        {"feedback_rms": "feedback", "feedforward_rms": "feedforward", "torque_peak": "peak"},
    ),
    Panel("share of the feedforward", "%", 100.0, {"feedforward_share": "feedforward"}),
    Panel("largest tilt of the body", "mrad", 1e3, {"tilt_max": "tilt"}),
    Panel("height of the body", "mm", 1e3, {"height_min": "least", "height_mean": "mean", "height_max": "largest"}),
)


def pooling(name: str) -> str:
    """How a metric of several legs becomes one."""
    if name in COLUMNS:
        return COLUMNS[name].pool
    return LARGEST if name == "torque_peak" else RMS if "rms" in name else MEAN


def pooled(metrics: "pd.DataFrame", name: str) -> "tuple[Array, Array]":
    """Cycles, and one metric of each over all legs; NaN where it is undefined for all."""
    values = metrics[name]
    how = pooling(name)
    groups = (values**2 if how == RMS else values).groupby(metrics["cycle"])
    result = groups.max() if how == LARGEST else groups.mean()
    numbers = np.asarray(result.to_numpy(), dtype=float)
    return np.asarray(result.index), np.sqrt(numbers) if how == RMS else numbers


def scale(axes: "Axes", last: int, values: Array) -> None:
    """Axes over cycles: whole numbers, logarithmic where a run is long or values span decades."""
    from matplotlib.ticker import MaxNLocator

    if last > MOST_MARKED:
        logarithmic(axes, "x", [1, last])
    else:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    if spans_decades(values):
        logarithmic(axes, "y", values)


def _tables(run: StoredRun) -> "list[pd.DataFrame]":
    return [run.metrics, run.body_metrics] if run.walks else [run.metrics]


def _panel(axes: "Axes", run: StoredRun, panel: Panel, lines: dict[str, tuple[Array, Array]], unit: str) -> None:
    for index, (name, (cycles, values)) in enumerate(lines.items()):
        marker = MARKERS[index] if len(cycles) <= MOST_MARKED else None
        axes.plot(cycles, panel.factor * values, marker=marker, ms=4, label=panel.lines[name], **mark(index))
    everything = panel.factor * np.concatenate([values for _, values in lines.values()])
    scale(axes, int(run.metrics["cycle"].max()), everything)
    label(axes, panel.title, "cycle", unit)
    legend_above(axes)


def metrics(run: StoredRun, torque_unit: str) -> Drawing:
    """The main metrics per cycle, pooled over the legs."""
    shown: list[tuple[Panel, dict[str, tuple[Array, Array]]]] = []
    for panel in PANELS:
        lines = {n: pooled(table, n) for n in panel.lines for table in _tables(run) if n in table}
        lines = {name: line for name, line in lines.items() if np.isfinite(line[1]).any() and np.any(line[1] != 0.0)}
        if run.walks and panel.title == "force over its desired value":
            continue
        if lines:
            shown.append((panel, lines))
    figure, axes = new_figure(-(-len(shown) // 2), 2, 2.4)
    for ax, (panel, lines) in zip(axes, shown, strict=False):
        _panel(ax, run, panel, lines, torque_unit if panel.unit == "N m" else panel.unit)
    for ax in axes[len(shown) :]:
        ax.remove()
    legs = " Those of the four legs are pooled: RMS of RMS, largest of peaks, mean of others." if run.walks else ""
    return Drawing("metrics", figure, f"Metrics of each cycle.{legs}")


def of_each_leg(run: StoredRun) -> Drawing:
    """Errors and share of the feedforward of each leg, per cycle."""
    names = ("transfer_rmse_x", "transfer_rmse_y", "force_rmse", "feedforward_share")
    figure, axes = new_figure(2, 2, 2.3)
    for ax, name in zip(axes, names, strict=True):
        how = COLUMNS[name]
        for index, leg in enumerate(LEG_NAMES):
            own = run.metrics[run.metrics["leg"] == index + 1]
            marker = MARKERS[index] if len(own) <= MOST_MARKED else None
            ax.plot(own["cycle"], how.factor * own[name], marker=marker, ms=4, label=leg, **mark(index))
        scale(ax, int(run.metrics["cycle"].max()), how.factor * np.asarray(run.metrics[name]))
        label(ax, how.title, "cycle", how.unit)
    legend_below(figure, axes[0])
    return Drawing("legs", figure, "Errors of each leg and the share of its feedforward, cycle by cycle.")
