"""Figures of one run: its metrics cycle by cycle, some of its cycles over their time, and its last steps."""

from collections.abc import Sequence
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


def read(view: RunView, name: str, leg: int) -> Array:
    """A signal of one leg, or of the body if ``leg`` is 0, (steps,)."""
    if leg:
        return view.trace[name][:, leg - 1]
    return view.body.get(name, view.body[name.removeprefix(TRUE)])  # a run of an earlier version has only one margin


def measure_duration(view: RunView) -> float:
    """Duration of the longest of the cycles, s; less than a cycle if the run stopped in its first."""
    return float(view.clock.max()) + float(view.run.config["sampling_period"])


def find_support(view: RunView, leg: int) -> list[tuple[float, float]]:
    """Begin and end of each planned support in the first cycle, s; none if all is support, or of the body."""
    if not leg:
        return []
    first = view.cycle == view.cycles[0]
    support = view.trace.support[first, leg - 1]
    edges = np.flatnonzero(np.diff(support.astype(int), prepend=0, append=0))
    clock = np.append(view.clock[first], view.run.config["gait"]["cycle_time"])
    return [] if support.all() else list(zip(clock[edges[::2]], clock[edges[1::2]], strict=True))


def name_leg(view: RunView, leg: int) -> str:
    """E.g. ``leg 1, left front``; empty of the only leg, and of the body."""
    return f"leg {leg}, {view.names[leg - 1]}" if leg and view.walks else ""


class Quantity(NamedTuple):
    """What is drawn over time, and what is desired of it."""

    title: str
    y: str
    """Name and unit of the axis."""
    signal: str
    desired: str = ""
    """The signal that is drawn beside it; empty: none."""
    relative_to: str = ""
    """The signal that is subtracted; empty: none."""
    caption: str = ""
    factor: float = 1e3
    """To the unit of the axis: mm or mrad."""
    from_zero: bool = True

    def compute(self, view: RunView, leg: int) -> Array:
        """Its values in the unit of the axis, (steps,)."""
        values = read(view, self.signal, leg)
        return self.factor * (values - read(view, self.relative_to, leg) if self.relative_to else values)


FOOT, MARGIN, TRUE = "foot", "stability_margin", "true_"
PATHS = "Paths of the feet in the frames of their hips, y down."
DOWN = "y, down; in support relative to the depression at the desired force"
QUANTITIES = {
    FOOT: Quantity("foot path", "y down, mm", "y", "y_desired", caption=PATHS),
    "force": Quantity("contact force", "force, N", "force", "force_desired", "", "Contact force.", 1.0),
    **{
        axis: Quantity(
            f"error along {axis}",
            f"{axis} - desired, mm",
            axis,
            relative_to=f"{axis}_desired",
            caption=f"Error of the foot along {direction}.",
        )
        for axis, direction in {"x": "x, forward", "y": DOWN, "z": "z, to the left"}.items()
    },
    "height": Quantity("height of the body", "height, mm", "height", from_zero=False),
    MARGIN: Quantity("stability margin, nearest edge", "margin, mm", TRUE + MARGIN, MARGIN),
    "pitch": Quantity("pitch, nose down", "pitch, mrad", "pitch", from_zero=False),
    "roll": Quantity("roll, right side down", "roll, mrad", "roll", from_zero=False),
}
"""By what is drawn; of x, y and z the errors."""
BODY_QUANTITIES = ("height", MARGIN, "pitch", "roll")


def list_desired(view: RunView, name: str, leg: int, x: Array, kept: Mask | slice) -> list[Series]:
    """What is desired or planned of a quantity in some steps, over ``x``, as a line; none of some quantities."""
    quantity = QUANTITIES[name]
    if not quantity.desired:
        return []
    values = quantity.factor * read(view, quantity.desired, leg)
    return [Series("planned" if name == MARGIN else "desired", x[kept], values[kept], style=DESIRED_LINE)]


def _style(view: RunView, cycle: int) -> dict[str, Any]:
    """The style of the lines of a cycle; those of the last are the strongest."""
    if cycle == view.cycles[-1]:
        return {**mark(0), "linewidth": 2.0, "zorder": 2.5}
    return {**mark(view.cycles.index(cycle) + 1), "linewidth": 1.1}


def _list_lines(view: RunView, name: str, leg: int) -> list[Series]:
    """What is desired, as grey lines, a single one where it is the same in all cycles, and a line for each cycle.

    The plan of a robot follows the load of its feet and its course from cycle to cycle.
    """
    is_path, values = name == FOOT, QUANTITIES[name].compute(view, leg)
    x = 1e3 * read(view, "x", leg) if is_path else view.clock
    x_desired = 1e3 * read(view, "x_desired", leg) if is_path else view.clock
    plans, lines = {}, []
    for cycle in view.cycles:
        kept = view.cycle == cycle
        for line in list_desired(view, name, leg, x_desired, kept):
            plans[np.round([line.x, line.y], DIGITS).tobytes()] = line
        lines.append(Series(f"cycle {cycle}", x[kept], values[kept], style=_style(view, cycle)))
    return [*plans.values(), *lines]


def draw_over_cycle(view: RunView, name: str, legs: Sequence[int]) -> list[Panel]:
    """A quantity of legs, or of the body if they are ``[0]``, over the time of each cycle, a panel for each leg."""
    panels, quantity = [], QUANTITIES[name]
    for leg in legs:
        title, lines = name_leg(view, leg) or quantity.title, _list_lines(view, name, leg)
        panel = Panel(title, CLOCK, quantity.y, lines, from_zero=quantity.from_zero)
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
    last = view.cycle == cycle
    names = JOINTS[count] if view.has_joints else ("along x", "along y")
    unit = "torque, N m" if view.has_joints else "force, N"
    panels = []
    for leg in range(1, view.trace.legs + 1):
        # Titles of three panels beside each other are narrow.
        leg_name = f"{leg} {LEG_NAMES[leg - 1]}" if view.robot else name_leg(view, leg)
        for joint, name in enumerate(names, 1):
            parts = {key: own[last, leg - 1] for key, own in view.torques(joint).items()}
            lines = [Series(key, view.clock[last], own, style=TORQUES[key]) for key, own in parts.items()]
            title, shaded = f"{leg_name}: {name}" if leg_name else name, find_support(view, leg)
            panels.append(Panel(title, CLOCK, unit, lines, x_range=(0.0, measure_duration(view)), shaded=shaded))
    also = " and the torque of the desired force, which the plan knows," if view.robot else ""
    caption = f"Feedback and feedforward{also} in cycle {cycle}; the plant receives their sum."
    figure = draw(panels, count, 2.6 if view.trace.legs == 1 else 2.0, share="x")
    return Drawing("torques", figure, caption + _describe_shade(panels))


def draw_end(view: RunView) -> Drawing:
    """The last steps of a run that fell or diverged."""
    joints = {f"dq{joint}": f"joint {joint}" for joint in range(1, len(view.trace.axes) + 1)}
    columns = joints if view.has_joints else {"vx": "along x", "vy": "along y"}
    last, speeds, forces = slice(-LAST_STEPS, None), [], []
    time = view.time[last]
    for leg in range(1, view.trace.legs + 1):
        whose = f"leg {leg} " if view.trace.legs > 1 else ""
        speeds += [Series(whose + name, time, read(view, column, leg)[last]) for column, name in columns.items()]
        forces.append(Series(whose or "force", time, read(view, "force", leg)[last]))
    panels = [Panel("contact force", "time, s", "force, N", forces)]
    if view.trace.body is not None and view.run.status == Status.FELL:
        for name in BODY_QUANTITIES:
            quantity = QUANTITIES[name]
            lines = list_desired(view, name, 0, view.time, last)
            lines.append(Series("true", time, quantity.compute(view, 0)[last]))
            panels.append(Panel(quantity.title, "time, s", quantity.y, lines, from_zero=quantity.from_zero))
    else:
        panels.append(Panel("speed", "time, s", "joint speed, rad/s" if view.has_joints else "speed, m/s", speeds))
    steps = min(LAST_STEPS, view.trace.steps)
    return Drawing("end", draw(panels), f"The last {steps} recorded steps before the run stopped.")
