"""The metrics of one response, as control engineering defines them.

Rise time, settling time, overshoot: Ogata, Modern Control Engineering, 5th ed. 2010, section 5-3. IAE, ISE, ITAE:
Graham & Lathrop 1953. The same measures as those of a cycle in ``metrics.parquet``, where force starts from 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmacexp.metrics import measures
from cmacexp.typing import Array


class StepInfo(NamedTuple):
    """Metrics of one response in the unit U of its values; undefined ones are NaN, never 0.

    The way is that from start to target. Times are whole samples, from the first one.
    """

    settled: float
    """U: mean over the second half of the samples."""
    steady_state_error: float
    """1: settled - target as a fraction of the way; negative if it stops short."""
    overshoot: float
    """1: largest value beyond the target as a fraction of the way; negative if it never gets there. Not beyond the
    settled value: the response must not exceed the target."""
    ripple: float
    """U: standard deviation over the second half of the samples."""
    rise_time: float
    """s: from 10 % to 90 % of the way from start to settled value; NaN if it never settles, or if the first sample is
    already beyond 10 %."""
    settling_time: float
    """s: until it stays within 2 % of the way from start to settled value around that value; NaN if it never does."""
    rmse: float
    """U: root mean square of value - target."""
    iae: float
    """U s: integral of the absolute error."""
    ise: float
    """U^2 s: integral of the squared error."""
    itae: float
    """U s^2: integral of time times absolute error."""


def step_info(time: ArrayLike, value: ArrayLike, target: float, start: float | None = None) -> StepInfo:
    """Metrics of the response of ``value`` to a step from ``start`` to ``target``, upwards or downwards.

    Args:
        time: (N,) evenly spaced and increasing, s.
        value: (N,) in any unit. For a single sample only the RMSE is defined; with one that is not finite, nothing.
        target: desired value, same unit; may be 0.
        start: initial value; the first of ``value`` unless given.

    Raises:
        ValueError: no samples, times and values that do not match, or times that are not evenly spaced.

    A response upwards by 10 mm, one that is the same downwards, and one that never settles:

    >>> time = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    >>> up = step_info(time, [0.0, 5.0, 9.0, 11.0, 10.0, 10.0, 10.0, 10.0], target=10.0)
    >>> print(f"{up.rise_time:.1f} s, {up.settling_time:.1f} s, {up.overshoot:.0%}, {up.iae:.1f} mm s")
    0.1 s, 0.4 s, 10%, 1.7 mm s
    >>> down = step_info(time, [10.0, 5.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0], target=0.0)
    >>> print(f"{down.rise_time:.1f} s, {down.settling_time:.1f} s, {down.overshoot:.0%}, {down.iae:.1f} mm s")
    0.1 s, 0.4 s, 10%, 1.7 mm s
    >>> cycling = step_info(time, [0.0, 12.0, 8.0, 12.0, 8.0, 12.0, 8.0, 12.0], target=10.0)
    >>> print(cycling.rise_time, cycling.settling_time, cycling.settled, cycling.ripple)
    nan nan 10.0 2.0
    """
    times, values = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    step = _sampling_period(times, values)
    origin = float(values[0] if start is None else start)
    if not np.isfinite([*values, target, origin]).all():
        return StepInfo(*[float("nan")] * len(StepInfo._fields))
    elapsed, goal = times - times[0], np.asarray(target, dtype=float)
    every = np.ones_like(values, dtype=bool)
    second_half = np.arange(len(values)) / len(values) >= 0.5
    settled, error = measures.mean(values, second_half), values - goal
    known_goal = np.where(np.isfinite(settled), goal, np.nan)
    fields = {
        "settled": settled,
        "steady_state_error": measures.steady_state_error(settled, origin, goal),
        "overshoot": measures.overshoot(values, origin, known_goal, every),
        "ripple": measures.ripple(values, second_half),
        "rise_time": measures.rise_time(elapsed, values, origin, settled, every, step),
        "settling_time": measures.settling_time(elapsed, values, origin, settled, every, step),
        "rmse": measures.rms(error, every),
        "iae": measures.iae(error, every, step),
        "ise": measures.ise(error, every, step),
        "itae": measures.itae(elapsed, error, every, step),
    }
    return StepInfo(**{name: float(value) for name, value in fields.items()})


def _sampling_period(time: Array, value: Array) -> float:
    """Of evenly spaced times, s; NaN of a single one."""
    if time.ndim != 1 or time.shape != value.shape or not len(time):
        raise ValueError(f"time and value: shapes {time.shape} and {value.shape}; give one value for each time")
    steps = np.diff(time)
    if not len(steps):
        return float("nan")
    if not (np.isfinite(steps).all() and steps.min() > 0.0 and np.ptp(steps) <= 1e-6 * steps.max()):
        raise ValueError(
            f"time: steps from {steps.min():g} to {steps.max():g} s; give evenly spaced, increasing times"
        )
    return float(steps.mean())
