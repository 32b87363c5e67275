"""Figures of the walk over time and over cycles: gait diagram (Fig. 14), foot forces, learning, lean, divergence."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.style import DASHES, DESIRED, MARKERS, SERIES, label, new_figure
from cmacexp.typing import Array
from pipelines.analysis.gait_events import Walk

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM, PERCENT = 1e3, 1e2
INK = "black"
MOST_MARKERS = 10
"""Markers of a line over cycles, at the most."""
LEAST_ERROR = 1e-2
"""Lower end of an axis of errors that diverge, mm."""
NAMES = ("1 left front", "2 right front", "3 left rear", "4 right rear")


def pooled(metrics: "pd.DataFrame") -> "pd.DataFrame":
    """Metrics per cycle over all legs: the root mean square of errors, the mean of shares."""
    columns = [name for name in metrics.columns if "rmse" in name or name == "feedback_rms"]
    squares = (metrics[columns] ** 2).groupby(metrics["cycle"]).mean()
    result = squares**0.5
    result["feedforward_share"] = metrics.groupby("cycle")["feedforward_share"].mean()
    return result


def whole_cycles(run: StoredRun) -> "pd.DataFrame":
    """:func:`pooled` metrics of the cycles that a run went through to their end."""
    table = pooled(run.metrics)
    return table if run.status == "completed" else table.iloc[:-1]


def _bars(support: Array, time: Array) -> list[tuple[float, float]]:
    """Begin and length of each run of support."""
    period = time[1] - time[0]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], support.astype(int), [0]])))
    return [(float(time[a]), float((b - a) * period)) for a, b in edges.reshape(-1, 2)]


def gait_diagram(walk: Walk, cycles: int = 2) -> "Figure":
    """Which foot is planned to be down when, over the first cycles (Fig. 14)."""
    rows = walk.view.cycle <= walk.view.cycle[0] + cycles - 1
    time = walk.view.time[rows]
    figure, (axes,) = new_figure(height=2.1)
    for i in range(4):
        axes.broken_barh(_bars(walk.support[rows, i], time), (3.0 - i - 0.26, 0.52), color=INK)
    for cycle in range(1, cycles):
        axes.axvline(cycle * (time[-1] + walk.period) / cycles, color=DESIRED, lw=0.9, ls="--")
    axes.set(yticks=range(4), ylim=(-0.6, 3.6), xlim=(0.0, time[-1] + walk.period))
    axes.set_yticklabels(NAMES[::-1])
    axes.grid(visible=False, axis="y")
    axes.set_axisbelow(True)
    label(axes, "support (black) and transfer (empty)", "time, s", "leg")
    return figure


def _shade(axes: "Axes", spans: Sequence[tuple[float, float]]) -> None:
    for begin, length in spans:
        axes.axvspan(begin, begin + length, color="#E6E9EE", lw=0.0, zorder=0)


def _mark(axes: "Axes", instants: Mapping[int, float]) -> None:
    """Dotted lines at the instants of figures, their numbers above; close ones share a text."""
    texts: dict[float, list[str]] = {}
    for number, when in sorted(instants.items()):
        axes.axvline(when, color=SERIES[0], lw=0.8, ls=":", zorder=1)
        texts.setdefault(round(when, 1), []).append(str(number))
    for when, numbers in texts.items():
        axes.text(when, 28.6, ", ".join(numbers), color=SERIES[0], fontsize=7.0, ha="center", va="top")


def foot_forces(walk: Walk, cycle: int, instants: Mapping[int, int]) -> "Figure":
    """Actual and desired force of each foot over a cycle; the instants of Fig. 17 to 20 are marked."""
    rows = np.flatnonzero(walk.view.cycle == cycle)
    time = walk.view.time[rows] - walk.view.time[rows[0]]
    figure, panels = new_figure(2, 2, 2.0, sharex=True, sharey=True)
    for i, axes in enumerate(panels):
        _shade(axes, _bars(~walk.support[rows, i], time))
        axes.plot(time, walk.force[rows, i], color=SERIES[1], lw=1.1, label="actual")
        axes.plot(time, walk.desired[rows, i], color=INK, lw=1.0, ls="--", label="desired")
        label(axes, f"foot {NAMES[i]}", "time in the cycle, s" if i > 1 else "", "force, N" if i % 2 == 0 else "")
        axes.set(xlim=(0.0, time[-1] + walk.period), ylim=(0.0, 29.0), xticks=np.arange(0.0, time[-1] + 0.1, 0.5))
        _mark(axes, {number: float(time[k - rows[0]]) for number, k in instants.items()})
    panels[0].legend(loc="upper left", bbox_to_anchor=(0.0, 0.93), ncols=2, borderaxespad=0.2)
    return figure


def _lines(axes: "Axes", lines: Mapping[str, "pd.Series"], scale: float, first: int = 0) -> None:
    for i, (name, values) in enumerate(lines.items(), start=first):
        every = max(1, len(values) // MOST_MARKERS)
        axes.plot(
            values.index,
            scale * values,
            color=SERIES[i],
            ls=DASHES[i],
            marker=MARKERS[i],
            ms=3.5,
            markevery=every,
            label=name,
        )


def _legend(figure: "Figure", axes: "Axes") -> None:
    """One legend for all panels, above them."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=4)


def learning(runs: Mapping[str, "pd.DataFrame"]) -> "Figure":
    """Per cycle: the share of the feedback, the transfer error, the force error with three feet down, of each run.

    Args:
        runs: :func:`pooled` metrics by name.
    """
    figure, (share, position, force) = new_figure(1, 3, 2.7)
    _lines(share, {name: 1.0 - run["feedforward_share"] for name, run in runs.items()}, PERCENT)
    _lines(position, {name: run["transfer_rmse_y"] for name, run in runs.items()}, MM)
    _lines(force, {name: run["force_rmse_three_feet"] for name, run in runs.items()}, 1.0)
    label(share, "share of feedback", "cycle", "of all torque, %")
    label(position, "transfer error, vertical", "cycle", "root mean square, mm")
    label(force, "force error, three feet", "cycle", "root mean square, N")
    share.set_ylim(bottom=0.0)
    position.set_yscale("log")
    force.set_yscale("log")
    _legend(figure, share)
    return figure


def lean(runs: Mapping[str, "pd.DataFrame"], hip_height: float) -> "Figure":
    """Per cycle: the largest tilt, and how much too high the body stands on average.

    Args:
        runs: metrics of the body by name.
        hip_height: at which it is to stand, m.
    """
    figure, (tilt, height) = new_figure(1, 2, 2.7)
    per_cycle = {name: run.set_index("cycle") for name, run in runs.items()}
    _lines(tilt, {name: run["tilt_max"] for name, run in per_cycle.items()}, MM)
    _lines(height, {name: run["height_mean"] - hip_height for name, run in per_cycle.items()}, MM)
    label(tilt, "largest tilt in a cycle", "cycle", "larger of |pitch| and |roll|, mrad")
    label(height, "mean height over the planned one", "cycle", "mm")
    tilt.set_ylim(bottom=0.0)
    _legend(figure, tilt)
    return figure


def divergence(runs: Mapping[str, "pd.DataFrame"]) -> "Figure":
    """Per cycle of long runs: transfer errors and the feedback torque.

    Args:
        runs: :func:`pooled` metrics by name.
    """
    figure, (x, y, torque) = new_figure(1, 3, 2.7)
    for axes, column, scale, title, unit in (
        (x, "transfer_rmse_x", MM, "transfer error, forward", "root mean square, mm"),
        (y, "transfer_rmse_y", MM, "transfer error, vertical", "root mean square, mm"),
        (torque, "feedback_rms", 1.0, "feedback torque", "root mean square, N m"),
    ):
        _lines(axes, {name: run[column] for name, run in runs.items()}, scale)
        axes.set_yscale("log")
        label(axes, title, "cycle", unit)
    low = min(axes.get_ylim()[0] for axes in (x, y))
    high = max(axes.get_ylim()[1] for axes in (x, y))
    for axes in (x, y):
        axes.set_ylim(max(low, LEAST_ERROR), high)
    _legend(figure, x)
    return figure
