"""Learning that completes but hardly helps, with a likely cause for the summary of a run.

Feedback torque is what learning should take over, so that both it and the error of the feet in transfer should fall
from the first cycle in which the feedforward acts to the last ones. A run whose feedforward already supplies most of
the torque in that cycle has no such expectation.
"""

import math
from typing import Any

import numpy as np

from cmacexp.data.tables import Scores, as_array
from cmacexp.models.trend import TREND_WINDOW
from cmacexp.typing import Array

LITTLE = 0.8
"""Ratio of the last to the first cycles above which learning hardly helps, for error and feedback torque."""
KNOWN = 0.5
"""Share of the feedforward in the torque of the first cycle above which it already knew the torque."""
RESTLESS = 0.3
"""Change of the feedback torque from cycle to cycle, over its size, above which it does not settle."""
DECAY = 0.25
"""Time in which errors decay over the duration of the transfer, in the advice for the position gain."""
LENGTHS = ("transfer_rmse_x", "transfer_rmse_y", "transfer_rmse_z")
"""Metrics of the error of a foot in transfer, m."""


def describe_little_progress(config: dict[str, Any], scores: Scores) -> str:
    """Describe learning that hardly improves on its first cycle, in one line with a likely cause.

    Empty if it does improve, if the run is too short to judge, or if nothing learns. ``config`` is that of the run.
    """
    legs = scores.legs
    if not legs.num_rows or not as_array(legs, "weight_norm")[-1] > 0.0:  # NaN: no built-in feedforward learns
        return ""
    start = config["learning"]["start_cycle"]
    cycle = as_array(legs, "cycle")
    if cycle[-1] < start + TREND_WINDOW:
        return ""
    axes = np.array([as_array(legs, name) for name in LENGTHS if name in legs.column_names])
    error = np.sqrt(_pool(cycle, (axes**2).sum(axis=0)))
    feedback = np.sqrt(_pool(cycle, as_array(legs, "feedback_rms") ** 2))
    first = max(int(start) - 2, 0)  # feedback only, if learning starts later
    is_known = _pool(cycle, as_array(legs, "feedforward_share"))[first] > KNOWN
    last_error, last_feedback = (float(np.median(values[-TREND_WINDOW:])) for values in (error, feedback))
    improves = last_error < LITTLE * error[first] or last_feedback < LITTLE * feedback[first]
    if is_known or improves or not math.isfinite(last_error):
        return ""
    changes = np.abs(np.diff(feedback[-TREND_WINDOW:])) / feedback[-TREND_WINDOW:-1]
    cause = _name_cause(config, float(np.median(changes)))
    numbers = (
        f"{1e3 * error[first]:.3g} mm in cycle {first + 1}, {1e3 * last_error:.3g} mm in the last {TREND_WINDOW}"
    )
    return f"learning hardly helps: transfer error {numbers} (median); {cause}"


def _pool(cycle: Array, values: Array) -> Array:
    """Average the ``values`` (rows,) of each cycle over the legs; ``cycle`` are their numbers from 1 on."""
    rows = cycle.astype(int) - 1
    return np.bincount(rows, values) / np.bincount(rows)


def _name_cause(config: dict[str, Any], change: float) -> str:
    """Name a likely cause: slow feedback, whose torque is a poor learning error; else errors that do not settle."""
    gait = config["gait"]
    position, velocity = (config["controller"].get(f"{name}_gain") for name in ("position", "velocity"))
    transfer = (1.0 - gait["duty_factor"]) * gait["cycle_time"]
    if position and velocity and velocity / position > transfer:
        decay = f"errors decay within {velocity / position:.3g} s (controller.velocity_gain over position_gain)"
        advice = f"use controller.position_gain={velocity / (DECAY * transfer):.2g}, or more"
        return f"{decay}, longer than the transfer of {transfer:.3g} s: {advice}"
    if change > RESTLESS:
        settles = f"the feedback torque changes by {100.0 * change:.0f} % from cycle to cycle"
        return f"{settles}: use a lower learning.rate, or learning.lead=auto"
    return "the feedback torque has settled: use a larger learning.rate, or look for torque limits"
