"""Measures of the study of one leg from the trace of a run; figures 7 to 9 of Lin & Song 1997 from its plan."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from cmacexp.data.run import read_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.leg import GRAVITY_TERMS, Leg, bias_torque, jacobian, trigonometry
from cmacexp.planning.reference import BEFORE as START
from cmacexp.study import Array, Panel, Run, Series, draw
from pipelines.common_results import find_depression

Config = Mapping[str, Any]
Signals = Mapping[str, Any]
"""Signals of one leg over a cycle by name, and its planned ``support``, (N,) each."""
LANDED = 0.2
"""Time after touch-down from which on the force is searched for oscillations, s."""
FORCE_WINDOW = 0.2
"""Width of the moving mean that is subtracted from the force, s."""
EVENT = 0.3
"""Time after touch-down in which the torque changes abruptly, s."""
TORQUE_WINDOW = 0.1
"""Width of the moving mean that is subtracted from the torque, s."""
BEFORE = 40
"""Data points of support that Fig. 8 and 9 show before the cycle, to make the jumps at lift-off visible."""


def read_signals(rows: pd.DataFrame) -> Signals:
    """Convert the rows of a leg's cycle to arrays."""
    return {name: rows[name].to_numpy() for name in rows} | {"support": (rows["phase"] == "support").to_numpy()}


def touch_down(signals: Signals) -> int:
    """Return the index of the first support sample of a cycle."""
    return int(np.argmax(signals["support"]))


def peak_error(signals: Signals, config: Config, axis: str, extent: str) -> float:
    """Return the largest transfer error along ``axis``, relative to the gait's ``extent``: stroke or lift."""
    error = (signals[axis] - signals[f"{axis}_desired"])[np.logical_not(signals["support"])]
    return float(np.abs(error).max()) / float(config["gait"][extent])


def without_trend(values: Array, window: float, period: float) -> Array:
    """Subtract the moving mean over ``window`` from samples (n,) taken every ``period``, both in s."""
    half = round(window / period / 2.0)
    padded = np.pad(np.asarray(values), half, mode="edge")
    return values - np.convolve(padded, np.ones(2 * half + 1) / (2 * half + 1), "valid")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def force_oscillation(signals: Signals, config: Config) -> float:
    """Return the RMS of a cycle's force around its moving mean, from ``LANDED`` after touch-down on, N."""
    period = config["sampling_period"]
    force = signals["force"][touch_down(signals) :]
    return _rms(without_trend(force, FORCE_WINDOW, period)[round(LANDED / period) :])


def torque_oscillation(signals: Signals, config: Config) -> float:
    """Return the oscillation of joint 1's feedforward torque after touch-down relative to that in mid support.

    The oscillation is the RMS around the moving mean; NaN if nothing is learnt there.
    """
    period = config["sampling_period"]
    landing = touch_down(signals)
    residual = without_trend(signals["tau_feedforward_1"], TORQUE_WINDOW, period)
    quarter = (len(residual) - landing) // 4
    middle = residual[landing + quarter : landing + 3 * quarter]
    landed = _rms(residual[landing : landing + round(EVENT / period)])
    return landed / _rms(middle) if middle.any() else math.nan


def torque_step(signals: Signals, config: Config) -> float:
    """Return the largest change of joint 1's torque between successive samples around touch-down, N m."""
    landing = touch_down(signals)
    torque = signals["tau_feedback_1"] + signals["tau_feedforward_1"]
    return float(np.abs(np.diff(torque[landing - 1 : landing + round(EVENT / config["sampling_period"])])).max())


def reference_depth(config: Config) -> float:
    """Compute the reference depth D_r of eq. 13 for the desired force, m."""
    return find_depression(config) * float(config["force_control"]["desired_force"])


def learned_error(config: Config) -> float:
    """Compute the relative force error with zero feedback: D_r / (1/K_n + P_fn + K_av/K_ap V_fn) / F_d - 1."""
    return find_depression(config) / find_depression(config, static_load=False) - 1.0


def weight_at_foot(signals: Signals, config: Config) -> float:
    """Return the force with which the leg's weight presses on the ground, N; mean over the second half of support."""
    links = config["machine"]["leg"]
    gravity = config["plant"].get("gravity_factors", [1.0] * GRAVITY_TERMS)
    names = ("length_1", "length_2", "mass_1", "mass_2")
    leg = Leg._make([*(links[name] for name in names), -1.0 if links["knee"] == "back" else 1.0, *gravity])
    settled = np.logical_and(signals["support"], signals["progress"] >= 0.5)
    pressing = []
    postures = np.column_stack([signals["q1"], signals["q2"]])[settled]
    for q1, q2 in postures[::20]:  # postures change little from sample to sample
        trig = trigonometry(q1, q2)
        transposed = np.reshape(jacobian(leg, trig), (2, 2)).T
        pressing.append(-np.linalg.solve(transposed, bias_torque(leg, trig, 0.0, 0.0))[1])
    return float(np.mean(pressing))


def measure_weight(run: Run) -> float:
    """Return :func:`weight_at_foot` in cycle 1 of a run; NaN if the cycle is not recorded."""
    rows = run.trace[run.trace["cycle"] == 1]
    return weight_at_foot(read_signals(rows), run.config) if len(rows) else math.nan


def feedback_force(config: Config, weight: float) -> float:
    """Compute the contact force F in static equilibrium with feedback only and a ``weight`` at the foot, N.

    K_ap (D_r - P_fn F - F/K_n) - K_av V_fn F + weight = F.
    """
    gain = float(config["controller"]["position_gain"])
    return (gain * reference_depth(config) + weight) / (1.0 + gain * find_depression(config, static_load=False))


def trajectory(run: Run) -> Figure:
    """Draw Fig. 7: desired path in transfer and reference positions in support."""
    plan = make_scenario(read_config(run, trust=True)).setup.plan
    hip = run.config["machine"]["hip_height"]
    x, desired = plan.desired.position[:, 0].T
    lines = {
        "desired, transfer": (desired, ~plan.support),
        "desired, support": (desired, plan.support),
        "reference D_r, support": (plan.reference.position[START, :, 0, 1], plan.support),
    }
    series = [
        Series(name, 1e3 * x, np.where(phase[:, 0], 1e3 * (hip - y), np.nan)) for name, (y, phase) in lines.items()
    ]
    return draw([Panel("in the plane of the leg", "x forward, mm", "height, mm", series, y_limits=[0.0])], height=3.0)


def motion(run: Run, order: int, name: str, unit: str) -> Figure:
    """Draw Fig. 8 or 9: the derivative ``order`` of the desired path, from shortly before lift-off on."""
    plan = make_scenario(read_config(run, trust=True)).setup.plan
    point = np.arange(-BEFORE, len(plan.support))
    phases = [0.0, int(plan.support.argmax())]
    return draw(
        [
            Panel(f"{name} {side}", "data point", unit, [Series("desired", point, values[point])], x_limits=phases)
            for side, values in zip(("forward", "down"), plan.desired[order][:, 0].T, strict=True)
        ]
    )
