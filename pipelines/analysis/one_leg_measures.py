"""What the claims about one leg are judged by: oscillations, steps and verdicts, from the rows of a cycle."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.typing import Array
from pipelines.analysis.figures_one_leg import CYCLES, touch_down

if TYPE_CHECKING:
    import pandas as pd

FIRST, SECOND, FIFTH = CYCLES
LANDED, WINDOW = 0.2, 0.2
"""Time after touch-down from which a force is searched for oscillations, and width of the mean it is to leave, s."""
EVENT, TORQUE_WINDOW = 0.3, 0.1
"""Time from touch-down in which the torque changes abruptly, and width of the mean it is to leave, s."""


def judged(*met: bool, failed: str = "not reproduced") -> str:
    """The verdict of a claim of several parts."""
    return "reproduced" if all(met) else "reproduced in part" if any(met) else failed


def by_cycle(metrics: "pd.DataFrame") -> "pd.DataFrame":
    """The metrics of one leg, by cycle."""
    return metrics.set_index("cycle")


def without_trend(values: Array, window: float, period: float) -> Array:
    """What is left of samples when their moving mean over ``window`` seconds is taken off."""
    half = round(window / period / 2.0)
    padded = np.pad(np.asarray(values), half, mode="edge")
    return values - np.convolve(padded, np.ones(2 * half + 1) / (2 * half + 1), "valid")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _period(rows: "pd.DataFrame") -> float:
    return float(rows["time"].iloc[1] - rows["time"].iloc[0])


def force_oscillation(rows: "pd.DataFrame") -> float:
    """RMS of a cycle's force around its moving mean, from ``LANDED`` after touch-down on, N."""
    period = _period(rows)
    force = rows["force"].to_numpy()[touch_down(rows) :]
    return _rms(without_trend(force, WINDOW, period)[round(LANDED / period) :])


def torque_oscillation(rows: "pd.DataFrame") -> tuple[float, float]:
    """RMS of the feedforward torque of joint 1 around its moving mean, N m: after touch-down, and in mid support."""
    period, landing = _period(rows), touch_down(rows)
    left = without_trend(rows["tau_feedforward_1"].to_numpy(), TORQUE_WINDOW, period)
    support = len(rows) - landing
    middle = slice(landing + support // 4, landing + 3 * support // 4)
    return _rms(left[landing : landing + round(EVENT / period)]), _rms(left[middle])


def torque_step(rows: "pd.DataFrame") -> float:
    """Largest change of the torque of joint 1 from one sample to the next around touch-down, N m."""
    landing = touch_down(rows)
    torque = (rows["tau_feedback_1"] + rows["tau_feedforward_1"]).to_numpy()
    return float(np.abs(np.diff(torque[landing - 1 : landing + round(EVENT / _period(rows))])).max())
