"""Figures of one run: its metrics cycle by cycle, some of its cycles over their time, and its last steps."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.parquet import as_array
from cmacexp.data.run import Run
from cmacexp.data.trace import LAST_STEPS
from cmacexp.metrics.pooling import count_legs, pool_legs, select_main
from cmacexp.metrics.text import format_number
from cmacexp.report.captions import describe_change, join
from cmacexp.report.curves import over_cycles
from cmacexp.report.cycle_data import CycleData, Rows, keep_rows
from cmacexp.report.figures import DESIRED_LINE, Panel, Series, draw
from cmacexp.report.page_elements import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, mark, pale
from cmacexp.typing import Array

JOINTS = {2: ("joint 1, hip", "joint 2, knee"), 3: ("hip", "thigh", "knee")}
"""Names of joints, by their number."""
CLOCK = "time in the cycle, s"
VISIBLE = 0.005
"""Least difference of two lines that is visible, as part of their range: about half the width of what is desired."""


def draw_metrics(run: Run) -> Drawing:
    """The main metrics per cycle, pooled over the legs and, of several, of each."""
    pooled, count, table = pool_legs(run.scores), count_legs(run.scores), run.scores.legs
    main, panels = select_main(pooled, count), []
    for name in main:
        lines = {"all legs": [pooled[name]]}
        if count > 1 and name in table.column_names:
            lines |= {LEG_NAMES[leg]: [as_array(table, name)[leg::count]] for leg in range(count)}
        panels.append(over_cycles(name, lines))
    changes = describe_change({name: pooled[name] for name in main})
    return Drawing("metrics", draw(panels, height=2.1), f"Metrics of each cycle.{changes}")


class Quantity(NamedTuple):
    """What is drawn over time."""

    title: str
    y: str
    """Name and unit of the axis."""
    caption: str = ""
    from_zero: bool = True


QUANTITIES = {
    "foot": Quantity("foot path", "y down, mm", "Paths of the feet in the frames of their hips, y down."),
    "force": Quantity("contact force", "force, N", "Contact force."),
    "x": Quantity("error along x", "x - desired, mm", "Error of the foot along x, forward."),
    "y": Quantity(
        "error along y",
        "y - desired, mm",
        "Error of the foot along y, down; in support relative to the depression at the desired force.",
    ),
    "z": Quantity("error along z", "z - desired, mm", "Error of the foot along z, to the left."),
    "height": Quantity("height of the body", "height, mm", from_zero=False),
    "stability_margin": Quantity("stability margin, nearest edge", "margin, mm"),
    "pitch": Quantity("pitch, nose down", "pitch, mrad", from_zero=False),
    "roll": Quantity("roll, right side down", "roll, mrad", from_zero=False),
}
"""By column; of x, y and z the errors."""
BODY_QUANTITIES = ("height", "stability_margin", "pitch", "roll")


def read_quantity(rows: Rows, name: str) -> Array:
    """Values of one of :data:`QUANTITIES`; the margin is the true one, but in a run of an earlier version."""
    if name in "xyz":
        return 1e3 * (rows[name] - rows[f"{name}_desired"])
    if name == "stability_margin" and f"true_{name}" in rows:
        name = f"true_{name}"
    return rows[name] if name == "force" else 1e3 * rows[name]


def read_desired(rows: Rows, clock: Array, name: str) -> list[Series]:
    """The desired path or force or the planned margin as a line; of other quantities none."""
    if name == "foot":
        return [Series("desired", 1e3 * rows["x_desired"], 1e3 * rows["y_desired"], style=DESIRED_LINE)]
    if name == "force":
        return [Series("desired", clock, rows["force_desired"], style=DESIRED_LINE)]
    return [Series("planned", clock, 1e3 * rows[name], style=DESIRED_LINE)] if name == "stability_margin" else []


def _style(data: CycleData, cycle: int) -> dict[str, Any]:
    """Of the lines of a cycle; those of the last are the strongest."""
    if cycle == data.cycles[-1]:
        return {**mark(0), "linewidth": 2.0, "zorder": 2.5}
    return {**mark(data.cycles.index(cycle) + 1), "linewidth": 1.1}


def _coincide(one: Series, other: Series) -> bool:
    """Whether lines are drawn on each other; those of a thinned trace, which has other steps, need not."""
    a, b = (np.nan_to_num(np.array([line.x, line.y])) for line in (one, other))
    return a.shape == b.shape and bool((np.abs(a - b) <= VISIBLE * np.ptp(b, axis=1, keepdims=True)).all())


def _draw_plans(data: CycleData, name: str, legs: Sequence[int]) -> list[Sequence[Series]]:
    """What is desired of each leg in the cycles that are shown.

    The plan of a robot follows the load of its feet and its course from cycle to cycle. Cycles whose plans coincide
    share a line, in the colour of the last of them; one line for all cycles is grey.
    """
    plans: dict[int, list[Series]] = {}
    shared: dict[int, list[int]] = {}
    for cycle in reversed(data.cycles):
        rows = [data.select(cycle, leg) for leg in legs]
        plans[cycle] = [line for own in rows for line in read_desired(own, data.time_in_cycle(own), name)]
        first = next((same for same in shared if all(map(_coincide, plans[cycle], plans[same]))), cycle)
        shared[first] = [cycle, *shared.get(first, [])]
    if len(shared) > 1:
        for cycle, cycles in shared.items():
            style = {**DESIRED_LINE, "color": pale(_style(data, cycle)["color"]), "alpha": 1.0}
            shown = f"{'cycle' if cycles == [cycle] else 'cycles'} {', '.join(map(str, cycles))}"
            plans[cycle] = [replace(line, name=f"{line.name}, {shown}", style=style) for line in plans[cycle]]
    return list(zip(*(plans[cycle] for cycle in reversed(shared)), strict=True)) or [()] * len(legs)


def over_cycle(data: CycleData, name: str, legs: Sequence[int]) -> list[Panel]:
    """A quantity of legs, or of the body if they are ``[0]``, over the time of each cycle, a panel for each leg."""
    panels, (title, y, _, from_zero) = [], QUANTITIES[name]
    for leg, plans in zip(legs, _draw_plans(data, name, legs), strict=True):
        lines = list(plans)
        for cycle in data.cycles:
            rows = data.select(cycle, leg)
            if name == "foot":
                clock, values = 1e3 * rows["x"], 1e3 * rows["y"]
            else:
                clock, values = data.time_in_cycle(rows), read_quantity(rows, name)
            lines.append(Series(f"cycle {cycle}", clock, values, style=_style(data, cycle)))
        panel = Panel(data.leg_name(leg) or title, CLOCK, y, lines, from_zero=from_zero)
        if name == "foot":
            panels.append(replace(panel, x="x forward, mm", equal=True, y_down=True))
        else:
            panels.append(replace(panel, x_range=(0.0, data.duration), shaded=data.support(leg)))
    return panels


def _describe_plans(panels: Sequence[Panel]) -> str:
    """How the lines of :func:`_draw_plans` are to be read; empty if all cycles share one."""
    changes = any(series.name.startswith(("desired,", "planned,")) for panel in panels for series in panel.series)
    return " The desired or planned lines are pale, each in the colour of the last of its cycles." * changes


def describe_peaks(data: CycleData, names: Iterable[str], legs: Sequence[int]) -> str:
    """The largest sizes of some of :data:`QUANTITIES` in the first and in the last cycle that is shown."""
    parts, cycles = [], dict.fromkeys((data.cycles[0], data.cycles[-1]))
    for name in names:
        sizes = [
            format_number(max(float(np.nanmax(np.abs(read_quantity(data.select(cycle, leg), name)))) for leg in legs))
            for cycle in cycles
        ]
        parts.append(f"{QUANTITIES[name].title} {' and '.join(sizes)} {QUANTITIES[name].y.rpartition(', ')[2]}")
    return f" Largest {' and '.join(f'in cycle {cycle}' for cycle in cycles)}:{join(parts)}"


def draw_tracking(data: CycleData) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    names = ["foot", "force", *data.trace.axes] if data.moves_along_x else ["force", "y"]
    panels = {name: over_cycle(data, name, data.legs) for name in names}
    if len(data.legs) == 1:
        every = [panel for (panel,) in panels.values()]
        figure = draw(every, height=2.7)
        peaks = describe_peaks(data, [name for name in names if name != "foot"], data.legs)
        caption = f"Force and errors over the chosen cycles.{peaks}{_describe_plans(every)}{_describe_shade(data)}"
        return [Drawing("tracking", figure, caption)]
    drawings = []
    for name in names:
        seen = "" if name == "foot" else describe_peaks(data, [name], data.legs) + _describe_shade(data)
        figure = draw(panels[name], height=2.0 if name == "foot" else 2.4, share="xy")
        file = f"error_{name}" if name in data.trace.axes else name
        drawings.append(Drawing(file, figure, QUANTITIES[name].caption + _describe_plans(panels[name]) + seen))
    return drawings


def draw_body(data: CycleData) -> Drawing:
    """Height, pitch, roll and true stability margin of the body over the chosen cycles."""
    caption = "The body over the chosen cycles; its margin is among the feet that carry load, tilt included."
    panels = [panel for name in BODY_QUANTITIES for panel in over_cycle(data, name, [0])]
    caption += _describe_plans(panels) + describe_peaks(data, ("pitch", "roll"), [0])
    return Drawing("body", draw(panels, height=2.3, share="x"), caption)


def _describe_shade(data: CycleData) -> str:
    return " The planned support is shaded." if data.support(1) else ""


def draw_torques(data: CycleData) -> Drawing:
    """Feedback and feedforward of all joints in the last chosen cycle; of a robot J^T F_d apart, as in metrics."""
    cycle, count = data.cycles[-1], len(data.trace.axes)
    names = JOINTS[count] if data.has_joints else ("along x", "along y")
    unit = "torque, N m" if data.has_joints else "force, N"
    learns = any(data.trace[f"tau_feedforward_{joint + 1}"].any() for joint in range(count))
    panels = []
    for leg in data.legs:
        rows = data.select(cycle, leg)
        time, leg_name = data.time_in_cycle(rows), data.leg_name(leg)
        if data.is_robot:  # three beside each other are narrow
            leg_name = f"{leg} {LEG_NAMES[leg - 1]}"
        for joint, name in enumerate(names, 1):
            feedback, lines = rows[f"tau_feedback_{joint}"], []
            if data.is_robot:
                known = rows[f"tau_force_{joint}"]
                feedback = feedback - known
                lines.append(Series("for the desired force", time, known, style=DESIRED_LINE))
            lines.append(Series("feedback", time, feedback, style={"color": FEEDBACK, "linestyle": "-"}))
            if learns:
                style = {"color": FEEDFORWARD, "linestyle": "--"}
                lines.append(Series("feedforward", time, rows[f"tau_feedforward_{joint}"], style=style))
            panel = Panel(f"{leg_name}: {name}" if leg_name else name, CLOCK, unit, lines, shaded=data.support(leg))
            panels.append(replace(panel, x_range=(0.0, data.duration)))
    torques = "Feedback and feedforward" if learns else "Feedback"
    also = " and the torque of the desired force, which the plan knows," if data.is_robot else ""
    caption = f"{torques}{also} in cycle {cycle}; the plant receives their sum.{_describe_shade(data)}"
    figure = draw(panels, count, 2.6 if len(data.legs) == 1 else 2.0, share="x")
    return Drawing("torques", figure, caption)


def _end_of_body(rows: Rows, name: str) -> Panel:
    title, y, _, from_zero = QUANTITIES[name]
    lines = [*read_desired(rows, rows["time"], name), Series("true", rows["time"], read_quantity(rows, name))]
    return Panel(title, "time, s", y, lines, from_zero=from_zero)


def draw_end(data: CycleData, status: str) -> Drawing:
    """The last steps of a run that fell or diverged."""
    columns = {f"dq{joint}": f"joint {joint}" for joint in range(1, len(data.trace.axes) + 1)}
    if not data.has_joints:
        columns = {"vx": "along x", "vy": "along y"}
    speeds, forces = [], []
    for leg in data.legs:
        rows = keep_rows(data.rows(leg), slice(-LAST_STEPS, None))
        whose = f"leg {leg} " if len(data.legs) > 1 else ""
        speeds += [Series(whose + name, rows["time"], rows[column]) for column, name in columns.items()]
        forces.append(Series(whose or "force", rows["time"], rows["force"]))
    panels = [Panel("contact force", "time, s", "force, N", forces)]
    if data.trace.body is not None and status == "fell":
        panels += [_end_of_body(keep_rows(data.rows(0), slice(-LAST_STEPS, None)), name) for name in BODY_QUANTITIES]
    else:
        panels.append(Panel("speed", "time, s", "joint speed, rad/s" if data.has_joints else "speed, m/s", speeds))
    steps = min(LAST_STEPS, data.trace.steps)
    return Drawing("end", draw(panels), f"The last {steps} recorded steps before the run stopped.")
