"""Quantisation of the inputs of a CMAC."""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array


class InputRange(NamedTuple):
    """Range of every input of a CMAC; n is the number of inputs."""

    low: Array
    """(n,): lower end."""
    high: Array
    """(n,): upper end, above ``low``."""


def spanning(values: Array, factor: float) -> InputRange:
    """Ranges of ``factor`` times the span of each column of ``values`` (samples, n), centred on its middle.

    An input that does not vary gets a range of width 1, which has no effect on the output.
    """
    lowest, highest = values.min(axis=0), values.max(axis=0)
    span = np.where(highest > lowest, factor * (highest - lowest), 1.0)
    middle = (lowest + highest) / 2.0
    return InputRange(middle - span / 2.0, middle + span / 2.0)


@kernel
def quantise(value: float, low: float, high: float, quanta: int) -> tuple[int, bool]:
    """Quantum 0 to ``quanta - 1`` of ``value``, and whether it is outside [low, high] and clipped."""
    inside = min(max(value, low), high)  # before the floor: far outside the range it would overflow an integer
    quantum = math.floor((inside - low) / (high - low) * quanta)
    return min(quantum, quanta - 1), value < low or value > high
