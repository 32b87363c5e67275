"""Figures 7 to 13 of Lin & Song 1997 from the trace of one leg, in the paper's count of data points."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.typing import Array
from pipelines.one_leg_learning_claims import CYCLES, FIFTH, FIRST
from pipelines.one_leg_learning_measures import differentiate, phases, touch_down

BAND = 0.05
"""Relative error of the force that is shaded: the paper's limit."""
BEFORE = 40
"""Data points of support before the first that Fig. 8 and 9 show, to make the jumps at lift-off visible."""
AROUND = (30, 90)
"""Data points before and after touch-down in detail."""
POINT, FORWARD, HEIGHT = "data point", "x forward, mm", "height, mm"


def number_points(rows: pd.DataFrame, cycle: int) -> NDArray[np.integer]:
    """The paper's numbers of the samples of one of its cycles."""
    return CYCLES.index(cycle) * len(rows) + np.arange(len(rows))


def _height(run: StoredRun, values: "pd.Series[float] | Array") -> Array:
    return 1e3 * (float(run.config["machine"]["hip_height"]) - np.asarray(values))


def get_reach(run: StoredRun) -> float:
    """Length of the stretched leg, m."""
    links = run.config["machine"]["leg"]
    return float(links["length_1"] + links["length_2"])


def _paths(run: StoredRun, cycle: int, desired: bool) -> tuple[Array, Array]:
    rows, end = run.cycle(cycle), "_desired" if desired else ""
    return 1e3 * rows[f"x{end}"].to_numpy(), _height(run, rows[f"y{end}"])


def glance(run: StoredRun) -> Figure:
    """Foot path and force in the paper's cycles, and torques in the last."""
    first, last = run.cycle(FIRST), run.cycle(FIFTH)
    since = first["time"].to_numpy() - first["time"].iloc[0]
    paths = [Series("desired", *_paths(run, FIRST, True))]
    forces = [Series("desired", since, first["force_desired"].to_numpy())]
    for cycle in CYCLES:
        paths.append(Series(f"cycle {cycle}", *_paths(run, cycle, False)))
        forces.append(Series(f"cycle {cycle}", since, run.cycle(cycle)["force"].to_numpy()))
    torques = [Series(f"from {who}", since, last[f"tau_{who}_1"].to_numpy()) for who in ("feedforward", "feedback")]
    panels = [
        Panel("foot", FORWARD, HEIGHT, paths, y_limits=[0.0]),
        Panel("contact force", "time in the cycle, s", "force, N", forces),
        Panel(f"torque of joint 1, cycle {FIFTH}", "time in the cycle, s", "torque, N m", torques),
    ]
    return draw(panels, columns=3, height=2.7)


def trajectory(run: StoredRun) -> Figure:
    """Fig. 7: desired path in transfer and reference positions in support, in the plane and over a cycle."""
    rows = run.cycle(FIRST)
    swing, stance = phases(rows)
    point, x = number_points(rows, FIRST), 1e3 * rows["x_desired"].to_numpy()
    desired, reference = (_height(run, rows[f"y_{name}"]) for name in ("desired", "reference"))
    lines = [("desired, transfer", swing, desired), ("desired, support", stance, desired)]
    lines.append(("reference D_r, support", stance, reference))
    across = np.linspace(x.min(), x.max(), 60)
    limit = Series("reach of the leg", across, _height(run, np.sqrt(get_reach(run) ** 2 - (across / 1e3) ** 2)))
    plane = [*(Series(name, x[part], height[part]) for name, part, height in lines), limit]
    time = [Series(name, point[part], height[part]) for name, part, height in lines]
    panels = [
        Panel("in the plane of the leg", FORWARD, HEIGHT, plane, y_limits=[0.0]),
        Panel("over a cycle", POINT, HEIGHT, time, x_limits=[point[stance.start]], y_limits=[0.0]),
    ]
    return draw(panels, height=3.0)


def _motion(run: StoredRun, order: int, name: str, unit: str) -> Figure:
    """A derivative of the desired path within each phase, from shortly before lift-off on."""
    rows = run.cycle(FIRST)
    point = np.arange(-BEFORE, len(rows))
    panels = []
    for axis, direction in (("x", "forward"), ("y", "down")):
        values = rows[f"{axis}_desired"].to_numpy()
        for _ in range(order):
            values = differentiate(rows, values)
        series = [Series("desired", point, values[point])]
        panels.append(Panel(f"{name} {direction}", POINT, unit, series, x_limits=[0.0, touch_down(rows)]))
    return draw(panels)


def velocities(run: StoredRun) -> Figure:
    """Fig. 8: desired velocities of the foot."""
    return _motion(run, 1, "velocity", "m/s")


def accelerations(run: StoredRun) -> Figure:
    """Fig. 9: desired accelerations of the foot."""
    return _motion(run, 2, "acceleration", "m/s²")


def tracking(run: StoredRun, cycle: int) -> Figure:
    """Fig. 10, 11: desired and actual foot position over the paper's data points, and as a path."""
    rows = run.cycle(cycle)
    point, landing = number_points(rows, cycle), touch_down(rows)
    both = {"desired": _paths(run, cycle, True), "actual": _paths(run, cycle, False)}
    panels = [
        Panel(
            "forward", POINT, FORWARD, [Series(n, point, x) for n, (x, _) in both.items()], x_limits=[point[landing]]
        ),
        Panel("up", POINT, HEIGHT, [Series(n, point, y) for n, (_, y) in both.items()], x_limits=[point[landing]]),
        Panel("path", FORWARD, HEIGHT, [Series(n, *xy) for n, xy in both.items()], y_limits=[0.0]),
    ]
    return draw(panels, columns=3)


def forces(run: StoredRun) -> Figure:
    """Fig. 12: desired and actual force in the paper's cycles, one after the other."""
    cycles = [run.cycle(cycle) for cycle in CYCLES]
    point = np.concatenate([number_points(rows, cycle) for rows, cycle in zip(cycles, CYCLES, strict=True)])
    desired, actual = (np.concatenate([rows[name] for rows in cycles]) for name in ("force_desired", "force"))
    series = [
        Series("desired", point, desired, (1.0 - BAND) * desired, (1.0 + BAND) * desired),
        Series("actual", point, actual),
    ]
    starts = [index * len(cycles[0]) for index in range(1, len(CYCLES))]
    title = "cycles " + ", ".join(map(str, CYCLES))
    return draw([Panel(title, POINT, "force, N", series, x_limits=starts)])


def torques(run: StoredRun) -> Figure:
    """Fig. 13: torque of joint 1 by who gives it, over the last of the paper's cycles and around touch-down."""
    rows = run.cycle(FIFTH)
    point, landing = number_points(rows, FIFTH), touch_down(rows)
    parts = {name: rows[f"tau_{name}_1"].to_numpy() for name in ("feedforward", "feedback")}
    parts = {"total": parts["feedforward"] + parts["feedback"], **parts}
    detail = slice(landing - AROUND[0], landing + AROUND[1])
    panels = [
        Panel(title, POINT, "torque, N m", [Series(n, point[part], v[part]) for n, v in parts.items()],
              x_limits=[point[landing]])
        for title, part in ((f"joint 1, cycle {FIFTH}", slice(None)), ("around touch-down", detail))
    ]  # fmt: skip
    return draw(panels)
