"""Measured velocities of a log beside those of its angles: they show wrong rates and units of angles."""

from collections.abc import Iterator

import numpy as np

from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.model_faults import Fault
from cmacexp.addons.gap.signals import Signals, low_pass

SAME_VELOCITY = (0.8, 1.25)
"""Measured velocity over that of the angles, beyond which their times are wrong."""
ALIKE = (0.9, 0.1)
"""Correlation of both velocities from which a joint counts, and relative difference of their ratio between joints."""


def is_alike(ratio: float | None, factor: float = 1.0) -> bool:
    """Return True if a ``ratio`` of velocities is known and about a ``factor``."""
    return ratio is not None and SAME_VELOCITY[0] < ratio / factor < SAME_VELOCITY[1]


def find_ratio(log: Log) -> float | None:
    """Return how many times those of the angles the measured velocities are.

    None if the log has none, or most joints do not agree.
    """
    if log.velocity is None:
        return None
    measured, own = low_pass(log.velocity, log.period), low_pass(Signals(log).velocity, log.period)
    moves = np.abs(own) > np.sqrt((own**2).mean(axis=0))
    alike = (measured * own).sum(axis=0) / np.sqrt(
        np.maximum((measured**2).sum(axis=0) * (own**2).sum(axis=0), 1e-24)
    )
    agrees = (alike > ALIKE[0]) & moves.any(axis=0)
    if 2 * agrees.sum() <= len(agrees):
        return None
    # medians: rows that are missing here and there change the velocities of the angles around them
    ratios = np.array([np.median(measured[moves[:, j], j] / own[moves[:, j], j]) for j in np.flatnonzero(agrees)])
    ratio = float(np.median(ratios))
    return ratio if (np.abs(ratios - ratio) < ALIKE[1] * np.abs(ratio)).all() else None


def check_velocity(log: Log, ratio: float | None) -> Iterator[Fault]:
    """Yield a fault if measured velocities, ``ratio`` times those of the angles, show another rate, or degrees."""
    known = (1.0, 180.0 / np.pi)  # the latter are velocities in degrees a second, which do not matter
    if ratio is None or any(is_alike(ratio, factor) for factor in known):
        return
    if is_alike(ratio, np.pi / 180.0):
        text = f"measured velocities are {ratio:.3g} times those of the angles: angles are in degrees"
        yield Fault("rate", text, "--units", "angle=deg")
        return
    rate = 1.0 / log.period
    text = (
        f"measured velocities are {ratio:.3g} times those of the angles: the log has {ratio * rate:.4g} rows a "
        f"second, and not {rate:.4g}"
    )
    yield Fault("rate", text, "--rate", f"{ratio * rate:.4g}")
