"""When each foot is in transfer and when it supports, by integer sample counters.

Counting samples, not seconds, keeps events from moving by one sample in some cycles.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.arrays import Array, Mask


class Timing(NamedTuple):
    """Phases over one cycle of N samples, for L legs; half-open: the touch-down sample is support."""

    support: Mask
    """(N, L)"""
    sample: NDArray[np.int64]
    """(N, L): samples since the phase began."""
    transfer_samples: int
    support_samples: int

    @property
    def progress(self) -> Array:
        """(N, L): 0 at the beginning of the phase, 1 at its end."""
        length = np.where(self.support, self.support_samples, max(1, self.transfer_samples))
        return self.sample / length


def touch_downs(pattern: str, samples: int, support_samples: int) -> list[int]:
    """Sample of the cycle at which each leg touches down.

    Args:
        pattern: ``transfer_first`` (one leg: the cycle begins with lift-off) or ``standing`` (one leg).
        samples: N, samples of a cycle.
        support_samples: samples of a support phase.
    """
    return {"transfer_first": [samples - support_samples], "standing": [0]}[pattern]


def make_timing(pattern: str, samples: int, duty_factor: float) -> Timing:
    """Phases of every leg over one cycle of ``samples`` samples."""
    support_samples = round(samples * duty_factor)
    since = (np.arange(samples)[:, None] - np.array(touch_downs(pattern, samples, support_samples))) % samples
    support = since < support_samples
    return Timing(
        support, np.where(support, since, since - support_samples), samples - support_samples, support_samples
    )
