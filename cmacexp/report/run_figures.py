"""Figures of one run: its metrics cycle by cycle, some of its cycles over their time, and its last steps."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.pooling import count_legs, describe_pooling, is_shown, pool_legs
from cmacexp.metrics.registry import SHOWN
from cmacexp.report.curves import find_log, over_cycles
from cmacexp.report.cycle_data import CycleData
from cmacexp.report.figures import DESIRED_LINE, Panel, Series, draw
from cmacexp.report.parts import Drawing
from cmacexp.report.style import FEEDBACK, FEEDFORWARD, mark
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

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
JOINTS = {2: ("joint 1, hip", "joint 2, knee"), 3: ("hip", "thigh", "knee")}
"""Names of joints, by their number."""
CLOCK = "time in the cycle, s"
LAST_STEPS = 100
"""Steps shown before a run stopped."""


def draw_metrics(run: StoredRun, torque_unit: str) -> Drawing:
    """The main metrics per cycle, pooled over the legs."""
    pooled = pool_legs(run.scores)
    values = {
        name: SHOWN[name].factor * own
        for name, own in pooled.items()
        if name in SHOWN and is_shown(name, pooled, count_legs(run.scores)) and np.isfinite(own).any() and own.any()
    }
    panels, drawn = [], []
    for title, (axis, names) in PANELS.items():
        if not (known := [name for name in names if name in values]):
            continue
        cycles = np.arange(1, len(values[known[0]]) + 1)
        series = [Series(SHOWN[name].title, cycles, values[name]) for name in known]
        shown = SHOWN[known[0]]
        unit = torque_unit if shown.unit == "N m" else shown.unit
        panels.append(
            Panel(title, "cycle", f"{axis}, {unit}", series, log=find_log(series), from_zero=shown.from_zero)
        )
        drawn += known
    pooling = f" Over the legs: {describe_pooling({name: name for name in drawn})}." if run.walks else ""
    return Drawing("metrics", draw(panels, legend="panel"), f"Metrics of each cycle.{pooling}")


def draw_legs(run: StoredRun) -> Drawing:
    """Errors and share of the feedforward of each leg, per cycle."""
    names = [name for name in KEY if name in run.metrics and is_shown(name, run.metrics, len(LEG_NAMES))]
    histories = {leg: run.metrics[run.metrics["leg"] == index] for index, leg in enumerate(LEG_NAMES, 1)}
    panels = [over_cycles(name, {leg: [np.asarray(own[name])] for leg, own in histories.items()}) for name in names]
    return Drawing("legs", draw(panels), "Errors of each leg and the share of its feedforward, cycle by cycle.")


def _by_cycle(data: CycleData, leg: int, value: "Callable[[pd.DataFrame], Any]") -> list[Series]:
    """A line for each cycle, the last the strongest; of the body if ``leg`` is 0."""
    lines, last = [], len(data.cycles) - 1
    for index, cycle in enumerate(data.cycles):
        rows = data.select(cycle, leg) if leg else data.select_body(cycle)
        style = (
            {**mark(0), "linewidth": 2.0, "zorder": 2.5} if index == last else {**mark(index + 1), "linewidth": 1.1}
        )
        lines.append(Series(f"cycle {cycle}", data.time_in_cycle(rows), np.asarray(value(rows)), style=style))
    return lines


def _foot(data: CycleData, leg: int) -> Panel:
    first = data.select(data.cycles[0], leg)
    desired = Series("desired", 1e3 * first["x_desired"], 1e3 * first["y_desired"], style=DESIRED_LINE)
    paths = [
        replace(line, x=1e3 * data.select(cycle, leg)["x"])
        for cycle, line in zip(data.cycles, _by_cycle(data, leg, lambda rows: 1e3 * rows["y"]), strict=True)
    ]
    title = data.leg_name(leg) or "foot path"
    return Panel(title, "x forward, mm", "y down, mm", [desired, *paths], equal=True, y_down=True)


def _over_time(data: CycleData, leg: int, title: str, y: str, series: Sequence[Series]) -> Panel:
    return Panel(title, CLOCK, y, series, x_range=(0.0, data.duration), shaded=data.support(leg))


def _force(data: CycleData, leg: int) -> Panel:
    first = data.select(data.cycles[0], leg)
    desired = Series("desired", data.time_in_cycle(first), first["force_desired"], style=DESIRED_LINE)
    lines = [desired, *_by_cycle(data, leg, lambda rows: rows["force"])]
    return _over_time(data, leg, data.leg_name(leg) or "contact force", "force, N", lines)


def _error(axis: str) -> Callable[[CycleData, int], Panel]:
    def panel(data: CycleData, leg: int) -> Panel:
        lines = _by_cycle(data, leg, lambda rows: data.error(rows, axis))
        return _over_time(data, leg, data.leg_name(leg) or f"error along {axis}", f"{axis} - desired, mm", lines)

    return panel


TRACKING: dict[str, tuple[Callable[[CycleData, int], Panel], str]] = {
    "foot": (_foot, "Paths of the feet in the frames of their hips, y down"),
    "force": (_force, "Contact force"),
    "error_x": (_error("x"), "Error of the foot along x, forward"),
    "error_y": (
        _error("y"),
        "Error of the foot along y, down; in support relative to the depression at the desired force",
    ),
    "error_z": (_error("z"), "Error of the foot along z, to the left"),
}


def _describe_shade(data: CycleData) -> str:
    return " The planned support is shaded." if data.support(1) else ""


def draw_tracking(data: CycleData) -> list[Drawing]:
    """Foot path, force and errors over the chosen cycles: one figure for one leg, else one for each."""
    names = (
        ["foot", "force", *(f"error_{axis}" for axis in data.axes)] if data.moves_along_x else ["force", "error_y"]
    )
    if data.legs == 1:
        figure = draw([TRACKING[name][0](data, 1) for name in names], height=2.7)
        return [Drawing("tracking", figure, f"Force and errors over the chosen cycles.{_describe_shade(data)}")]
    drawings = []
    for name in names:
        make_panel, caption = TRACKING[name]
        panels, height = [make_panel(data, leg) for leg in range(1, data.legs + 1)], 1.8 if name == "foot" else 2.3
        shade = "" if name == "foot" else _describe_shade(data)
        drawings.append(Drawing(name, draw(panels, height=height, share="xy"), f"{caption}.{shade}"))
    return drawings


def draw_torques(data: CycleData) -> Drawing:
    """Feedback and feedforward of all joints in the last chosen cycle; of a robot J^T F_d apart, as in metrics."""
    cycle, count = data.cycles[-1], len(data.axes)
    names = JOINTS[count] if data.has_joints else ("along x", "along y")
    unit = "torque, N m" if data.has_joints else "force, N"
    learns = bool(data.trace[[f"tau_feedforward_{joint + 1}" for joint in range(count)]].to_numpy().any())
    panels = []
    for leg in range(1, data.legs + 1):
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
            panels.append(_over_time(data, leg, f"{leg_name}: {name}" if leg_name else name, unit, lines))
    torques = "Feedback and feedforward" if learns else "Feedback"
    also = " and the torque of the desired force, which the plan knows," if data.is_robot else ""
    caption = f"{torques}{also} in cycle {cycle}; the plant receives their sum.{_describe_shade(data)}"
    figure = draw(panels, count, 2.6 if data.legs == 1 else 1.7, share="x")
    return Drawing("torques", figure, caption)


def _margins(rows: "pd.DataFrame") -> dict[str, Array]:
    """Stability margins of the body, mm; a run of an earlier version has the planned one alone."""
    names = {"planned": "stability_margin", "true": "true_stability_margin"}
    return {name: 1e3 * np.asarray(rows[column]) for name, column in names.items() if column in rows}


def draw_body(data: CycleData) -> Drawing:
    """Height, pitch, roll and true stability margin of the body over the chosen cycles."""
    columns = {
        "height": ("height of the body", "height, mm"),
        "margin": ("stability margin, nearest edge", "margin, mm"),
        "pitch": ("pitch, nose down", "pitch, mrad"),
        "roll": ("roll, right side down", "roll, mrad"),
    }
    first, panels = data.select_body(data.cycles[0]), []
    for name, (title, y) in columns.items():
        if name == "margin":
            lines = _by_cycle(data, 0, lambda rows: list(_margins(rows).values())[-1])
            lines.append(Series("planned", data.time_in_cycle(first), _margins(first)["planned"], style=DESIRED_LINE))
        else:
            lines = _by_cycle(data, 0, lambda rows, name=name: 1e3 * rows[name])  # type: ignore[misc]
        panels.append(Panel(title, CLOCK, y, lines, from_zero=name == "margin", x_range=(0.0, data.duration)))
    caption = "The body over the chosen cycles; its margin is among the feet that carry load, tilt included."
    return Drawing("body", draw(panels, height=2.3, share="x"), caption)


def _end_of_body(rows: "pd.DataFrame") -> list[Panel]:
    time = rows["time"]
    tilt = [Series(name, time, 1e3 * rows[name]) for name in ("pitch", "roll")]
    styles = {"planned": DESIRED_LINE, "true": {}}
    margins = [Series(name, time, values, style=styles[name]) for name, values in _margins(rows).items()]
    return [
        Panel("tilt of the body", "time, s", "angle, mrad", tilt),
        Panel(
            "height of the body", "time, s", "height, mm", [Series("", time, 1e3 * rows["height"])], from_zero=False
        ),
        Panel("stability margin, nearest edge", "time, s", "margin, mm", margins),
    ]


def draw_end(data: CycleData, status: str) -> Drawing:
    """The last steps of a run that fell or diverged."""
    columns = {f"dq{joint}": f"joint {joint}" for joint in range(1, len(data.axes) + 1)}
    if not data.has_joints:
        columns = {"vx": "along x", "vy": "along y"}
    speeds, forces = [], []
    for leg in range(1, data.legs + 1):
        rows = data.trace[data.trace["leg"] == leg].tail(LAST_STEPS)
        whose = f"leg {leg} " if data.legs > 1 else ""
        speeds += [Series(whose + name, rows["time"], rows[column]) for column, name in columns.items()]
        forces.append(Series(f"{whose}force", rows["time"], rows["force"]))
    speed = "joint speed, rad/s" if data.has_joints else "speed, m/s"
    panels = [Panel("contact force", "time, s", "force, N", forces)]
    if data.body is not None and status == "fell":
        panels += _end_of_body(data.body.tail(LAST_STEPS))
    else:
        panels.append(Panel("speed", "time, s", speed, speeds))
    steps = min(LAST_STEPS, len(data.trace) // data.legs)
    figure = draw(panels, height=2.4 if data.legs == 1 else 3.0, legend="panel")
    return Drawing("end", figure, f"The last {steps} recorded steps before the run stopped.")
