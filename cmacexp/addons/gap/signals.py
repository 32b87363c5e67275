"""Signals computed from a log without a model: feedback torque, velocities, strokes, and the lag of the response."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.typing import Array, Counts

SMOOTHING_WINDOW = 0.075
"""Window of the filter that differentiates angles to velocities and accelerations (Savitzky & Golay 1964), s."""
CUTOFF = 10.0
"""Cut-off frequency of the low-pass filter that both sides of a regression pass, Hz."""
LEAST_STROKES = 3
"""Least number of strokes for which a motion counts as repeated."""
PROMINENCE = 0.3
"""Least prominence of a turning point between two strokes, relative to the range of the motion."""
SHORTEST = 0.15
"""Least duration of a stroke, s."""
ON_LATTICE = 0.6
"""Share of small steps that are multiples of the smallest one, above which the angles are those of an encoder."""
PARTS = 12
"""Number of windows into which a log is cut whose motion does not repeat."""


def differentiate(values: Array, period: float, order: int = 1, window: float = SMOOTHING_WINDOW) -> Array:
    """Return the derivative of signals (n, J) of the given ``order``, from local cubic polynomials.

    The polynomials are fitted over ``window`` seconds around each row, so that nothing is shifted in time
    (Savitzky & Golay 1964). ``period`` is the spacing of the rows, s.
    """
    from scipy.signal import savgol_filter

    length = max(5, 2 * round(window / period / 2.0) + 1)
    return savgol_filter(values, min(length, (len(values) - 1) // 2 * 2 + 1), 3, order, period, axis=0)


def low_pass(values: Array, period: float, cutoff: float = CUTOFF) -> Array:
    """Filter signals (n, ...) with a second-order Butterworth low-pass, forwards and backwards: without delay.

    ``period`` is the spacing of the rows, s; ``cutoff``, Hz, is limited to 0.4 of the sampling rate.
    """
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(2, min(cutoff, 0.4 / period), fs=1.0 / period, output="sos"), values, axis=0)


def find_turns(motion: Array, period: float) -> Counts:
    """Return the rows in which a motion (n, J) reverses: its maxima or its minima, whichever are more.

    They are those of the motion along its largest principal component, smoothed over 0.2 s. ``period`` is the spacing
    of the rows, s.
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
    """A log and the signals that follow from it without a model, arrays (n, J)."""

    log: Log
    delay: int = 0
    """Delay of the commands, rows: they act that many rows after the one in which they are logged."""
    window: float = SMOOTHING_WINDOW
    """Window of the filter that differentiates angles, s."""

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the joints, from measured angles, rad/s."""
        return differentiate(self.log.angle, self.log.period, window=self.window)

    @cached_property
    def acceleration(self) -> Array:
        """Acceleration of the joints, from measured angles, rad/s^2."""
        return differentiate(self.log.angle, self.log.period, 2, self.window)

    @cached_property
    def command(self) -> Array:
        """Commanded angles, shifted by the delay, rad; the measured angles if the log has no commands."""
        return shift(self.log.angle if self.log.command is None else self.log.command, self.delay)

    @property
    def is_measured(self) -> bool:
        """True if the torque is measured, false if it follows from commands and gains."""
        return self.log.torque is not None

    @cached_property
    def torque(self) -> Array:
        """Torque of the drives, N m: the torque that a perfect feedforward would supply."""
        if self.log.torque is not None:
            return self.log.torque
        return self.compute_torque(self.log.angle) + self.log.feedforward

    def compute_torque(self, angle: Array) -> Array:
        """Compute the feedback torque of the drives, N m, if the joints followed ``angle`` (n, J), rad.

        Velocities come from the same filter as those of the measured angles.
        """
        rate = shift(self.log.command_velocity, self.delay) - differentiate(angle, self.log.period)
        return self.log.kp * (self.command - angle) + self.log.kd * rate

    @cached_property
    def bounds(self) -> Counts:
        """First row of each stroke, which lasts from one turn to the next, and the end of the last, (strokes + 1,).

        A log with fewer than LEAST_STROKES strokes is cut into PARTS windows of equal length instead.
        """
        motion = self.log.angle if self.log.command is None else self.log.command
        turns = find_turns(motion, self.log.period)
        return turns if len(turns) > LEAST_STROKES else np.linspace(0, len(motion), PARTS + 1).astype(np.int64)

    @property
    def repeats(self) -> bool:
        """True if the strokes are repetitions of one motion, false if they are windows of the log."""
        return int(self.bounds[0]) > 0  # windows begin in row 0, in which no motion can reverse

    @property
    def count(self) -> int:
        """Number of strokes."""
        return len(self.bounds) - 1

    def rows(self, stroke: int) -> slice:
        """Return the rows of a ``stroke``; strokes count from 1."""
        return slice(int(self.bounds[stroke - 1]), int(self.bounds[stroke]))

    @cached_property
    def stroke(self) -> Counts:
        """Stroke of each row (n,), from 1 on.

        Rows before the first stroke count as part of it, rows after the last stroke as part of the last.
        """
        strokes = np.searchsorted(self.bounds, np.arange(len(self.log.time)), side="right")
        return np.clip(strokes, 1, self.count).astype(np.int64)

    @cached_property
    def phase(self) -> Array:
        """Phase of each row within its stroke (n,), from 0 to 1."""
        begin, end = self.bounds[self.stroke - 1], self.bounds[self.stroke]
        return np.clip((np.arange(len(self.stroke)) - begin) / (end - begin), 0.0, 1.0)

    @cached_property
    def speed(self) -> Array:
        """Strokes per second in each row (n,)."""
        return 1.0 / (np.diff(self.bounds)[self.stroke - 1] * self.log.period)

    @property
    def fastest(self) -> int:
        """Number of the last stroke whose period is within 2 % of the shortest."""
        return int(np.flatnonzero(self.periods <= 1.02 * self.periods.min())[-1]) + 1

    @property
    def periods(self) -> Array:
        """Duration of each stroke (strokes,), s."""
        return np.diff(self.bounds) * self.log.period


def shift(values: Array, rows: int) -> Array:
    """Delay signals (n, J) by ``rows``, which may be negative; the first, or the last, row is repeated."""
    return values[np.clip(np.arange(len(values)) - rows, 0, len(values) - 1)]


def measure_lag(signals: Signals) -> Array:
    """Return the lag of each measured angle behind its command in each stroke (strokes, J), s.

    It is the shift of the command at which the variance of their difference is least, interpolated between rows by a
    parabola. The log must have commands.
    """
    log = signals.log
    first = -2
    assert log.command is not None
    errors = np.empty((max(2, round(0.4 / log.period)) - first + 1, signals.count, log.angle.shape[1]))
    for number in range(len(errors)):
        apart = log.angle - shift(log.command, first + number)
        errors[number] = [np.var(apart[signals.rows(stroke)], axis=0) for stroke in range(1, signals.count + 1)]
    best = np.clip(errors.argmin(axis=0), 1, len(errors) - 2)
    before, at, after = (np.take_along_axis(errors, best[None] + step, 0)[0] for step in (-1, 0, 1))
    bend = before - 2.0 * at + after
    fraction = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend > 0.0)
    return (best + first + fraction) * log.period


def is_quantised(log: Log) -> bool:
    """Return True if the angles of most joints, while they move, are multiples of the step of an encoder."""
    shares = list[float]()
    for steps in np.abs(np.diff(log.angle, axis=0)).T:
        steps = steps[steps > 1e-6]  # and finite
        if len(steps) > 20:
            few = steps[steps < 20.0 * steps.min()] / steps.min()
            shares.append(float((np.abs(few - np.round(few)) < 0.1).mean()) if len(few) > 10 else 0.0)
    return bool(shares) and float(np.median(shares)) > ON_LATTICE
