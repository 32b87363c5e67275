"""Quantisation of the inputs of a CMAC."""

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array

Values: TypeAlias = Any
"""A number, or an array of numbers, each of which is treated alike."""
Quanta: TypeAlias = Any
"""An integer, or as many as there are values."""


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
def quantise(value: Values, low: float, high: float, quanta: int) -> Quanta:
    """Quantum 0 to ``quanta - 1`` of a value, or of each of an array; outside [low, high] it is clipped."""
    inside = np.minimum(np.maximum(value, low), high)  # before the floor: far outside it would overflow an integer
    return np.minimum(np.int64(np.floor((inside - low) / (high - low) * quanta)), quanta - 1)
