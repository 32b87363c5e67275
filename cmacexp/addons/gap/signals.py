"""What follows from a log without a model: feedback torque, velocities, strokes, and the lag of the response."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.typing import Array, Counts

WINDOW = 0.075
"""Length of the filter that gives velocities and accelerations from angles (Savitzky & Golay 1964), s."""
CUTOFF = 10.0
"""Cut-off frequency of the low-pass filter of both sides of a regression, Hz."""
LEAST_STROKES = 3
"""Least number of strokes of a log that repeats a motion."""
PROMINENCE = 0.3
"""Least prominence of a turning point between two strokes, over the range of the motion."""
SHORTEST = 0.15
"""Time that the shortest stroke takes, s."""
PARTS = 12
"""Windows of a log whose motion does not repeat."""


def differentiate(values: Array, period: float, order: int = 1, window: float = WINDOW) -> Array:
    """Derivative of signals (n, J) by local cubic polynomials over ``window`` seconds, without a shift in time."""
    from scipy.signal import savgol_filter

    length = max(5, 2 * round(window / period / 2.0) + 1)
    return savgol_filter(values, min(length, (len(values) - 1) // 2 * 2 + 1), 3, order, period, axis=0)


def low_pass(values: Array, period: float, cutoff: float = CUTOFF) -> Array:
    """Signals (n, ...) through a Butterworth filter of second order, forwards and backwards."""
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(2, min(cutoff, 0.4 / period), fs=1.0 / period, output="sos"), values, axis=0)


def find_turns(motion: Array, period: float) -> Counts:
    """Rows where a motion (n, J) turns, on the side that has more turns.

    The motion along its largest principal component is smoothed over 0.2 s.
    """
    from scipy.ndimage import uniform_filter1d
    from scipy.signal import find_peaks

    centred = motion - motion.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    scalar = uniform_filter1d(centred @ axes[0], max(1, round(0.2 / period)))
    rules = {"prominence": PROMINENCE * np.ptp(scalar), "distance": max(1, round(SHORTEST / period))}
    turns: Counts = max((find_peaks(side * scalar, **rules)[0] for side in (1.0, -1.0)), key=len)
    return turns.astype(np.int64)


@dataclass(frozen=True)
class Signals:
    """A log with all that is computed from it alone; arrays (n, J)."""

    log: Log
    delay: int = 0
    """Rows by which commands act later than they are written."""

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the joints, from measured angles, rad/s."""
        return differentiate(self.log.angle, self.log.period)

    @cached_property
    def acceleration(self) -> Array:
        """Acceleration of the joints, from measured angles, rad/s^2."""
        return differentiate(self.log.angle, self.log.period, 2)

    @cached_property
    def command(self) -> Array:
        """Commands when they act, rad; measured angles where the log has no commands."""
        return shift(self.log.angle if self.log.command is None else self.log.command, self.delay)

    @cached_property
    def torque(self) -> Array:
        """Torque of the drives, N m: what a feedforward would have to supply."""
        if self.log.command is None or not self.log.has_gains:
            assert self.log.torque is not None
            return self.log.torque
        return self.compute_torque(self.log.angle) + self.log.feedforward

    def compute_torque(self, angle: Array) -> Array:
        """Feedback torque of the drives at ``angle`` (n, J), by the same filter, N m."""
        rate = shift(self.log.command_velocity, self.delay) - differentiate(angle, self.log.period)
        return self.log.kp * (self.command - angle) + self.log.kd * rate

    @cached_property
    def bounds(self) -> Counts:
        """(strokes + 1,) first rows of the strokes, each from turn to turn, and the end of the last.

        If there are fewer than LEAST_STROKES, the log is cut into PARTS windows.
        """
        motion = self.log.angle if self.log.command is None else self.log.command
        turns = find_turns(motion, self.log.period)
        return turns if len(turns) > LEAST_STROKES else np.linspace(0, len(motion), PARTS + 1).astype(np.int64)

    @property
    def repeats(self) -> bool:
        """Whether the strokes are one motion that repeats; else they are windows of the log."""
        return int(self.bounds[0]) > 0  # where a window begins, a motion cannot turn

    @property
    def count(self) -> int:
        """Number of strokes."""
        return len(self.bounds) - 1

    def rows(self, stroke: int) -> slice:
        """Rows of a stroke, which counts from 1."""
        return slice(int(self.bounds[stroke - 1]), int(self.bounds[stroke]))

    @cached_property
    def stroke(self) -> Counts:
        """(n,) stroke of each row from 1 on; rows before the first belong to it, those after the last to that."""
        found = np.searchsorted(self.bounds, np.arange(len(self.log.time)), side="right")
        return np.clip(found, 1, self.count).astype(np.int64)

    @cached_property
    def phase(self) -> Array:
        """(n,) of each row in its stroke, from 0 to 1."""
        begin, end = self.bounds[self.stroke - 1], self.bounds[self.stroke]
        return np.clip((np.arange(len(self.stroke)) - begin) / (end - begin), 0.0, 1.0)

    @cached_property
    def speed(self) -> Array:
        """(n,) strokes a second."""
        return 1.0 / (np.diff(self.bounds)[self.stroke - 1] * self.log.period)

    @property
    def fastest(self) -> int:
        """The last of the strokes whose period is within 2 % of the shortest."""
        return int(np.flatnonzero(self.periods <= 1.02 * self.periods.min())[-1]) + 1

    @property
    def periods(self) -> Array:
        """(strokes,), s."""
        return np.diff(self.bounds) * self.log.period


def shift(values: Array, rows: int) -> Array:
    """Signals (n, J) later by so many rows; the first row, or the last, is repeated."""
    return values[np.clip(np.arange(len(values)) - rows, 0, len(values) - 1)]


def measure_lag(signals: Signals) -> Array:
    """(strokes, J) lag of measured angles behind their commands in each stroke, s: that of least squared distance."""
    log, first = signals.log, -2
    assert log.command is not None
    errors = np.empty((max(2, round(0.4 / log.period)) - first + 1, signals.count, log.angle.shape[1]))
    for number, own in enumerate(errors):
        apart = log.angle - shift(log.command, first + number)
        own[:] = [np.var(apart[signals.rows(stroke)], axis=0) for stroke in range(1, signals.count + 1)]
    best = np.clip(errors.argmin(axis=0), 1, len(errors) - 2)
    before, at, after = (np.take_along_axis(errors, best[None] + step, 0)[0] for step in (-1, 0, 1))
    bend = before - 2.0 * at + after
    part = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend > 0.0)
    return (best + first + part) * log.period
