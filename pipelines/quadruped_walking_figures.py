"""Figures of the walk over time: gait diagram (Fig. 14) and foot forces."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figure_data import put_legend_below
from cmacexp.report.style import DESIRED, SERIES, label, new_figure
from cmacexp.typing import Array
from pipelines.quadruped_walking_events import Walk, instants

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SHADE = "black", "#E6E9EE"
NAMES = ("1 left front", "2 right front", "3 left rear", "4 right rear")


def _bars(down: Array, time: Array) -> list[tuple[float, float]]:
    """Begin and length of each run of True."""
    period = time[1] - time[0]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], down.astype(int), [0]])))
    return [(float(time[a]), float((b - a) * period)) for a, b in edges.reshape(-1, 2)]


def gait_diagram(walk: Walk, cycles: int = 2) -> "Figure":
    """Which foot is planned to be down, and which carries, over the last cycles (Fig. 14)."""
    from matplotlib.patches import Patch

    rows = walk.view.cycle > walk.view.cycle[-1] - cycles
    time = walk.view.time[rows] - walk.view.time[rows][0]
    figure, (axes,) = new_figure(height=2.4)
    for i in range(4):
        axes.broken_barh(_bars(walk.support[rows, i], time), (2.98 - i, 0.3), color=INK)
        axes.broken_barh(_bars(walk.force[rows, i] > 0.0, time), (2.72 - i, 0.22), color=SERIES[1])
    for cycle in range(1, cycles):
        axes.axvline(cycle * (time[-1] + walk.period) / cycles, color=DESIRED, lw=0.9, ls="--")
    axes.set(yticks=range(4), ylim=(-0.6, 3.6), xlim=(0.0, time[-1] + walk.period))
    axes.set_yticklabels(NAMES[::-1])
    axes.grid(visible=False, axis="y")
    axes.set_axisbelow(True)
    label(axes, "support and transfer", "time, s", "leg")
    put_legend_below(figure, {"planned support": Patch(color=INK), "foot carries": Patch(color=SERIES[1])})
    return figure


def _shade(axes: "Axes", spans: Sequence[tuple[float, float]]) -> None:
    for begin, length in spans:
        axes.axvspan(begin, begin + length, color=SHADE, lw=0.0, zorder=0)


def _mark(axes: "Axes", times: Mapping[int, float], height: float) -> None:
    """Dotted lines at the instants of figures, their numbers above; close ones share a text."""
    texts: dict[float, list[str]] = {}
    for number, when in sorted(times.items()):
        axes.axvline(when, color=SERIES[0], lw=0.8, ls=":", zorder=1)
        texts.setdefault(round(when, 1), []).append(str(number))
    for when, numbers in texts.items():
        axes.text(when, height, ", ".join(numbers), color=SERIES[0], fontsize=7.0, ha="center", va="top")


def foot_forces(walk: Walk, cycle: int) -> "Figure":
    """Actual and desired force of each foot over a cycle; the instants of Fig. 17 to 20 are marked."""
    from matplotlib.patches import Patch

    rows = np.flatnonzero(walk.view.cycle == cycle)
    time = walk.view.time[rows] - walk.view.time[rows[0]]
    times = {number: float(time[k - rows[0]]) for number, k in instants(walk, cycle).items()}
    top = 1.15 * float(max(walk.force[rows].max(), walk.desired[rows].max()))
    figure, panels = new_figure(2, 2, 2.0, sharex=True, sharey=True)
    for i, axes in enumerate(panels):
        _shade(axes, _bars(~walk.support[rows, i], time))
        (actual,) = axes.plot(time, walk.force[rows, i], color=SERIES[1], lw=1.1)
        (desired,) = axes.plot(time, walk.desired[rows, i], color=INK, lw=1.0, ls="--")
        label(axes, f"foot {NAMES[i]}", "time in the cycle, s" if i > 1 else "", "force, N" if i % 2 == 0 else "")
        axes.set(xlim=(0.0, time[-1] + walk.period), ylim=(0.0, top))
        _mark(axes, times, 0.99 * top)
    put_legend_below(figure, {"actual": actual, "desired": desired, "planned transfer": Patch(color=SHADE)})
    return figure
