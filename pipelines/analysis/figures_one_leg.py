"""Figures 7 to 13 of Lin & Song 1997 from the trace of one leg, in the paper's layout and count of data points."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.style import DASHES, DESIRED, FEEDBACK, FEEDFORWARD, GROUND, SERIES, label, new_figure
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cmacexp.data.stored_run import StoredRun

CYCLES = (1, 2, 5)
"""Cycles that the paper shows, one after the other, as data points 0 to 1800."""
LOOKS = {
    cycle: {"color": SERIES[i], "ls": dash}
    for i, (cycle, dash) in enumerate(zip(CYCLES, ("--", "-.", "-"), strict=True))
}
ACTUAL = {"color": SERIES[1], "ls": "--"}
AXES = ("x", "y")
DIRECTIONS = {"x": "x forward", "y": "y down"}
MM = 1e3
SHADE = "#F0F0F0"
"""Behind support."""
BEFORE = 40
"""Data points of the support before the first that Fig. 8 shows, to make the jump at lift-off visible."""


def data_points(rows: "pd.DataFrame", cycle: int) -> Array:
    """The paper's numbers of the samples of one of its cycles."""
    return CYCLES.index(cycle) * len(rows) + np.arange(len(rows))


def phases(rows: "pd.DataFrame") -> list[slice]:
    """The samples of each phase in a cycle, in order."""
    support = (rows["phase"] == "support").to_numpy()
    edges = [0, *(np.flatnonzero(np.diff(support)) + 1), len(support)]
    return [slice(a, b) for a, b in pairwise(edges)]


def touch_down(rows: "pd.DataFrame") -> int:
    """The first sample of support in a cycle."""
    return int(np.argmax((rows["phase"] == "support").to_numpy()))


def derivative(rows: "pd.DataFrame", values: Array) -> Array:
    """Differences of ``values`` over time, within each phase by itself, so that a jump between phases stays one."""
    time, result = rows["time"].to_numpy(), np.empty(len(rows))
    for part in phases(rows):
        result[part] = np.gradient(values[part], time[part], edge_order=2)
    return result


def velocity_jumps(rows: "pd.DataFrame", axis: str) -> tuple[float, float]:
    """By how much the desired velocity jumps at lift-off and at touch-down, m/s."""
    velocity = derivative(rows, rows[f"{axis}_desired"].to_numpy())
    lift_off, landing = (part.start for part in phases(rows))
    return float(velocity[lift_off] - velocity[-1]), float(velocity[landing] - velocity[landing - 1])


def _ground(axes: "Axes", level: float) -> None:
    axes.axhline(level, color=GROUND, lw=0.9, zorder=1)
    axes.annotate(
        "ground", (0.0, level), (0, -3), textcoords="offset points", color=GROUND, fontsize=7.5, ha="center", va="top"
    )


def _level(run: "StoredRun") -> float:
    return MM * float(run.config["machine"]["hip_height"])


def _shade_support(axes: "Axes", point: Array, landing: int) -> None:
    axes.axvspan(point[landing], point[-1] + 1, color=SHADE, lw=0, zorder=0)
    axes.set_xlim(point[0], point[-1] + 1)
    axes.set_xticks(np.linspace(point[0], point[-1] + 1, 4))


def _legend_below(figure: "Figure", axes: "Axes") -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))


def glance(run: "StoredRun") -> "Figure":
    """Foot path, force and torques in the paper's cycles: the story in one picture."""
    figure, (path, force, torque) = new_figure(1, 3, height=2.7)
    first = run.cycle(CYCLES[0])
    since = first["time"].to_numpy() - first["time"].iloc[0]
    path.plot(MM * first["x_desired"], MM * first["y_desired"], color=DESIRED, lw=2.2, label="desired")
    force.plot(since, first["force_desired"], color=DESIRED, lw=2.2)
    for cycle, look in LOOKS.items():
        rows = run.cycle(cycle)
        name = f"cycle {cycle}" + (", feedback only" if cycle == 1 else "")
        path.plot(MM * rows["x"], MM * rows["y"], label=name, **look)
        force.plot(since, rows["force"], **look)
    path.invert_yaxis()
    _ground(path, _level(run))
    last = run.cycle(CYCLES[-1])
    torque.plot(since, last["tau_feedforward_1"], color=FEEDFORWARD, label="from CMAC")
    torque.plot(since, last["tau_feedback_1"], color=FEEDBACK, ls="--", label="from feedback")
    torque.legend(loc="upper right")
    label(path, "foot", "x forward, mm", "y down, mm")
    label(force, "contact force", "time in the cycle, s", "force, N")
    label(torque, f"torque of joint 1, cycle {CYCLES[-1]}", "time in the cycle, s", "torque, N m")
    _legend_below(figure, path)
    return figure


def trajectory(run: "StoredRun") -> "Figure":
    """Fig. 7: desired path in transfer and reference positions in support, in the plane and over a cycle."""
    figure, (plane, time) = new_figure(1, 2, height=3.2, width_ratios=(1.25, 1.0))
    rows = run.cycle(1)
    point, landing = data_points(rows, 1), touch_down(rows)
    swing, stance = phases(rows)
    links = run.config["machine"]["leg"]
    reach = MM * (links["length_1"] + links["length_2"])
    x, y = MM * rows["x_desired"].to_numpy(), MM * rows["y_desired"].to_numpy()
    reference = MM * rows["y_reference"].to_numpy()
    plane.plot(x[swing], y[swing], color=SERIES[1], label="desired, transfer")
    plane.plot(x[stance], y[stance], color=DESIRED, lw=2.2, label="desired, support (depth of $F_d$)")
    plane.plot(x[stance], reference[stance], color=SERIES[0], ls="--", label="reference $D_r$, support")
    across = np.linspace(x.min() - 30.0, x.max() + 30.0, 60)
    plane.plot(across, np.sqrt(reach**2 - across**2), color="black", ls=":", lw=1.0, label="reach of the leg")
    plane.invert_yaxis()
    _ground(plane, _level(run))
    time.plot(point[swing], y[swing], color=SERIES[1])
    time.plot(point[stance], y[stance], color=DESIRED, lw=2.2)
    time.plot(point[stance], reference[stance], color=SERIES[0], ls="--")
    _shade_support(time, point, landing)
    time.invert_yaxis()
    label(plane, "in the plane of the leg", "x forward of the hip, mm", "y down from the hip, mm")
    label(time, "over a cycle (grey: support)", "data point", "y down, mm")
    _legend_below(figure, plane)
    figure.legends[0].set_ncols(2)
    return figure


def _motion(run: "StoredRun", order: int, names: Sequence[str], unit: str) -> "Figure":
    figure, both = new_figure(1, 2, height=2.5)
    rows = run.cycle(1)
    point, landing = data_points(rows, 1), touch_down(rows)
    for axes, axis, name in zip(both, AXES, names, strict=True):
        values = rows[f"{axis}_desired"].to_numpy()
        for _ in range(order):
            values = derivative(rows, values)
        for part in phases(rows):
            axes.plot(point[part], values[part], color=SERIES[1])
        _shade_support(axes, point, landing)
        label(axes, f"{name} (grey: support)", "data point", f"{DIRECTIONS[axis]}, {unit}")
    return figure


def velocities(run: "StoredRun") -> "Figure":
    """Fig. 8: desired velocities of the foot, with the jumps of the cubic drawn as such."""
    figure = _motion(run, 1, ("horizontal velocity", "vertical velocity"), "m/s")
    vertical, rows = figure.axes[1], run.cycle(1)
    velocity = derivative(rows, rows["y_desired"].to_numpy())
    landing = touch_down(rows)
    vertical.axvspan(-BEFORE, 0, color=SHADE, lw=0, zorder=0)
    vertical.plot([-BEFORE, 0], [velocity[-1], velocity[-1]], color=SERIES[1])
    vertical.set_xlim(left=-BEFORE)
    for at, end, size in zip((0, landing), (0, landing - 1), velocity_jumps(rows, "y"), strict=True):
        vertical.plot([at, at], [0.0, velocity[end]], color=SERIES[0], ls=":", lw=1.6)
        vertical.annotate(
            f"jump of {abs(size):.2f} m/s",
            (at, velocity[end]),
            (26, 0),
            textcoords="offset points",
            va="center",
            color=SERIES[0],
            arrowprops={"arrowstyle": "-", "color": SERIES[0], "lw": 0.7},
        )
    return figure


def accelerations(run: "StoredRun") -> "Figure":
    """Fig. 9: desired accelerations of the foot within the phases."""
    return _motion(run, 2, ("horizontal acceleration", "vertical acceleration"), "m/s²")


def tracking(run: "StoredRun", cycle: int) -> "Figure":
    """Fig. 10, 11: desired and actual foot position over the paper's data points, and as a path."""
    figure, (*over_time, path) = new_figure(1, 3, height=2.6)
    rows = run.cycle(cycle)
    point, landing = data_points(rows, cycle), touch_down(rows)
    for axes, axis in zip(over_time, AXES, strict=True):
        axes.plot(point, MM * rows[f"{axis}_desired"], color=DESIRED, lw=2.2, label="desired")
        axes.plot(point, MM * rows[axis], label=f"actual, cycle {cycle}", **ACTUAL)
        _shade_support(axes, point, landing)
        label(axes, f"{axis} (grey: support)", "data point", f"{DIRECTIONS[axis]}, mm")
    path.plot(MM * rows["x_desired"], MM * rows["y_desired"], color=DESIRED, lw=2.2)
    path.plot(MM * rows["x"], MM * rows["y"], **ACTUAL)
    for axes in (over_time[1], path):
        axes.set_ylim(670.0, 425.0)
    path.set_xlim(-135.0, 135.0)
    _ground(path, _level(run))
    label(path, "path", "x forward, mm", "y down, mm")
    _legend_below(figure, over_time[0])
    return figure


def forces(run: "StoredRun", band: float) -> "Figure":
    """Fig. 12: desired and actual force in the paper's cycles; ``band`` is the relative error to be marked."""
    figure, panels = new_figure(1, len(CYCLES), height=2.6, sharey=True)
    for axes, cycle in zip(panels, CYCLES, strict=True):
        rows = run.cycle(cycle)
        point, landing = data_points(rows, cycle), touch_down(rows)
        desired = rows["force_desired"].to_numpy()
        axes.fill_between(
            point[landing:],
            (1.0 - band) * desired[landing:],
            (1.0 + band) * desired[landing:],
            color="#CFE3F1",
            lw=0,
            label=f"within {band:.0%}",
        )
        axes.plot(point, desired, color=DESIRED, lw=1.8, label="desired")
        axes.plot(point, rows["force"], label="actual", **ACTUAL)
        axes.set_xlim(point[0], point[-1] + 1)
        axes.set_xticks(np.linspace(point[0], point[-1] + 1, 4))
        who = "feedback only" if cycle == 1 else "with CMAC"
        label(axes, f"cycle {cycle}, {who}", "data point", "force, N" if cycle == 1 else "")
    _legend_below(figure, panels[0])
    return figure


def torques(run: "StoredRun") -> "Figure":
    """Fig. 13: torque of joint 1 by who gives it, over the last of the paper's cycles and around touch-down."""
    figure, (whole, detail) = new_figure(1, 2, height=2.9, sharey=True, width_ratios=(1.5, 1.0))
    cycle = CYCLES[-1]
    rows = run.cycle(cycle)
    point, landing = data_points(rows, cycle), touch_down(rows)
    feedback, feedforward = rows["tau_feedback_1"].to_numpy(), rows["tau_feedforward_1"].to_numpy()
    for axes in (whole, detail):
        axes.plot(point, feedback + feedforward, color="#B5B5B5", lw=2.4, label="total")
        axes.plot(point, feedforward, color=FEEDFORWARD, lw=1.1, label="feedforward (CMAC)")
        axes.plot(point, feedback, color=FEEDBACK, lw=1.1, ls=DASHES[1], label="feedback")
    whole.set_xlim(point[0], point[-1] + 1)
    detail.set_xlim(point[landing] - 30, point[landing] + 90)
    detail.axvline(point[landing], color="black", lw=0.8, ls=":")
    detail.annotate(
        f"touch-down,\ndata point {point[landing]}",
        (point[landing], 0.97),
        (6, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        va="top",
        fontsize=7.5,
    )
    label(whole, f"joint 1, cycle {cycle}", "data point", "torque, N m")
    label(detail, "around touch-down", "data point", "")
    _legend_below(figure, whole)
    return figure
