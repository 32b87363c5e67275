"""Whether learning drifts: the feedback, which learning should reduce, grows again from cycle to cycle.

A drift is detected in the first cycle in which both tests hold: the last WINDOW cycles rise significantly, and their
level has risen to DRIFT_RATIO times its lowest so far. A change of the ground that learning compensates, and the
noise of sensors, do not rise in so many pairs of cycles.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.parquet import as_array
from cmacexp.errors import BadRun
from cmacexp.models.trend import SIGNIFICANT, WINDOW
from cmacexp.typing import Array, Mask

DRIFT_RATIO = 1.5
"""Ratio to its lowest level to which the feedback must have risen."""
LEAST = 0.01
"""Ratio to its highest level below which the feedback is so small that its rise does no harm."""

_EARLIER, _LATER = np.triu_indices(WINDOW, 1)


class Drift(NamedTuple):
    """A drift, as known when it was reported; its fields are an entry of the manifest."""

    cycle: int
    """In which the trend started: the middle of the window in which the feedback was lowest."""
    leg: int
    """The first leg that drifts."""
    named: int
    """Cycle in which the drift was detected."""
    growth: float
    """Factor by which the feedback of that leg grows per cycle, at the time of the report."""


def format_drift(drift: Drift, when: str = "") -> str:
    """A drift in one line; ``when`` its growth was measured unless when it was detected."""
    grows = "grows" if drift.growth >= 1.0 else "falls"
    rate = f"feedback of leg {drift.leg} {grows} {100.0 * abs(drift.growth - 1.0):.1f} % per cycle{when}"
    return f"drift detected in cycle {drift.named}, started in cycle {drift.cycle} ({rate})"


class DriftDetector:
    """Applies both tests to the feedback of L legs while a run goes on, some cycles at a time.

    Args:
        legs: L.
    """

    def __init__(self, legs: int):
        self.cycles = 0
        """Cycles tested so far."""
        self.last_logs = np.full((WINDOW - 1, legs), np.nan)
        """Logarithms of the feedback in the last WINDOW - 1 cycles."""
        self.lowest, self.highest = np.full((1, legs), np.inf), np.full((1, legs), -np.inf)
        """Logarithms of the lowest and highest level so far."""
        self.lowest_cycle = np.zeros((1, legs))
        """Middle of the window in which the level was lowest."""
        self.started = np.full((1, legs), np.nan)
        """Cycle in which the drift of each leg started; NaN before one is detected."""
        self.first: Drift | None = None
        """The first drift of all legs."""

    def add(self, feedback: Array) -> tuple[Array, Array]:
        """Test the next cycles of RMS feedback torques (cycles, L).

        Returns:
            Growth at each of these cycles, and the cycle in which a drift started; (cycles, L), undefined NaN.
        """
        if not len(feedback):  # of a run that took no step
            return feedback, feedback
        growth, rises, level = self._test_trend(feedback)
        risen, lowest_cycle = self._test_level(level)
        started = _accumulate(np.fmin, self.started, np.where(rises & risen, lowest_cycle, np.nan))
        self.started = started[-1:]
        if self.first is None and len(detected := np.argwhere(~np.isnan(started))):
            cycle, leg = map(int, detected[0])
            named = self.cycles + cycle + 1
            self.first = Drift(int(started[cycle, leg]), leg + 1, named, float(growth[cycle, leg]))
        self.cycles += len(feedback)
        return growth, started

    def _test_trend(self, feedback: Array) -> tuple[Array, Mask, Array]:
        """Whether the last WINDOW cycles rise significantly (Mann 1945).

        Returns:
            Factor of growth per cycle (Sen 1968), whether it is significant, and the logarithm of the level.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.concatenate([self.last_logs, np.log(feedback)])
            windows = sliding_window_view(logs, WINDOW, axis=0)
            differences = windows[..., _LATER] - windows[..., _EARLIER]
            growth = np.exp(np.median(differences / (_LATER - _EARLIER), axis=-1))
            rises = np.sign(differences).sum(axis=-1) >= SIGNIFICANT
        self.last_logs = logs[1 - WINDOW :]
        return growth, rises, np.median(windows, axis=-1)

    def _test_level(self, level: Array) -> tuple[Mask, Array]:
        """Whether the logarithm of the level has risen far above its lowest, and the cycle in which it was lowest."""
        cycles = np.arange(self.cycles + 1, self.cycles + len(level) + 1)[:, None]
        lowest, highest = _accumulate(np.fmin, self.lowest, level), _accumulate(np.fmax, self.highest, level)
        at_lowest = np.where(level == lowest, cycles - WINDOW // 2, 0.0)
        lowest_cycle = _accumulate(np.fmax, self.lowest_cycle, at_lowest)
        self.lowest, self.highest, self.lowest_cycle = lowest[-1:], highest[-1:], lowest_cycle[-1:]
        return level > np.maximum(lowest, highest + np.log(LEAST)) + np.log(DRIFT_RATIO), lowest_cycle


def _accumulate(function: np.ufunc, before: Array, values: Array) -> Array:
    """Accumulate ``values`` (cycles, L), starting from the accumulated value ``before`` (1, L) them."""
    accumulated: Array = function.accumulate(np.concatenate([before, values]))[1:]
    return accumulated


def follow_drift(feedback: Array) -> tuple[Array, Array]:
    """What :class:`DriftDetector` finds in all cycles of RMS feedback torques (cycles, L)."""
    return DriftDetector(feedback.shape[1]).add(feedback)


def find_drift(metrics: pa.Table) -> Drift | None:
    """The first drift of a run from its metrics, with the growth in its last cycle; None if it does not drift."""
    cycle, leg, started, growth = (as_array(metrics, n) for n in ("cycle", "leg", "drift_cycle", "feedback_growth"))
    detected = np.flatnonzero(~np.isnan(started))
    if not len(detected):
        return None
    first = detected[0]
    last = growth[leg == leg[first]][-1]
    return Drift(int(started[first]), int(leg[first]), int(cycle[first]), float(last))


def make_drift_entry(metrics: pa.Table) -> dict[str, int | float] | None:
    """The entry ``drift`` of a run's manifest: the fields of :class:`Drift`, or nothing."""
    drift = find_drift(metrics)
    return None if drift is None else drift._asdict()


def read_drift_entry(entry: Mapping[str, Any] | None) -> Drift | None:
    """What :func:`make_drift_entry` wrote.

    Raises:
        BadRun: it has other fields.
    """
    try:
        return None if entry is None else Drift(**entry)
    except TypeError:
        raise BadRun(f"drift: must have {', '.join(Drift._fields)} alone; score the run again") from None
