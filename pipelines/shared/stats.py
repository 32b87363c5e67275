"""Means over seeds, with their confidence intervals."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.95


class Spread(NamedTuple):
    """A mean over seeds and half the width of its confidence interval."""

    mean: float
    half: float
    """Of Student's interval at 95 %; NaN of a single value."""

    def __str__(self) -> str:
        return f"{self.mean:.3g} ± {self.half:.2g}" if np.isfinite(self.half) else f"{self.mean:.3g}"


def spread(values: Sequence[float]) -> Spread:
    """The mean of independent values, with its confidence interval (Student 1908).

    >>> str(spread([1.0, 2.0, 3.0]))
    '2 ± 2.5'
    >>> str(spread([4.0]))
    '4'
    """
    from scipy.special import stdtrit

    known = np.asarray(values, dtype=float)
    n = len(known)
    if n < 2:
        return Spread(float(known.mean()) if n else float("nan"), float("nan"))
    student = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2.0))
    return Spread(float(known.mean()), student * float(known.std(ddof=1)) / n**0.5)
