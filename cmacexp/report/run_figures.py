"""Figures of one run: its metrics cycle by cycle, some of its cycles over their time, and its last steps."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.run import Run
from cmacexp.data.tables import as_array
from cmacexp.data.trace import LAST_STEPS
from cmacexp.metrics.registry import count_legs, pool_legs, select_main
from cmacexp.recording.run_view import RunView
from cmacexp.report.curves import over_cycles
from cmacexp.report.figures import DESIRED_LINE, Panel, Series, draw
from cmacexp.report.page import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, mark
from cmacexp.typing import Array, Mask, Status

JOINTS = {2: ("joint 1, hip", "joint 2, knee"), 3: ("hip", "thigh", "knee")}
"""Names of joints, by their number."""
CLOCK = "time in the cycle, s"
TORQUES = {
    "for the desired force": DESIRED_LINE,
    "feedback": {"color": FEEDBACK, "linestyle": "-"},
    "feedforward": {"color": FEEDFORWARD, "linestyle": "--"},
}
"""Styles of the parts of a torque."""
Rows = dict[str, Array]
"""Signals of one leg or of the body by name, (steps,) each."""
DIGITS = 3
"""Decimals to which plans of two cycles are compared, in the unit that is drawn."""


def draw_metrics(run: Run) -> Drawing:
    """The main metrics per cycle, pooled over the legs and, of several, of each."""
    pooled, count, table = pool_legs(run.scores), count_legs(run.scores), run.scores.legs
    panels = []
    for name in select_main(pooled, count):
        lines = {"all legs": [pooled[name]]}
        if count > 1 and name in table.column_names:
            lines |= {LEG_NAMES[leg]: [as_array(table, name)[leg::count]] for leg in range(count)}
        panels.append(over_cycles(name, lines))
    return Drawing("metrics", draw(panels, height=2.1), "Metrics of each cycle.")


def select(view: RunView, leg: int, kept: Mask | slice) -> Rows:
    """Some steps of the signals of one leg; of the body if ``leg`` is 0."""
    trace = view.trace
    rows = {name: trace[name][:, leg - 1] for name in trace.names if name != "phase"} if leg else view.body
    return {name: column[kept] for name, column in rows.items()}


def measure_time(view: RunView, rows: Rows) -> Array:
    """Time since the cycle began, s."""
    return rows["time"] - (rows["cycle"] - 1) * view.run.config["gait"]["cycle_time"]


def measure_duration(view: RunView) -> float:
    """Duration of the longest of the cycles, s; less than a cycle if the run stopped in its first."""
    return float(measure_time(view, select(view, 1, slice(None))).max()) + view.run.config["sampling_period"]


def find_support(view: RunView, leg: int) -> list[tuple[float, float]]:
    """Begin and end of each planned support in the first cycle, s; none if all is support, or of the body."""
    if not leg:
        return []
    support = view.trace.support[view.cycle == view.cycles[0], leg - 1]
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    time = measure_time(view, select(view, leg, view.cycle == view.cycles[0]))
    clock = np.append(time, view.run.config["gait"]["cycle_time"])
    return [] if support.all() else list(zip(clock[edges[::2]], clock[edges[1::2]], strict=True))


def name_leg(view: RunView, leg: int) -> str:
    """E.g. ``leg 1, left front``; empty of the only leg, and of the body."""
    return f"leg {leg}, {view.names[leg - 1]}" if leg and view.walks else ""


class Quantity(NamedTuple):
    """What is drawn over time, and what is desired of it."""

    title: str
    y: str
    """Name and unit of the axis."""
    compute: Callable[[Rows], Array]
    desired: Callable[[Rows], Array] | None = None
    """None: nothing is desired that could be drawn beside it."""
    caption: str = ""
    from_zero: bool = True


def _scale(name: str, factor: float = 1e3) -> Callable[[Rows], Array]:
    """A signal in the unit that is drawn: in mm or mrad, unless another factor is given."""
    return lambda rows: factor * rows[name]


def _make_error(axis: str, direction: str) -> Quantity:
    """The error of a foot along an axis."""
    title, caption = f"error along {axis}", f"Error of the foot along {axis}, {direction}."
    compute = lambda rows: 1e3 * (rows[axis] - rows[f"{axis}_desired"])  # noqa: E731
    return Quantity(title, f"{axis} - desired, mm", compute, caption=caption)


FOOT, MARGIN = "foot", "stability_margin"
PATHS = "Paths of the feet in the frames of their hips, y down."
QUANTITIES = {
    FOOT: Quantity("foot path", "y down, mm", _scale("y"), _scale("y_desired"), PATHS),
    "force": Quantity("contact force", "force, N", _scale("force", 1), _scale("force_desired", 1), "Contact force."),
    "x": _make_error("x", "forward"),
    "y": _make_error("y", "down; in support relative to the depression at the desired force"),
    "z": _make_error("z", "to the left"),
    "height": Quantity("height of the body", "height, mm", _scale("height"), from_zero=False),
    MARGIN: Quantity(
        "stability margin, nearest edge",
        "margin, mm",
        lambda rows: 1e3 * rows.get(f"true_{MARGIN}", rows[MARGIN]),  # a run of an earlier version has only one
        _scale(MARGIN),
    ),
    "pitch": Quantity("pitch, nose down", "pitch, mrad", _scale("pitch"), from_zero=False),
    "roll": Quantity("roll, right side down", "roll, mrad", _scale("roll"), from_zero=False),
}
"""By column; of x, y and z the errors."""
BODY_QUANTITIES = ("height", MARGIN, "pitch", "roll")


def draw_desired(name: str, rows: Rows, clock: Array) -> list[Series]:
    """The desired path or force, or the planned margin, as a line; of other quantities none."""
    if (desired := QUANTITIES[name].desired) is None:
        return []
    x = 1e3 * rows["x_desired"] if name == FOOT else clock
    return [Series("planned" if name == MARGIN else "desired", x, desired(rows), style=DESIRED_LINE)]


def _style(view: RunView, cycle: int) -> dict[str, Any]:
    """The style of the lines of a cycle; those of the last are the strongest."""
    if cycle == view.cycles[-1]:
        return {**mark(0), "linewidth": 2.0, "zorder": 2.5}
    return {**mark(view.cycles.index(cycle) + 1), "linewidth": 1.1}


def _list_plans(view: RunView, name: str, leg: int) -> list[Series]:
    """What is desired in the cycles, as grey lines; a single one where it is the same in all of them.

    The plan of a robot follows the load of its feet and its course from cycle to cycle.
    """
    lines = {}
    for cycle in view.cycles:
        rows = select(view, leg, view.cycle == cycle)
        for line in draw_desired(name, rows, measure_time(view, rows)):
            lines[np.round([line.x, line.y], DIGITS).tobytes()] = line
    return list(lines.values())


def draw_over_cycle(view: RunView, name: str, legs: Sequence[int]) -> list[Panel]:
    """A quantity of legs, or of the body if they are ``[0]``, over the time of each cycle, a panel for each leg."""
    panels, quantity = [], QUANTITIES[name]
    for leg in legs:
        lines = _list_plans(view, name, leg)
        for cycle in view.cycles:
            rows = select(view, leg, view.cycle == cycle)
            x = 1e3 * rows["x"] if name == FOOT else measure_time(view, rows)
            lines.append(Series(f"cycle {cycle}", x, quantity.compute(rows), style=_style(view, cycle)))
        panel = Panel(name_leg(view, leg) or quantity.title, CLOCK, quantity.y, lines, from_zero=quantity.from_zero)
        if name == FOOT:
            panels.append(replace(panel, x="x forward, mm", equal=True, y_down=True))
        else:
            panels.append(replace(panel, x_range=(0.0, measure_duration(view)), shaded=find_support(view, leg)))
    return panels


def _draw_quantities(
    view: RunView,
    file: str,
    names: Sequence[str],
    legs: Sequence[int],
    caption: str,
    height: float,
    share: str = "",
) -> Drawing:
    """A figure of some quantities over the chosen cycles; ``caption`` is followed by how to read it."""
    panels = [panel for name in names for panel in draw_over_cycle(view, name, legs)]
    return Drawing(file, draw(panels, height=height, share=share), caption + _describe_shade(panels))


def _describe_shade(panels: Sequence[Panel]) -> str:
    return " The planned support is shaded." * any(panel.shaded for panel in panels)


def draw_tracking(view: RunView) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    legs = range(1, view.trace.legs + 1)
    moves = any(np.ptp(view.trace[name]) > 1e-6 for name in ("x", "x_desired"))  # else a foot only presses
    names = [FOOT, "force", *view.trace.axes] if moves else ["force", "y"]
    if view.trace.legs == 1:
        return [_draw_quantities(view, "tracking", names, legs, "Force and errors over the chosen cycles.", 2.7)]
    files = {name: f"error_{name}" if name in view.trace.axes else name for name in names}
    return [
        _draw_quantities(view, file, [name], legs, QUANTITIES[name].caption, 2.0 if name == FOOT else 2.4, "xy")
        for name, file in files.items()
    ]


def draw_body(view: RunView) -> Drawing:
    """Height, pitch, roll and true stability margin of the body over the chosen cycles."""
    caption = "The body over the chosen cycles; its margin is among the feet that carry load, tilt included."
    return _draw_quantities(view, "body", BODY_QUANTITIES, [0], caption, 2.3, "x")


def draw_torques(view: RunView) -> Drawing:
    """Feedback and feedforward of all joints in the last chosen cycle; of a robot J^T F_d apart, as in metrics."""
    cycle, count = view.cycles[-1], len(view.trace.axes)
    names = JOINTS[count] if view.has_joints else ("along x", "along y")
    unit = "torque, N m" if view.has_joints else "force, N"
    learns = any(view.trace[f"tau_feedforward_{joint + 1}"].any() for joint in range(count))
    panels = []
    for leg in range(1, view.trace.legs + 1):
        time = measure_time(view, select(view, leg, view.cycle == cycle))  # titles beside each other are narrow:
        leg_name = f"{leg} {LEG_NAMES[leg - 1]}" if view.robot else name_leg(view, leg)
        for joint, name in enumerate(names, 1):
            parts = {key: own[view.cycle == cycle, leg - 1] for key, own in view.torques(joint).items()}
            shown = {key: own for key, own in parts.items() if learns or key != "feedforward"}
            lines = [Series(key, time, own, style=TORQUES[key]) for key, own in shown.items()]
            title, shaded = f"{leg_name}: {name}" if leg_name else name, find_support(view, leg)
            panels.append(Panel(title, CLOCK, unit, lines, x_range=(0.0, measure_duration(view)), shaded=shaded))
    torques = "Feedback and feedforward" if learns else "Feedback"
    also = " and the torque of the desired force, which the plan knows," if view.robot else ""
    caption = f"{torques}{also} in cycle {cycle}; the plant receives their sum.{_describe_shade(panels)}"
    figure = draw(panels, count, 2.6 if view.trace.legs == 1 else 2.0, share="x")
    return Drawing("torques", figure, caption)


def draw_end(view: RunView) -> Drawing:
    """The last steps of a run that fell or diverged."""
    joints = {f"dq{joint}": f"joint {joint}" for joint in range(1, len(view.trace.axes) + 1)}
    columns = joints if view.has_joints else {"vx": "along x", "vy": "along y"}
    speeds, forces = [], []
    for leg in range(1, view.trace.legs + 1):
        rows = select(view, leg, slice(-LAST_STEPS, None))
        whose = f"leg {leg} " if view.trace.legs > 1 else ""
        speeds += [Series(whose + name, rows["time"], rows[column]) for column, name in columns.items()]
        forces.append(Series(whose or "force", rows["time"], rows["force"]))
    panels = [Panel("contact force", "time, s", "force, N", forces)]
    if view.trace.body is not None and view.run.status == Status.FELL:
        rows = select(view, 0, slice(-LAST_STEPS, None))
        for name in BODY_QUANTITIES:
            quantity, time = QUANTITIES[name], rows["time"]
            lines = [*draw_desired(name, rows, time), Series("true", time, quantity.compute(rows))]
            panels.append(Panel(quantity.title, "time, s", quantity.y, lines, from_zero=quantity.from_zero))
    else:
        panels.append(Panel("speed", "time, s", "joint speed, rad/s" if view.has_joints else "speed, m/s", speeds))
    steps = min(LAST_STEPS, view.trace.steps)
    return Drawing("end", draw(panels), f"The last {steps} recorded steps before the run stopped.")
