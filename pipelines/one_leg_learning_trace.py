"""What the study of one leg reads in the trace of a run; and figures 7 to 9 of Lin & Song 1997, of its plan."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from cmacexp.data.run import read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.leg import Leg, bias_torque, jacobian, trigonometry
from cmacexp.planning.reference import BEFORE as START
from cmacexp.study import Array, Panel, Run, Series, draw
from pipelines.common_results import find_depression

Config = Mapping[str, Any]
Measure = Callable[[pd.DataFrame, Config], float]
"""Of the rows of a cycle and the config of its run."""
LANDED, FORCE_WINDOW = 0.2, 0.2
"""Time after touch-down from which a force is searched for oscillations, and width of the mean they leave, s."""
EVENT, TORQUE_WINDOW = 0.3, 0.1
"""Time from touch-down in which the torque changes abruptly, and width of the mean that oscillations leave, s."""
BEFORE = 40
"""Data points of support before the first that Fig. 8 and 9 show, to make the jumps at lift-off visible."""


def in_cycle(number: int, measure: Measure) -> Callable[[Run], float]:
    """The measure of a cycle's rows as one of a run; NaN for a run that recorded no such cycle."""

    def compute(run: Run) -> float:
        rows = run.trace[run.trace["cycle"] == number]
        return measure(rows, run.config) if len(rows) else float("nan")

    return compute


def touch_down(rows: pd.DataFrame) -> int:
    """The first sample of support in a cycle."""
    return int(np.argmax((rows["phase"] == "support").to_numpy()))


def peak_error(rows: pd.DataFrame, config: Config, axis: str, extent: str) -> float:
    """Largest error of the foot in transfer, over the stroke or lift of the gait."""
    swing = rows[rows["phase"] == "transfer"]
    return float((swing[axis] - swing[f"{axis}_desired"]).abs().max()) / float(config["gait"][extent])


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
    return float(np.abs(np.diff(torque[landing - 1 : landing + round(EVENT / config["sampling_period"])])).max())


def reference_depth(config: Config) -> float:
    """D_r of eq. 13, m."""
    return find_depression(config) * float(config["force_control"]["desired_force"])


def learned_error(config: Config) -> float:
    """Relative force error where the feedback is zero: D_r / (1/K_n + P_fn + K_av/K_ap V_fn) / F_d - 1."""
    return find_depression(config) / find_depression(config, static_load=False) - 1.0


def weight_at_foot(rows: pd.DataFrame, config: Config) -> float:
    """What the weight of the leg presses the foot down with in the second half of support, N; mean over postures."""
    links = config["machine"]["leg"]
    sizes = {name: links[name] for name in ("length_1", "length_2", "mass_1", "mass_2")}
    leg = Leg(**sizes, knee=-1.0 if links["knee"] == "back" else 1.0)
    settled = rows[(rows["phase"] == "support") & (rows["progress"] >= 0.5)]
    pressing = []
    for q1, q2 in settled[["q1", "q2"]].iloc[::20].to_numpy():  # postures change little from sample to sample
        trig = trigonometry(q1, q2)
        transposed = np.reshape(jacobian(leg, trig), (2, 2)).T
        pressing.append(-np.linalg.solve(transposed, bias_torque(leg, trig, 0.0, 0.0))[1])
    return float(np.mean(pressing))


def feedback_force(config: Config, weight: float) -> float:
    """Force at which feedback only and a weight at the foot balance the ground, N.

    K_ap (D_r - P_fn F - F/K_n) - K_av V_fn F + weight = F.
    """
    gain = float(config["controller"]["position_gain"])
    return (gain * reference_depth(config) + weight) / (1.0 + gain * find_depression(config, static_load=False))


def trajectory(run: Run) -> Figure:
    """Fig. 7: desired path in transfer and reference positions in support."""
    plan, hip = make_scenario(read_config(run, trust=True)).setup.plan, run.config["machine"]["hip_height"]
    x, desired = plan.desired.position[:, 0].T
    lines = {
        "desired, transfer": (desired, ~plan.support),
        "desired, support": (desired, plan.support),
        "reference D_r, support": (plan.reference.position[START, :, 0, 1], plan.support),
    }
    series = [
        Series(name, 1e3 * x, np.where(shown[:, 0], 1e3 * (hip - y), np.nan)) for name, (y, shown) in lines.items()
    ]
    return draw([Panel("in the plane of the leg", "x forward, mm", "height, mm", series, y_limits=[0.0])], height=3.0)


def motion(run: Run, order: int, name: str, unit: str) -> Figure:
    """Fig. 8, 9: a derivative of the desired path, from shortly before lift-off on."""
    plan = make_scenario(read_config(run, trust=True)).setup.plan
    point, ends = np.arange(-BEFORE, len(plan.support)), [0.0, int(plan.support.argmax())]
    panels = [
        Panel(f"{name} {direction}", "data point", unit, [Series("desired", point, values[point])], x_limits=ends)
        for direction, values in zip(("forward", "down"), plan.desired[order][:, 0].T, strict=True)
    ]
    return draw(panels)
