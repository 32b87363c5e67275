"""The height of sloping ground, for kernels and for whole arrays."""

from typing import TypeVar

import numpy as np

from cmacexp.typing import Array

Places = TypeVar("Places", float, Array)


def rise(slope: float, start: float, x: Places) -> Places:
    """Height of the ground above where it is flat, m.

    Args:
        slope: m/m.
        start: where the slope begins, m.
        x: in the world, m.
    """
    higher: Places = slope * np.maximum(x - start, 0.0)
    return higher
