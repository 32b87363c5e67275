"""Whether learning drifts: the feedback, which learning is to make small, grows again from cycle to cycle.

A drift is named when the level of the feedback, its median over WINDOW cycles, has risen to RISE times its lowest
so far and the last WINDOW cycles rise with significance (test of trend: Mann 1945; growth: Sen 1968). A change of the
ground that learning takes back, and the noise of sensors, do not rise in so many pairs of cycles.
"""

from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.parquet import as_array
from cmacexp.typing import Array

WINDOW = 10
"""Cycles over which level and growth are told."""
RISE = 1.5
"""Part of its lowest level to which the feedback must have risen."""
LEAST = 0.01
"""Part of its highest level below which the feedback counts as so small that its rise harms nobody."""
SIGNIFICANT = 35
"""Least excess of rising over falling pairs among the 45 of a window: 3 standard deviations of chance."""

_EARLIER, _LATER = np.triu_indices(WINDOW, 1)


class Drift(NamedTuple):
    """A drift, as known when it was told."""

    cycle: int
    """In which the trend started: the middle of the window in which the feedback was lowest."""
    leg: int
    """That drifts first."""
    named: int
    """Cycle in which the drift was named."""
    growth: float
    """Factor by which the feedback of that leg grows per cycle, now."""


def in_words(drift: Drift) -> str:
    """A drift in one line."""
    return (
        f"drift since cycle {drift.cycle}, named in cycle {drift.named}: feedback of leg {drift.leg} "
        f"{drift.growth - 1.0:+.1%} a cycle"
    )


class DriftWatch:
    """Watches the feedback of L legs while a run goes on, some cycles at a time.

    Args:
        legs: L.
    """

    def __init__(self, legs: int):
        self.done = 0
        self.logs = np.full((WINDOW - 1, legs), np.nan)
        self.lowest, self.highest = np.full((1, legs), np.inf), np.full((1, legs), -np.inf)
        self.lowest_at, self.started = np.zeros((1, legs)), np.full((1, legs), np.nan)

    def add(self, feedback: Array) -> tuple[Array, Array]:
        """Take RMS feedback torques (cycles, L) of the next cycles.

        Returns:
            Growth at each of these cycles, and the cycle in which a drift started; (cycles, L), undefined NaN.
        """
        if not len(feedback):  # of a run that took no step
            return feedback, feedback
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.concatenate([self.logs, np.log(feedback)])
            windows = sliding_window_view(logs, WINDOW, axis=0)
            differences = windows[..., _LATER] - windows[..., _EARLIER]
            growth = np.exp(np.median(differences / (_LATER - _EARLIER), axis=-1))
            rises = np.sign(differences).sum(axis=-1) >= SIGNIFICANT
            level = np.median(windows, axis=-1)
        numbers = np.arange(self.done + 1, self.done + len(feedback) + 1)[:, None]
        lowest, highest = _so_far(np.fmin, self.lowest, level), _so_far(np.fmax, self.highest, level)
        lowest_at = _so_far(np.fmax, self.lowest_at, np.where(level == lowest, numbers - WINDOW // 2, 0.0))
        drifts = rises & (level > np.maximum(lowest, highest + np.log(LEAST)) + np.log(RISE))
        started = _so_far(np.fmin, self.started, np.where(drifts, lowest_at, np.nan))
        self.done += len(feedback)
        self.logs, self.lowest, self.highest = logs[1 - WINDOW :], lowest[-1:], highest[-1:]
        self.lowest_at, self.started = lowest_at[-1:], started[-1:]
        return growth, started


def _so_far(by: np.ufunc, before: Array, values: Array) -> Array:
    """``values`` (cycles, L) and what was ``before`` (1, L) them, accumulated."""
    accumulated: Array = by.accumulate(np.concatenate([before, values]))[1:]
    return accumulated


def feedback_growth(feedback: Array) -> Array:
    """Factor by which RMS feedback torques (cycles, L) grow per cycle: Theil-Sen slope of their logarithms."""
    return DriftWatch(feedback.shape[1]).add(feedback)[0]


def drift_cycle(feedback: Array) -> Array:
    """Cycle in which a drift of RMS feedback torques (cycles, L) started, from the cycle on that it is named in."""
    return DriftWatch(feedback.shape[1]).add(feedback)[1]


def drift_of(metrics: pa.Table) -> Drift | None:
    """The first drift of a run from its metrics; None if it does not drift."""
    cycle, leg, started, growth = (as_array(metrics, n) for n in ("cycle", "leg", "drift_cycle", "feedback_growth"))
    named = np.flatnonzero(~np.isnan(started))
    if not len(named):
        return None
    first = named[0]
    own = growth[leg == leg[first]]
    return Drift(int(started[first]), int(leg[first]), int(cycle[first]), float(own[-1]))


def drift_entry(metrics: pa.Table) -> dict[str, int | float] | None:
    """What the manifest of a run says of its drift: the fields of :class:`Drift`, or nothing."""
    found = drift_of(metrics)
    return None if found is None else found._asdict()
