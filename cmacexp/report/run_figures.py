"""Figures of one run: metrics of each cycle, signals over the time of selected cycles, and the last steps."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.run import Run
from cmacexp.data.tables import as_array
from cmacexp.data.trace import LAST_STEPS
from cmacexp.metrics.registry import count_legs, pool_legs, select_main
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.recording.series import AXES, Plot, list_plots
from cmacexp.report.figures import DESIRED_LINE, Panel, Series, draw, over_cycles
from cmacexp.report.page import Drawing
from cmacexp.report.style import DASHES, colour, mark
from cmacexp.typing import Array, Mask, Status

CLOCK = "time in the cycle, s"
LAST = slice(-LAST_STEPS, None)
"""The last steps of a run."""
DIGITS = 3
"""Decimals to which the desired values of two cycles are compared, in the unit of the plot."""


def draw_metrics(run: Run) -> Drawing:
    """Draw the main metrics over the cycles, pooled over the legs; for several legs also those of each leg."""
    pooled = pool_legs(run.scores)
    count = count_legs(run.scores)
    panels = []
    for name in select_main(pooled, count):
        lines = {"all legs": [pooled[name]]}
        if count > 1 and name in run.scores.legs.column_names:
            lines |= {LEG_NAMES[leg]: [as_array(run.scores.legs, name)[leg::count]] for leg in range(count)}
        panels.append(over_cycles(name, lines))
    return Drawing("metrics", draw(panels, height=2.1), "Metrics of each cycle.")


def find_support(view: RunView, leg: int) -> list[tuple[float, float]]:
    """Return start and end of each planned support of a leg in the first cycle, s after the start of the cycle.

    Empty if the leg supports all the time, and for the body (``leg`` is 0).
    """
    if not leg:
        return []
    first = view.cycle == view.cycles[0]
    support = view.trace.support[first, leg - 1]
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    clock = np.append(view.clock[first], view.run.config["gait"]["cycle_time"])
    return [] if support.all() else list(zip(clock[edges[::2]], clock[edges[1::2]], strict=True))


def name_leg(view: RunView, leg: int) -> str:
    """Return the title of a leg, e.g. ``leg 1, left front``; empty for a single leg, and for the body (0)."""
    return f"leg {leg}, {view.names[leg - 1]}" if leg and view.walks else ""


FOOT = "foot"
MARGIN = "stability_margin"
QUANTITIES = {
    "force": ("force", "actual", "contact force"),
    **{axis: ("error", name, f"error along {axis}") for axis, (name, _) in AXES.items()},
    "height": ("height", "height", "height of the body"),
    MARGIN: ("margins", "true, nearest edge", "stability margin"),
    "pitch": ("tilt", "pitch, nose down", "pitch, nose down"),
    "roll": ("tilt", "roll, right side down", "roll, right side down"),
}
"""Quantities over the time of a cycle: plot and line of the recording that show them, and title."""
CAPTIONS = {
    FOOT: "Paths of the feet in the frames of their hips, y down.",
    "force": "Contact force.",
    "x": "Error of the foot along x, forward.",
    "y": "Error of the foot along y, down; in support relative to the depression at the desired force.",
    "z": "Error of the foot along z, to the left.",
}
BODY_QUANTITIES = ("height", MARGIN, "pitch", "roll")


def _style(view: RunView, cycle: int) -> dict[str, Any]:
    """Return the line style of a cycle; the last cycle has the widest lines."""
    if cycle == view.cycles[-1]:
        return {**mark(0), "linewidth": 2.0, "zorder": 2.5}
    return {**mark(view.cycles.index(cycle) + 1), "linewidth": 1.1}


def _list_lines(view: RunView, x: Array, y: Array, planned: tuple[str, Array, Array] | None = None) -> list[Series]:
    """List a line per cycle of y over x, both (steps,), and behind them grey lines of the desired values.

    ``planned`` holds the name, x and y of the desired values. Cycles with equal desired values share a grey line;
    those of a robot differ, since it adapts its plan to the load of its feet and to its course.
    """
    desired = {}
    lines = []
    for cycle in view.cycles:
        in_cycle = view.cycle == cycle
        if planned is not None:
            plan = np.array([values[in_cycle] for values in planned[1:]])
            desired[np.round(plan, DIGITS).tobytes()] = Series(planned[0], plan[0], plan[1], style=DESIRED_LINE)
        lines.append(Series(f"cycle {cycle}", x[in_cycle], y[in_cycle], style=_style(view, cycle)))
    return [*desired.values(), *lines]


def _draw_path(view: RunView, leg: int) -> Panel:
    """Draw the path of a foot in each cycle, mm, in the frame of its hip."""
    x, y, x_desired, y_desired = (1e3 * view.trace[name][:, leg - 1] for name in ("x", "y", "x_desired", "y_desired"))
    lines = _list_lines(view, x, y, ("desired", x_desired, y_desired))
    return Panel(name_leg(view, leg) or "foot path", "x forward, mm", "y down, mm", lines, equal=True, y_down=True)


def _over_clock(view: RunView, panel: Panel, leg: int) -> Panel:
    """Return a panel whose x axis spans the longest selected cycle, with the planned support of a leg shaded."""
    longest = float(view.clock.max()) + float(view.run.config["sampling_period"])
    return replace(panel, x_range=(0.0, longest), shaded=find_support(view, leg))


def _draw_quantity(view: RunView, name: str, leg: int) -> Panel:
    """Draw one of :data:`QUANTITIES` over the time of each cycle, of a leg or, if ``leg`` is 0, of the body."""
    path, line, title = QUANTITIES[name]
    plot = list_plots(view)[f"leg_{leg}/{path}" if leg else f"body/{path}"]
    desired = [(name, view.clock, values) for name, values, rgb in plot.lines if rgb == palette.DESIRED]
    values_by_line = {name: values for name, values, _ in plot.lines}
    values = values_by_line.get(line, plot.lines[0].values)  # a run of an earlier version has only one margin
    panel = Panel(
        name_leg(view, leg) or title,
        CLOCK,
        f"{title.partition(',')[0]}, {plot.unit}",
        _list_lines(view, view.clock, values, *desired),
        from_zero=name not in ("height", "pitch", "roll"),
    )
    return _over_clock(view, panel, leg)


def draw_over_cycle(view: RunView, name: str, legs: Sequence[int]) -> list[Panel]:
    """Draw a quantity over the time of each cycle, a panel per leg.

    ``name`` is :data:`FOOT` or one of :data:`QUANTITIES`; ``legs`` are numbers from 1, or ``[0]`` for the body.
    """
    return [_draw_path(view, leg) if name == FOOT else _draw_quantity(view, name, leg) for leg in legs]


def _draw_quantities(
    view: RunView,
    file: str,
    names: Sequence[str],
    legs: Sequence[int],
    caption: str,
    height: float,
    share: str = "",
) -> Drawing:
    """Draw a figure of quantities over the selected cycles; a note on the shading is added to the ``caption``."""
    panels = [panel for name in names for panel in draw_over_cycle(view, name, legs)]
    return Drawing(file, draw(panels, height=height, share=share), caption + _describe_shade(panels))


def _describe_shade(panels: Sequence[Panel]) -> str:
    return " The planned support is shaded." * any(panel.shaded for panel in panels)


def draw_tracking(view: RunView) -> list[Drawing]:
    """Draw foot path, force and errors over the selected cycles: one figure for one leg, else one per quantity."""
    legs = range(1, view.trace.legs + 1)
    moves = any(np.ptp(view.trace[name]) > 1e-6 for name in ("x", "x_desired"))  # else a foot only presses
    names = [FOOT, "force", *view.trace.axes] if moves else ["force", "y"]
    if view.trace.legs == 1:
        return [_draw_quantities(view, "tracking", names, legs, "Force and errors over the chosen cycles.", 2.7)]
    files = {name: f"error_{name}" if name in view.trace.axes else name for name in names}
    return [
        _draw_quantities(view, file, [name], legs, CAPTIONS[name], 2.0 if name == FOOT else 2.4, "xy")
        for name, file in files.items()
    ]


def draw_body(view: RunView) -> Drawing:
    """Draw height, pitch, roll and true stability margin of the body over the selected cycles."""
    caption = "The body over the chosen cycles; its margin is among the feet that carry load, tilt included."
    return _draw_quantities(view, "body", BODY_QUANTITIES, [0], caption, 2.3, "x")


def _draw_plot(plot: Plot, axis: str, x: Array, kept: Mask | slice) -> Panel:
    """Draw a plot of the recording over ``x``, (steps,), labelled ``axis``, in the steps that ``kept`` selects."""
    styles = [
        {"color": colour(line.colour), "linestyle": dash} for line, dash in zip(plot.lines, DASHES, strict=False)
    ]
    series = [
        Series(name, x[kept], values[kept], style=DESIRED_LINE if rgb == palette.DESIRED else style)
        for (name, values, rgb), style in zip(plot.lines, styles, strict=True)
    ]
    return Panel(plot.title, axis, plot.unit, series, from_zero=plot.leg > 0)


def draw_torques(view: RunView) -> Drawing:
    """Draw feedback and feedforward of all joints in the last selected cycle.

    For a robot J^T F_d is separate from the feedback, as in the metrics.
    """
    cycle = view.cycles[-1]
    plots = [plot for path, plot in list_plots(view).items() if "torque" in path]
    drawn = [_draw_plot(plot, CLOCK, view.clock, view.cycle == cycle) for plot in plots]
    panels = [_over_clock(view, panel, plot.leg) for panel, plot in zip(drawn, plots, strict=True)]
    also = " and the torque of the desired force, which the plan knows," if view.robot else ""
    caption = f"Feedback and feedforward{also} in cycle {cycle}; the plant receives their sum."
    figure = draw(panels, len(view.trace.axes), 2.6 if view.trace.legs == 1 else 2.0, share="x")
    return Drawing("torques", figure, caption + _describe_shade(panels))


def _draw_speeds(view: RunView) -> Panel:
    """Draw the velocities of all joints in the last steps, rad/s, or those of a point mass, m/s."""
    axes = view.trace.axes
    names = [f"dq{joint}" for joint in range(1, len(axes) + 1)] if view.has_joints else [f"v{axis}" for axis in axes]
    series = [
        Series(f"leg {leg + 1} {name}", view.time[LAST], view.trace[name][LAST, leg])
        for leg in range(view.trace.legs)
        for name in names
    ]
    return Panel("speed", "time, s", "rad/s" if view.has_joints else "m/s", series)


def draw_end(view: RunView) -> Drawing:
    """Draw the last steps of a run that stopped: contact forces, and the body if it fell, else the velocities."""
    fell = view.trace.body is not None and view.run.status == Status.FELL
    patterns = ("/force", "body/") if fell else ("/force",)
    plots = [plot for path, plot in list_plots(view).items() if any(pattern in path for pattern in patterns)]
    panels = [_draw_plot(plot, "time, s", view.time, LAST) for plot in plots]
    steps = min(LAST_STEPS, view.trace.steps)
    figure = draw([*panels, *([] if fell else [_draw_speeds(view)])])
    return Drawing("end", figure, f"The last {steps} recorded steps before the run stopped.")
