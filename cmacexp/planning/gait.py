"""Transfer and support phases of each foot, by integer sample counters.

Counting samples instead of seconds keeps an event at the same sample in every cycle.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.config.gait import PATTERNS, GaitConfig
from cmacexp.typing import Array, Mask


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


def make_timing(gait: GaitConfig, samples: int) -> Timing:
    """Phases of every leg over one cycle of ``samples`` samples."""
    support_samples = round(samples * gait.duty_factor)
    of_pattern = [(start + slope * gait.duty_factor) % 1.0 for start, slope in PATTERNS[gait.pattern].touch_downs]
    phases = of_pattern if gait.touch_down is None else gait.touch_down
    since = (np.arange(samples)[:, None] - np.rint(np.array(phases) * samples).astype(np.int64)) % samples
    support = since < support_samples
    return Timing(
        support, np.where(support, since, since - support_samples), samples - support_samples, support_samples
    )
