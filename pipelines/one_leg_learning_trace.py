"""What the study of one leg reads in the trace of a run: measures, and figures 7 to 13 of Lin & Song 1997."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cmacexp.data.run import Run
from cmacexp.models.leg import Leg, bias_torque, jacobian, trigonometry
from cmacexp.planning.reference import Gains, compute_support_reference
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.typing import Array

Config = Mapping[str, Any]
Measure = Callable[[pd.DataFrame, Config], float]
"""Of the rows of a cycle and the config of its run."""
FIRST, SECOND, FIFTH = CYCLES = (1, 2, 5)
"""Cycles that the paper shows."""
LANDED, FORCE_WINDOW = 0.2, 0.2
"""Time after touch-down from which a force is searched for oscillations, and width of the mean they leave, s."""
EVENT, TORQUE_WINDOW = 0.3, 0.1
"""Time from touch-down in which the torque changes abruptly, and width of the mean that oscillations leave, s."""
SWING_START = 0.1
"""Time after lift-off in which feedback is looked for, s."""
BEFORE = 40
"""Data points of support before the first that Fig. 8 and 9 show, to make the jumps at lift-off visible."""
BAND = 0.05
"""Relative error of the force that is shaded: the paper's limit."""
POINT, FORWARD, HEIGHT = "data point", "x forward, mm", "height, mm"


def rows_of(run: Run, cycle: int) -> pd.DataFrame:
    """Rows of a cycle; none if the run did not reach it."""
    return run.trace[run.trace["cycle"] == cycle]


def in_cycle(number: int, measure: Measure) -> Callable[[Run], float]:
    """The measure of a cycle's rows as one of a run; NaN for a run that recorded no such cycle."""

    return lambda run: measure(rows, run.config) if len(rows := rows_of(run, number)) else float("nan")


def in_last_recorded(measure: Measure) -> Callable[[Run], float]:
    """The measure of the last whole cycle in the trace as one of a run."""
    return lambda run: in_cycle(run.select_whole(run.trace["cycle"].unique().tolist())[-1], measure)(run)


def phases(rows: pd.DataFrame) -> list[slice]:
    """The samples of each phase in a cycle, in order."""
    support = (rows["phase"] == "support").to_numpy()
    edges = [0, *(np.flatnonzero(np.diff(support)) + 1), len(support)]
    return [slice(a, b) for a, b in pairwise(edges)]


def touch_down(rows: pd.DataFrame) -> int:
    """The first sample of support in a cycle."""
    return int(np.argmax((rows["phase"] == "support").to_numpy()))


def differentiate(rows: pd.DataFrame, values: Array) -> Array:
    """Differences of ``values`` over time, within each phase by itself, so that a jump between phases stays one."""
    time, result = rows["time"].to_numpy(), np.empty(len(rows))
    for part in phases(rows):
        result[part] = np.gradient(values[part], time[part], edge_order=2)
    return result


def peak_error(axis: str, extent: str) -> Measure:
    """Largest error of the foot in transfer, over the stroke or lift of the gait."""

    def measure(rows: pd.DataFrame, config: Config) -> float:
        swing = rows[rows["phase"] == "transfer"]
        return float((swing[axis] - swing[f"{axis}_desired"]).abs().max()) / float(config["gait"][extent])

    return measure


def force_peak(rows: pd.DataFrame, config: Config) -> float:
    """Largest force in support, N."""
    return float(rows["force"].to_numpy()[touch_down(rows) :].max())


def without_trend(values: Array, window: float, period: float) -> Array:
    """What samples differ by from their moving mean over ``window`` seconds."""
    half = round(window / period / 2.0)
    padded = np.pad(np.asarray(values), half, mode="edge")
    return values - np.convolve(padded, np.ones(2 * half + 1) / (2 * half + 1), "valid")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def force_oscillation(rows: pd.DataFrame, config: Config) -> float:
    """RMS of a cycle's force around its moving mean, from ``LANDED`` after touch-down on, N."""
    period = config["sampling_period"]
    force = rows["force"].to_numpy()[touch_down(rows) :]
    return _rms(without_trend(force, FORCE_WINDOW, period)[round(LANDED / period) :])


def torque_oscillation(rows: pd.DataFrame, config: Config) -> float:
    """RMS of joint 1's feedforward torque around its moving mean: after touch-down, over that in mid support."""
    period, landing = config["sampling_period"], touch_down(rows)
    left = without_trend(rows["tau_feedforward_1"].to_numpy(), TORQUE_WINDOW, period)
    quarter = (len(rows) - landing) // 4
    after, middle = left[landing : landing + round(EVENT / period)], left[landing + quarter : landing + 3 * quarter]
    return _rms(after) / _rms(middle)


def torque_step(rows: pd.DataFrame, config: Config) -> float:
    """Largest change of joint 1's torque from one sample to the next around touch-down, N m."""
    landing = touch_down(rows)
    torque = (rows["tau_feedback_1"] + rows["tau_feedforward_1"]).to_numpy()
    around = slice(landing - 1, landing + round(EVENT / config["sampling_period"]))
    return float(np.abs(np.diff(torque[around])).max())


def feedback_at_lift_off(rows: pd.DataFrame, config: Config) -> float:
    """Part of a cycle's squared feedback torque, both joints, in the first ``SWING_START`` seconds after lift-off."""
    squared = (rows["tau_feedback_1"] ** 2 + rows["tau_feedback_2"] ** 2).to_numpy()
    return float(squared[: round(SWING_START / config["sampling_period"])].sum() / squared.sum())


def _depression(config: Config, static_load: bool) -> float:
    """Depth of the reference below the ground per newton of desired force, m/N."""
    controller, force = config["controller"], config["force_control"]
    gains = Gains(
        **{name: controller[name] for name in ("position_gain", "velocity_gain")},
        **{name: force[name] for name in ("force_gain", "elasticity", "admittance")},
        stiffness=config["terrain"]["stiffness"],
    )
    return compute_support_reference("combined", gains, static_load).depression


def reference_depth(config: Config) -> float:
    """D_r of eq. 13, m."""
    return _depression(config, True) * float(config["force_control"]["desired_force"])


def learned_error(config: Config) -> float:
    """Relative force error where the feedback is zero: D_r / (1/K_n + P_fn + K_av/K_ap V_fn) / F_d - 1."""
    return _depression(config, True) / _depression(config, False) - 1.0


def weight_at_foot(rows: pd.DataFrame, config: Config) -> float:
    """What the weight of the leg presses the foot down with in the second half of support, N; mean over postures."""
    links = config["machine"]["leg"]
    sizes = {name: links[name] for name in ("length_1", "length_2", "mass_1", "mass_2")}
    leg = Leg(**sizes, knee=-1.0 if links["knee"] == "back" else 1.0)
    settled = rows[(rows["phase"] == "support") & (rows["progress"] >= 0.5)]
    pressing = []
    for q1, q2 in settled[["q1", "q2"]].iloc[::20].to_numpy():  # postures change little from sample to sample
        trig = trigonometry(q1, q2)
        j11, j12, j21, j22 = jacobian(leg, trig)
        lifting = np.linalg.solve([[j11, j21], [j12, j22]], bias_torque(leg, trig, 0.0, 0.0))
        pressing.append(-lifting[1])
    return float(np.mean(pressing))


def feedback_force(config: Config, weight: float) -> float:
    """Force at which feedback only and a weight at the foot balance the ground, N.

    K_ap (D_r - P_fn F - F/K_n) - K_av V_fn F + weight = F.
    """
    gain = float(config["controller"]["position_gain"])
    return (gain * reference_depth(config) + weight) / (1.0 + gain * _depression(config, False))


def _points(rows: pd.DataFrame, cycle: int) -> NDArray[np.integer]:
    """The paper's numbers of the samples of one of its cycles."""
    return CYCLES.index(cycle) * len(rows) + np.arange(len(rows))


def _height(run: Run, values: Any) -> Array:
    return 1e3 * (float(run.config["machine"]["hip_height"]) - np.asarray(values))


def _path(run: Run, cycle: int, end: str = "") -> tuple[Array, Array]:
    rows = rows_of(run, cycle)
    return 1e3 * rows[f"x{end}"].to_numpy(), _height(run, rows[f"y{end}"])


def trajectory(run: Run) -> Figure:
    """Fig. 7: desired path in transfer and reference positions in support, in the plane and over a cycle."""
    rows, links = rows_of(run, FIRST), run.config["machine"]["leg"]
    swing, stance = phases(rows)
    point, (x, desired) = _points(rows, FIRST), _path(run, FIRST, "_desired")
    reference = _height(run, rows["y_reference"])
    lines = [
        ("desired, transfer", swing, desired),
        ("desired, support", stance, desired),
        ("reference D_r, support", stance, reference),
    ]
    across = np.linspace(x.min(), x.max(), 60)
    reach = _height(run, np.sqrt((links["length_1"] + links["length_2"]) ** 2 - (across / 1e3) ** 2))
    plane = [Series(name, x[part], height[part]) for name, part, height in lines]
    time = [Series(name, point[part], height[part]) for name, part, height in lines]
    panels = [
        Panel("in the plane of the leg", FORWARD, HEIGHT, [*plane, Series("reach of the leg", across, reach)],
              y_limits=[0.0]),
        Panel("over a cycle", POINT, HEIGHT, time, x_limits=[point[stance.start]], y_limits=[0.0]),
    ]  # fmt: skip
    return draw(panels, height=3.0)


def motion(run: Run, order: int, name: str, unit: str) -> Figure:
    """Fig. 8, 9: a derivative of the desired path within each phase, from shortly before lift-off on."""
    rows = rows_of(run, FIRST)
    point = np.arange(-BEFORE, len(rows))
    panels = []
    for axis, direction in (("x", "forward"), ("y", "down")):
        values = rows[f"{axis}_desired"].to_numpy()
        for _ in range(order):
            values = differentiate(rows, values)
        series = [Series("desired", point, values[point])]
        panels.append(Panel(f"{name} {direction}", POINT, unit, series, x_limits=[0.0, touch_down(rows)]))
    return draw(panels)


def tracking(run: Run, cycle: int) -> Figure:
    """Fig. 10, 11: desired and actual foot position over the paper's data points, and as a path."""
    rows = rows_of(run, cycle)
    point, landing = _points(rows, cycle), touch_down(rows)
    both = {"desired": _path(run, cycle, "_desired"), "actual": _path(run, cycle)}
    panels = [
        Panel(
            title, POINT, name, [Series(n, point, path[axis]) for n, path in both.items()], x_limits=[point[landing]]
        )
        for axis, (title, name) in enumerate((("forward", FORWARD), ("up", HEIGHT)))
    ]
    panels.append(Panel("path", FORWARD, HEIGHT, [Series(n, *path) for n, path in both.items()], y_limits=[0.0]))
    return draw(panels, columns=3)


def forces(run: Run) -> Figure:
    """Fig. 12: desired and actual force in the paper's cycles, one after the other."""
    rows = pd.concat([rows_of(run, cycle) for cycle in CYCLES])
    desired, actual = rows["force_desired"].to_numpy(), rows["force"].to_numpy()
    point, count = np.arange(len(rows)), len(rows) // len(CYCLES)
    series = [
        Series("desired", point, desired, (1.0 - BAND) * desired, (1.0 + BAND) * desired),
        Series("actual", point, actual),
    ]
    title = "cycles " + ", ".join(map(str, CYCLES))
    return draw([Panel(title, POINT, "force, N", series, x_limits=[count, 2 * count])])


def torques(run: Run) -> Figure:
    """Fig. 13: torque of joint 1 by who gives it, over the last of the paper's cycles and around touch-down."""
    rows = rows_of(run, FIFTH)
    point, landing = _points(rows, FIFTH), touch_down(rows)
    parts = {name: rows[f"tau_{name}_1"].to_numpy() for name in ("feedforward", "feedback")}
    parts = {"total": parts["feedforward"] + parts["feedback"], **parts}
    shown = {f"joint 1, cycle {FIFTH}": slice(None), "around touch-down": slice(landing - 30, landing + 90)}
    panels = [
        Panel(title, POINT, "torque, N m", [Series(n, point[part], v[part]) for n, v in parts.items()],
              x_limits=[point[landing]])
        for title, part in shown.items()
    ]  # fmt: skip
    return draw(panels)
