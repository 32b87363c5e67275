"""The growing change of torque: its place in the cycle, and its frequency."""

from typing import NamedTuple

import numpy as np

from cmacexp.typing import Array, Mask

AFTER_LIFT_OFF = 20
"""Steps after lift-off that are summed."""


class Mode(NamedTuple):
    """A change of torque over one cycle."""

    change: Array
    """(N, L, J), N m."""
    share_after_lift_off: float
    """Share of its squares in the steps after the lift-off of each leg; NaN without lift-off."""
    frequency: float
    """Where its spectrum peaks, Hz."""
    busiest: int
    """Sample about which it is largest."""


def after_lift_off(support: Mask, steps: int = AFTER_LIFT_OFF) -> Mask:
    """(N, L): whether a leg lifted off no more than ``steps`` samples ago."""
    lifts = ~support & np.roll(support, 1, axis=0)
    recent = np.zeros_like(support)
    for back in range(steps):
        recent |= np.roll(lifts, back, axis=0)
    return recent


def spectrum(change: Array, period: float) -> tuple[Array, Array]:
    """Frequencies (f,), Hz, and power (f,) of a change (N, L, J), all torques together."""
    power = (np.abs(np.fft.rfft(change, axis=0)) ** 2).sum(axis=(1, 2))
    return np.asarray(np.fft.rfftfreq(len(change), period), dtype=float), np.asarray(power)


def describe(change: Array, support: Mask, period: float) -> Mode:
    """Place and frequency of a change (N, L, J) of torque; ``period`` is between samples, s."""
    squares = (change**2).sum(axis=2)
    near = after_lift_off(support)
    share = float(squares[near].sum() / squares.sum()) if near.any() and squares.any() else float("nan")
    frequencies, power = spectrum(change, period)
    smooth = np.convolve(power, np.ones(5) / 5.0, "same")
    wide = np.convolve(np.concatenate([squares.sum(axis=1)] * 3), np.ones(9), "same")[len(change) : 2 * len(change)]
    return Mode(change, share, float(frequencies[np.argmax(smooth)]), int(np.argmax(wide)))
